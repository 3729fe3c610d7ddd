#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "app/cli/commands.h"
#include "base/error.h"
#include "base/file.h"
#include "base/progress.h"

/// A consistent copy of the state of a service while it runs.
///
/// What roles write is of three kinds. Most files appear whole and never change (checkpoints,
/// policies), and an open one stays readable after its removal. Segments of the journal and logs
/// grow at the end, and their readers cut off what is incomplete there. An actor's ledger changes
/// in place. So all files of a role are opened first; if one of them is gone by then, the role has
/// gone on meanwhile, and its files are listed again.

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxListings = 100;
constexpr int kMaxReadings = 1000;

class File {
 public:
  /// Nothing if there is no such file any more.
  static std::optional<File> Open(const fs::path& path) {
    const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (fd >= 0) return File(path, fd);
    if (errno == ENOENT) return std::nullopt;
    throw base::Error("{}: cannot open ({})", path.string(), std::strerror(errno));
  }
  ~File() {
    if (fd_ >= 0) ::close(fd_);
  }
  File(File&& other) noexcept
      : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)), size_(other.size_) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  const fs::path& path() const { return path_; }
  std::int64_t size() const { return size_; }

  /// Copies what it held when it was opened.
  void CopyTo(const fs::path& target) const {
    if (path_.filename() == "ledger") return base::WriteFileAtomically(target, ReadUnchanged());
    base::WriteFileAtomically(target, [this](const base::AppendBytes& append) {
      std::vector<std::byte> buffer(1 << 20);
      for (std::int64_t offset = 0; offset < size_;) {
        const std::size_t part = Read(offset, buffer);
        append(std::span(buffer).first(part));
        offset += static_cast<std::int64_t>(part);
      }
    });
  }

 private:
  File(fs::path path, int fd) : path_(std::move(path)), fd_(fd) {
    struct stat status {};
    if (::fstat(fd_, &status) == 0) size_ = status.st_size;
  }

  std::size_t Read(std::int64_t offset, std::span<std::byte> buffer) const {
    const auto rest = static_cast<std::size_t>(size_ - offset);
    const ssize_t part = ::pread(fd_, buffer.data(), std::min(rest, buffer.size()), offset);
    if (part > 0) return static_cast<std::size_t>(part);
    throw base::Error("{}: cannot read ({})", path_.string(),
                      part == 0 ? "it has become shorter" : std::strerror(errno));
  }

  /// The bytes of a small file that changes in place, as they were at one moment.
  std::string ReadUnchanged() const {
    std::string before;
    for (int i = 0; i < kMaxReadings; ++i) {
      std::string now(static_cast<std::size_t>(size_), '\0');
      if (size_ > 0) Read(0, std::as_writable_bytes(std::span(now)));
      if (i > 0 && now == before) return now;
      before = std::move(now);
    }
    throw base::Error("{}: it changes too often to be copied", path_.string());
  }

  fs::path path_;
  int fd_;
  std::int64_t size_ = 0;
};

/// Files and directories that a role makes for itself alone, or has not finished.
bool IsPassing(const fs::path& path) {
  return path.filename() == "lock" || path.extension() == ".unfinished" ||
         base::IsUnfinishedFile(path);
}

/// Whether `path` is `directory` or lies below it. Both are canonical.
bool IsWithin(const fs::path& path, const fs::path& directory) {
  return std::ranges::mismatch(directory, path).in1 == directory.end();
}

/// Throws if `directory`, where links are followed, cannot be copied to `target`. `above`: the
/// directories that led here, canonical like `target`.
void RequireCopyable(const fs::path& directory, const fs::path& target,
                     std::vector<fs::path> above = {}) {
  std::error_code gone;
  const fs::path real = fs::canonical(directory, gone);
  if (gone) return;
  if (std::ranges::find(above, real) != above.end()) {
    throw base::Error(
        "{}: is a symbolic link to {}, which holds it; expected links to directories elsewhere",
        directory.string(), real.string());
  }
  if (IsWithin(target, real)) {
    throw base::Error(
        "{}: lies within {}, which it would be a copy of; expected a directory elsewhere",
        target.string(), directory.string());
  }
  above.push_back(real);
  for (const fs::path& path : base::ListDirectory(directory)) {
    if (IsPassing(path)) continue;
    const fs::file_status status = fs::status(path, gone);
    if (fs::is_directory(status)) RequireCopyable(path, target, above);
    if (!fs::exists(status) && fs::is_symlink(fs::symlink_status(path, gone))) {
      throw base::Error("{}: is a symbolic link to {}, which is not there", path.string(),
                        fs::read_symlink(path, gone).string());
    }
  }
}

