#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>

namespace slalom::metrics {

/// A scalar under its tag, as TensorBoard shows it.
struct Scalar {
  std::string_view tag;
  double value = 0.0;
};

/// A TensorBoard event file: records of
///
///   length u64, masked CRC32C of these 8 bytes u32, Event (protobuf), masked CRC32C of it u32
///
/// little-endian. The first Event holds the format's version, the second a session start; then one
/// for each `Append`. Confined to one thread.
class EventFile {
 public:
  /// Makes `directory`/events.out.tfevents.SECONDS.slalom, with SECONDS above those of the event
  /// files already there, as readers take them in the order of their names. `first_step`: what
  /// earlier files hold of this step and later ones was made by a run that was killed since, and is
  /// superseded; readers drop it at the session start. Throws `base::Error` where the file cannot
  /// be made.
  EventFile(const std::filesystem::path& directory, std::int64_t first_step);

  /// Adds one Event with all of these as float32 but those that are not finite, and flushes it.
  /// Throws `base::Error` where it cannot be written.
  void Append(std::int64_t step, std::span<const Scalar> scalars);

  const std::filesystem::path& path() const { return path_; }

 private:
  void Write(std::string_view event);

  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::filesystem::path path_;
  std::unique_ptr<std::FILE, Close> file_;
};

}  // namespace slalom::metrics
