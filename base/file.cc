#include "base/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "base/error.h"

namespace slalom::base {
namespace {

/// Owns a file being written; removes it unless it was committed.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::filesystem::path& target)
      : target_(target), path_(target.string() + ".tmp") {
    fd_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (fd_ < 0) Fail("cannot create");
  }
  ~TemporaryFile() {
    if (fd_ >= 0) ::close(fd_);
    if (!committed_) ::unlink(path_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  void Append(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) Fail("cannot write");
      bytes = bytes.subspan(static_cast<std::size_t>(n));
    }
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
  [[noreturn]] void Fail(const char* what) {
    throw Error(fmt::format("{}: {} ({})", target_.string(), what, std::strerror(errno)));
  }

  const std::filesystem::path target_;
  const std::filesystem::path path_;
  int fd_ = -1;
  bool committed_ = false;
};

}  // namespace

std::string ReadFile(const std::filesystem::path& path) {
  std::error_code ec;
  if (std::filesystem::is_directory(path, ec)) {
    throw Error(fmt::format("{}: is a directory, expected a file", path.string()));
  }
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error(fmt::format("{}: cannot open ({})", path.string(), std::strerror(errno)));
  std::ostringstream content;
  content << in.rdbuf();
  if (in.bad()) throw Error(fmt::format("{}: cannot read", path.string()));
  return std::move(content).str();
}

void WriteFileAtomically(const std::filesystem::path& path, std::string_view content) {
  WriteFileAtomically(
      path, [content](const AppendBytes& append) { append(std::as_bytes(std::span(content))); });
}

void WriteFileAtomically(const std::filesystem::path& path,
                         const std::function<void(const AppendBytes&)>& write) {
  TemporaryFile file(path);
  write([&file](std::span<const std::byte> bytes) { file.Append(bytes); });
  file.Commit();
}

void SyncDirectory(const std::filesystem::path& path) {
  if (const int fd = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); fd >= 0) {
    ::fsync(fd);
    ::close(fd);
  }
}

void MakeDirectories(const std::filesystem::path& path) {
  std::error_code ec;
  std::filesystem::create_directories(path, ec);
  if (ec)
    throw Error(fmt::format("{}: cannot make the directory ({})", path.string(), ec.message()));
}

std::uint64_t Checksum(std::span<const std::byte> bytes, std::uint64_t seed) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

std::uint64_t Checksum(std::string_view bytes, std::uint64_t seed) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

}  // namespace slalom::base
