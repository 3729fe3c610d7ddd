#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/append_file.h"
#include "base/result.h"

namespace slalom::run {

/// A value and the tag under which TensorBoard shows it.
struct Scalar {
  std::string_view tag;
  double value = 0.0;
};

/// The events of TensorBoard's format (learner/run/tensorboard.proto) as protobuf, without the
/// frame that a record of an event file puts around them. `wall_time`: since 1970, UTC, [s].

/// The first event of a file: the version of the format.
std::string EncodeVersionEvent(double wall_time);

/// A session start: readers drop the values of `first_step` and later steps in earlier files.
std::string EncodeSessionStart(double wall_time, std::int64_t first_step);

/// The finite ones among these values as float32. Tags are ASCII.
std::string EncodeScalars(double wall_time, std::int64_t step, std::span<const Scalar> scalars);

/// A TensorBoard event file: records of
///
///   length u64, masked CRC32C of these 8 bytes u32, event (proto/), masked CRC32C of it u32
///
/// in little-endian order. The first event holds the format's version and the second a session
/// start. Each `Append` adds one more. Confined to one thread.
class EventFile {
 public:
  /// Creates `directory`/events.out.tfevents.SECONDS.slalom. Readers take event files in the order
  /// of their names, so SECONDS is larger than in those already there.
  ///
  /// `first_step`: earlier files may hold values of this step and later ones, from a run that was
  /// killed. Readers drop them at this file's session start. Throws `base::Error` if the file
  /// cannot be created.
  EventFile(const std::filesystem::path& directory, std::int64_t first_step);

  /// Adds one event with the finite ones among these values, as float32. If it cannot be written,
  /// the file is left as it was and a later call may succeed.
  [[nodiscard]] std::optional<base::Failure> Append(std::int64_t step,
                                                    std::span<const Scalar> scalars);

  const std::filesystem::path& path() const { return file_.path(); }

 private:
  base::AppendFile file_;
};

}  // namespace slalom::run
