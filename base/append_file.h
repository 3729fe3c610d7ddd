#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "base/result.h"

namespace slalom::base {

/// A file to which records are appended. Each record is written completely or not at all, even if
/// the disk is full, and survives the process, however it ends. Thread-compatible.
class AppendFile {
 public:
  enum class Mode {
    kMakeNew,  ///< The file must not exist yet.
    kGoOn,     ///< Appends to the file if it exists, and makes it if not.
  };

  /// Throws `base::Error` if the file cannot be opened or created.
  AppendFile(std::filesystem::path path, Mode mode);
  ~AppendFile();
  AppendFile(AppendFile&& other) noexcept;
  AppendFile& operator=(AppendFile&&) = delete;

  /// Appends the bytes. Returns a failure if they cannot be written; later calls may succeed again.
  [[nodiscard]] std::optional<Failure> Append(std::string_view bytes);

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int fd_;
};

}  // namespace slalom::base
