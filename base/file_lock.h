#pragma once

#include <filesystem>
#include <string_view>

namespace slalom::base {

/// An exclusive lock on a file or a directory (flock). The destructor releases it, and so does the
/// end of the process, even by a kill. It stays with a file that is renamed. On a file system
/// without locks, nothing is locked. Movable.
class FileLock {
 public:
  /// Locks a file, and creates it if it is missing. Does not wait: throws `Error` with `refusal`
  /// after the path if another object holds the lock. Throws `Error`, too, if the file cannot be
  /// opened.
  static FileLock OfFile(const std::filesystem::path& file, std::string_view refusal);
  /// The same for a directory, which must exist.
  static FileLock OfDirectory(const std::filesystem::path& directory, std::string_view refusal);

  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&&) = delete;

 private:
  FileLock(const std::filesystem::path& path, int flags, std::string_view refusal);

  int fd_;
};

}  // namespace slalom::base
