#include "learner/run/checkpoint_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/split.h"

namespace slalom::run {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "step-";
constexpr std::string_view kUnfinished = ".unfinished";
constexpr std::string_view kReplaced = ".replaced";
constexpr std::string_view kDamaged = ".damaged";

std::optional<std::int64_t> StepsOf(const fs::path& path) {
  const std::string name = path.filename().string();
  if (!name.starts_with(kPrefix)) return std::nullopt;
  return base::ParseNumber<std::int64_t>(name.substr(kPrefix.size()));
}

void RemoveAll(const fs::path& path) {
  std::error_code ec;
  fs::remove_all(path, ec);
  if (ec) throw base::Error("{}: cannot remove ({})", path.string(), ec.message());
}

}  // namespace

CheckpointStore::CheckpointStore(const fs::path& directory) : directory_(directory) {
  base::MakeDirectories(directory);
  for (const fs::path& entry : base::ListDirectory(directory)) {
    const std::string path = entry.string();
    if (path.ends_with(kUnfinished)) RemoveAll(path);
    if (!path.ends_with(kReplaced)) continue;
    // A crash came between the two renames of `Write`, or before the removal.
    const fs::path target = path.substr(0, path.size() - kReplaced.size());
    if (base::Exists(target)) {
      RemoveAll(path);
    } else {
      base::Rename(path, target);
    }
  }
}

fs::path CheckpointStore::Write(std::int64_t steps,
                                const std::function<void(const fs::path&)>& write) {
  fs::path target = directory_ / fmt::format("{}{}", kPrefix, steps);
  const fs::path unfinished = target.string() + std::string(kUnfinished);
  const fs::path replaced = target.string() + std::string(kReplaced);
  std::error_code ec;
  try {
    base::MakeDirectories(unfinished);
    write(unfinished);
    base::SyncDirectory(unfinished);
    // The same step again, as a stop right after a resume makes.
    if (base::Exists(target)) base::Rename(target, replaced);
    base::Rename(unfinished, target);
    base::SyncDirectory(directory_);
    fs::remove_all(replaced, ec);
  } catch (...) {
    fs::remove_all(unfinished, ec);
    throw;
  }
  return target;
}

std::vector<fs::path> CheckpointStore::Keep(std::size_t num_kept) {
  std::vector<fs::path> all = List();
  std::error_code ignored;
  for (std::size_t i = num_kept; i < all.size(); ++i) {
    // One that is half gone does not count as a checkpoint.
    const fs::path unfinished = all[i].string() + std::string(kUnfinished);
    fs::rename(all[i], unfinished, ignored);
    fs::remove_all(unfinished, ignored);
  }
  all.resize(std::min(all.size(), num_kept));
  return all;
}

void CheckpointStore::SetAside(const fs::path& checkpoint) {
  const fs::path aside = checkpoint.string() + std::string(kDamaged);
  std::error_code ec;
  fs::remove_all(aside, ec);
  base::Rename(checkpoint, aside);
}

std::vector<fs::path> CheckpointStore::List() const {
  std::vector<std::pair<std::int64_t, fs::path>> found;
  for (const fs::path& path : base::ListDirectory(directory_)) {
    if (const auto steps = StepsOf(path)) found.emplace_back(*steps, path);
  }
  std::sort(found.begin(), found.end(), std::greater<>());
  std::vector<fs::path> paths;
  paths.reserve(found.size());
  for (auto& [steps, path] : found) paths.push_back(std::move(path));
  return paths;
}

std::int64_t DirectoryBytes(const fs::path& directory) {
  std::uintmax_t bytes = 0;
  std::error_code ec;
  for (fs::recursive_directory_iterator it(directory, ec), end; !ec && it != end;
       it.increment(ec)) {
    std::error_code gone;
    const std::uintmax_t size = it->is_regular_file(gone) ? it->file_size(gone) : 0;
    bytes += gone ? 0 : size;
  }
  return static_cast<std::int64_t>(bytes);
}

}  // namespace slalom::run
