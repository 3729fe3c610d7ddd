#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

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

}  // namespace slalom::run
