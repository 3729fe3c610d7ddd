#include "learner/run/run_directory.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/file.h"

namespace slalom::run {

namespace fs = std::filesystem;

fs::path RunDirectory::snapshot(std::int64_t steps) const {
  return snapshots() / fmt::format("step-{:012}.safetensors", steps);
}

std::vector<fs::path> RunDirectory::ListSnapshots() const {
  std::vector<fs::path> paths = base::ListDirectory(snapshots());
  std::erase_if(paths, [](const fs::path& path) { return path.extension() != ".safetensors"; });
  std::ranges::sort(paths);
  return paths;
}

RunLock::RunLock(const fs::path& root)
    : FileLock(OfFile(RunDirectory{root}.lock(),
                      "another process is training in this directory; stop it, or choose another "
                      "--name")) {}

}  // namespace slalom::run
