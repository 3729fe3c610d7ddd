#include "base/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>
#include <vector>

#include "base/error.h"

namespace slalom::base {
namespace {

/// False: an error, which `errno` says.
[[nodiscard]] bool WriteAll(int fd, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

constexpr std::string_view kUnfinished = ".tmp";
constexpr std::size_t kRandomDigits = 16;

/// Owns a file being written; removes it unless it was committed.
class TemporaryFile {
 public:
  /// `named`: name of the target in errors, which may be a link to it.
  TemporaryFile(const std::filesystem::path& target, const std::filesystem::path& named)
      : named_(named), target_(target), path_(target.string() + std::string(kUnfinished)) {
    Open();
    if (fd_ < 0 && errno == EEXIST) {
      // Somebody else writes the same file, perhaps from another machine, or was killed at it.
      std::random_device random;
      path_ += fmt::format("-{:08x}{:08x}", random(), random());
      Open();
    }
    if (fd_ < 0) Fail("cannot create");
  }
  ~TemporaryFile() {
    if (fd_ >= 0) ::close(fd_);
    if (!committed_) ::unlink(path_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  void Append(std::span<const std::byte> bytes) {
    if (!WriteAll(fd_, bytes)) Fail("cannot write");
  }

  void Commit() {
    if (::fsync(fd_) != 0) Fail("cannot write");
    const int closed = ::close(fd_);
    fd_ = -1;
    if (closed != 0) Fail("cannot write");
    if (::rename(path_.c_str(), target_.c_str()) != 0) Fail("cannot rename to");
    committed_ = true;
    SyncDirectory(target_.has_parent_path() ? target_.parent_path() : ".");
  }

 private:
  void Open() { fd_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644); }
  [[noreturn]] void Fail(const char* what) {
    throw Error("{}: {} ({})", named_.string(), what, std::strerror(errno));
  }

  const std::filesystem::path named_;
  const std::filesystem::path target_;
  std::filesystem::path path_;
  int fd_ = -1;
  bool committed_ = false;
};

/// Reads a stream to its end. Throws `Error` if it fails, or if the file at `path` has more than
/// `max_bytes`.
std::string ReadAll(std::istream& in, const std::filesystem::path& path, std::size_t max_bytes) {
  std::string content;
  std::vector<char> piece(1 << 16);
  // The stream's own read tells an error from the end.
  while (in.read(piece.data(), static_cast<std::streamsize>(piece.size())) || in.gcount() > 0) {
    content.append(piece.data(), static_cast<std::size_t>(in.gcount()));
    if (content.size() <= max_bytes) continue;
    throw Error("{}: is no regular file and gives more than {} bytes, expected a file",
                path.string(), max_bytes);
  }
  if (in.bad()) throw Error("{}: cannot read ({})", path.string(), std::strerror(errno));
  return content;
}

/// A device, a pipe or a file that another process holds open, written to as it is.
class Stream {
 public:
  explicit Stream(const std::filesystem::path& path)
      : path_(path), fd_(::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC | O_NOCTTY)) {
    if (fd_ < 0) Fail("cannot open");
  }
  ~Stream() {
    if (fd_ >= 0) ::close(fd_);
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  void Append(std::span<const std::byte> bytes) {
    if (!WriteAll(fd_, bytes)) Fail("cannot write");
  }

  void Close() {
    const int closed = ::close(fd_);
    fd_ = -1;
    if (closed != 0) Fail("cannot write");
  }

 private:
  [[noreturn]] void Fail(const char* what) {
    throw Error("{}: {} ({})", path_.string(), what, std::strerror(errno));
  }

  const std::filesystem::path path_;
  int fd_ = -1;
};

/// The target of a path once its links are followed.
struct Target {
  std::filesystem::path path;  ///< The regular file to replace or make, unless it is a stream.
  bool is_stream = false;
};

/// Throws `Error` if the path leads to a directory or cannot be followed.
Target FollowLinks(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  constexpr int kMaxLinks = 40;  // As Linux itself.
  std::error_code ec;
  Target target{path, false};
  // The type of a file must be known before it is replaced.
  const auto known = [&](const fs::file_status& status) {
    if (fs::status_known(status)) return status;
    throw Error("{}: cannot be looked at ({})", path.string(), ec.message());
  };
  for (int i = 0; i < kMaxLinks && fs::is_symlink(known(fs::symlink_status(target.path, ec)));
       ++i) {
    // Links of /proc (/dev/stdout is one) stand for open files: their texts need not be paths.
    const fs::path directory = fs::weakly_canonical(target.path.parent_path(), ec);
    if (directory.native().starts_with("/proc/")) return {path, true};
    target.path = target.path.parent_path() / fs::read_symlink(target.path, ec);
  }
  const fs::file_status status = known(fs::status(target.path, ec));
  ThrowIf(fs::is_directory(status), "{}: is a directory, expected a file", path.string());
  target.is_stream = fs::exists(status) && !fs::is_regular_file(status);
  return target;
}

}  // namespace

std::string ReadFile(const std::filesystem::path& path) {
  std::error_code ec;
  ThrowIf(std::filesystem::is_directory(path, ec), "{}: is a directory, expected a file",
          path.string());
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    throw Error("{}: cannot open ({})", path.empty() ? "''" : path.string(), std::strerror(errno));
  }
  // Some devices never end.
  constexpr std::size_t kMostOfADevice = 1 << 28;
  const bool is_regular = std::filesystem::is_regular_file(path, ec);
  return ReadAll(in, path, is_regular ? std::numeric_limits<std::size_t>::max() : kMostOfADevice);
}

std::string ReadTextFile(const std::filesystem::path& path) {
  std::string text = ReadFile(path);
  ThrowIf(text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"),
          "{}: is text in UTF-16, expected UTF-8", path.string());
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  return text;
}

void WriteFileAtomically(const std::filesystem::path& path, std::string_view content) {
  WriteFileAtomically(
      path, [content](const AppendBytes& append) { append(std::as_bytes(std::span(content))); });
}

void WriteFileAtomically(const std::filesystem::path& path,
                         const std::function<void(const AppendBytes&)>& write) {
  const Target target = FollowLinks(path);
  if (target.is_stream) {
    Stream stream(path);
    write([&stream](std::span<const std::byte> bytes) { stream.Append(bytes); });
    stream.Close();
    return;
  }
  TemporaryFile file(target.path, path);
  write([&file](std::span<const std::byte> bytes) { file.Append(bytes); });
  file.Commit();
}

bool IsUnfinishedFile(const std::filesystem::path& path) {
  // "NAME.tmp" or "NAME.tmp-0123456789abcdef".
  const std::string extension = path.extension().string();
  return extension == kUnfinished || (extension.starts_with(std::string(kUnfinished) + "-") &&
                                      extension.size() == kUnfinished.size() + 1 + kRandomDigits);
}

void RemoveUnfinishedFiles(const std::filesystem::path& directory) {
  for (const std::filesystem::path& path : ListDirectory(directory)) {
    std::error_code ignored;
    if (IsUnfinishedFile(path) &&
        std::filesystem::is_regular_file(std::filesystem::symlink_status(path, ignored))) {
      std::filesystem::remove(path, ignored);
    }
  }
}

bool IsStream(const std::filesystem::path& path) { return FollowLinks(path).is_stream; }

void Rename(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::error_code error;
  std::filesystem::rename(from, to, error);
  if (!error) return;
  throw Error("{}: cannot rename it to {} ({})", from.string(), to.string(), error.message());
}

void SyncDirectory(const std::filesystem::path& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool is_synced = fd >= 0 && ::fsync(fd) == 0;
  const int error = errno;
  if (fd >= 0) ::close(fd);
  // Some file systems have no such operation on directories, and say so.
  if (is_synced || error == EINVAL || error == ENOTSUP) return;
  throw Error("{}: cannot be synced ({})", path.string(), std::strerror(error));
}

bool Exists(const std::filesystem::path& path) {
  std::error_code ec;
  const bool exists = std::filesystem::exists(path, ec);
  if (ec) throw Error("{}: cannot be looked at ({})", path.string(), ec.message());
  return exists;
}

std::vector<std::filesystem::path> ListDirectory(const std::filesystem::path& path) {
  std::vector<std::filesystem::path> paths;
  std::error_code ec;
  for (std::filesystem::directory_iterator it(path, ec), end; !ec && it != end; it.increment(ec)) {
    paths.push_back(it->path());
  }
  if (ec && ec != std::errc::no_such_file_or_directory) {
    throw Error("{}: cannot be listed ({})", path.string(), ec.message());
  }
  return paths;
}

std::filesystem::path NormalisedDirectory(const std::filesystem::path& directory) {
  const std::filesystem::path normal = directory.lexically_normal();
  const std::filesystem::path named = normal.has_filename() ? normal : normal.parent_path();
  return named.empty() || named == "." ? std::filesystem::current_path() : named;
}

void MakeDirectories(const std::filesystem::path& path) {
  std::error_code ec;
  std::vector<std::filesystem::path> parents;  // Those that get a name.
  for (std::filesystem::path missing = path;
       !missing.empty() && !std::filesystem::exists(missing, ec); missing = missing.parent_path()) {
    parents.push_back(missing.has_parent_path() ? missing.parent_path() : ".");
  }
  std::filesystem::create_directories(path, ec);
  if (ec) throw Error("{}: cannot make the directory ({})", path.string(), ec.message());
  for (const std::filesystem::path& parent : parents) SyncDirectory(parent);
}

std::uint64_t Checksum(std::span<const std::byte> bytes, std::uint64_t seed) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

std::uint64_t Checksum(std::string_view bytes, std::uint64_t seed) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

}  // namespace slalom::base
