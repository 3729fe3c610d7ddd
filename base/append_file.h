#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "base/result.h"

namespace slalom::base {

/// A file to whose end records are added, each of them whole or not at all, also where the disk is
/// full. What was added outlives the process, however that ends. Thread-compatible.
class AppendFile {
 public:
  enum class Mode {
    kMakeNew,  ///< There is none yet.
    kGoOn,     ///< Behind what is there, if there is anything.
  };

  /// Throws `base::Error` where the file cannot be opened or made.
  AppendFile(std::filesystem::path path, Mode mode);
  ~AppendFile();
  AppendFile(AppendFile&& other) noexcept;
  AppendFile& operator=(AppendFile&&) = delete;

  /// Adds the bytes. Fails where they cannot be written; the next ones may again.
  [[nodiscard]] std::optional<Failure> Append(std::string_view bytes);

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int fd_;
};

}  // namespace slalom::base