/// Opens a file, or the files below a directory. Returns nothing if one of them was removed
/// meanwhile.
std::optional<std::vector<File>> OpenAll(const fs::path& root) {
  std::vector<File> files;
  std::vector<fs::path> paths = {root};
  while (!paths.empty()) {
    const fs::path path = std::move(paths.back());
    paths.pop_back();
    if (IsPassing(path)) continue;
    std::error_code gone;
    const fs::file_status status = fs::status(path, gone);
    if (fs::is_directory(status)) {
      std::ranges::move(base::ListDirectory(path), std::back_inserter(paths));
    } else if (fs::is_regular_file(status)) {
      auto file = File::Open(path);
      if (!file) return std::nullopt;
      files.push_back(std::move(*file));
    } else if (!fs::exists(status)) {
      return std::nullopt;
    }
  }
  return files;
}

struct Copied {
  int files = 0;
  std::int64_t bytes = 0;
};

/// Copies `role`, a file or directory in `state`, to its place in `target`.
void CopyRole(const fs::path& role, const fs::path& state, const fs::path& target, Copied* copied) {
  for (int i = 0; i < kMaxListings; ++i) {
    const auto files = OpenAll(role);
    if (!files) continue;
    for (const File& file : *files) {
      const fs::path to = target / file.path().lexically_relative(state);
      base::MakeDirectories(to.parent_path());
      file.CopyTo(to);
      ++copied->files;
      copied->bytes += file.size();
    }
    return;
  }
  throw base::Error("{}: its files come and go too fast to be copied; try again", role.string());
}

void BackUp(const fs::path& state, const fs::path& target) {
  if (!fs::is_directory(state)) {
    throw base::Error("{}: no such directory, expected a service.state", state.string());
  }
  if (base::Exists(target)) {
    throw base::Error("{}: is there already, expected a new directory for the copy",
                      target.string());
  }
  RequireCopyable(state, fs::weakly_canonical(fs::absolute(target)));
  const fs::path unfinished = target.string() + ".unfinished";
  std::error_code ignored;
  fs::remove_all(unfinished, ignored);
  base::MakeDirectories(unfinished);
  Copied copied;
  // The replay server first: what its copy does not hold and an actor's does is counted as lost by
  // the server. The other way round, steps would be on the server that no actor knows of.
  std::vector<fs::path> roles = base::ListDirectory(state);
  std::stable_partition(roles.begin(), roles.end(),
                        [](const fs::path& path) { return path.filename() == "replay"; });
  for (const fs::path& role : roles) CopyRole(role, state, unfinished, &copied);
  base::Rename(unfinished, target);
  base::SyncDirectory(fs::absolute(target).parent_path());
  fmt::print("{}: {} files, {} bytes\n", target.string(), base::FormatCount(copied.files),
             base::FormatCount(static_cast<double>(copied.bytes)));
}

}  // namespace

void AddBackupCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("backup", "Copy the state of a service consistently while it runs");
  auto state = std::make_shared<std::string>();
  auto target = std::make_shared<std::string>();
  command->add_option("STATE", *state, "Directory that service.state names")->required();
  command->add_option("TARGET", *target, "Directory of the copy, which must not exist")->required();
  command->footer(
      "If roles have states of their own, on several machines or in several volumes, copy that of "
      "the replay\nserver first. docs/operations.md, section Backup and restore, says how a "
      "service goes on from a copy.");
  command->callback([state, target] {
    BackUp(base::NormalisedDirectory(*state), base::NormalisedDirectory(*target));
  });
}

}  // namespace slalom::cli
