#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>

#include "base/append_file.h"
#include "base/result.h"

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

  /// Adds one Event with all of these as float32 but those that are not finite. Fails where it
  /// cannot be written; the file is then as it was, and the next one may be.
  [[nodiscard]] std::optional<base::Failure> Append(std::int64_t step,
                                                    std::span<const Scalar> scalars);

  const std::filesystem::path& path() const { return file_.path(); }

 private:
  base::AppendFile file_;
};

}  // namespace slalom::metrics
