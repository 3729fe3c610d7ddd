#pragma once

#include <filesystem>
#include <string_view>

namespace slalom::base {

/// An exclusive lock on a file (flock). The destructor releases it, and so does the end of the
/// process, even by a kill. It stays with a file that is renamed, or whose directory is. Where a
/// file cannot be locked, nothing is, and a warning says so. Movable.
class FileLock {
 public:
  /// Locks a file, and creates it if it is missing. Does not wait: throws `Error` with `refusal`
  /// after the path if another object holds the lock. Throws `Error`, too, if the file cannot be
  /// opened.
  static FileLock OfFile(const std::filesystem::path& file, std::string_view refusal);

  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&&) = delete;

 private:
  FileLock(const std::filesystem::path& path, std::string_view refusal);

  int fd_;
};

}  // namespace slalom::base
