#include "learner/run/tensorboard_event.h"

#include <cmath>
#include <limits>

#include "learner/run/tensorboard.pb.h"

namespace slalom::run {
namespace {

constexpr char kVersion[] = "brain.Event:2";

wire::TensorboardEvent MakeEvent(double wall_time, std::int64_t step) {
  wire::TensorboardEvent event;
  event.set_wall_time(wall_time);
  event.set_step(step);
  return event;
}

}  // namespace

std::string EncodeVersionEvent(double wall_time) {
  wire::TensorboardEvent event = MakeEvent(wall_time, 0);
  event.set_file_version(kVersion);
  return event.SerializeAsString();
}

std::string EncodeSessionStart(double wall_time, std::int64_t first_step) {
  wire::TensorboardEvent event = MakeEvent(wall_time, first_step);
  event.mutable_session_log()->set_status(wire::TensorboardSessionLog::START);
  return event.SerializeAsString();
}

std::string EncodeScalars(double wall_time, std::int64_t step, std::span<const Scalar> scalars) {
  wire::TensorboardEvent event = MakeEvent(wall_time, step);
  wire::TensorboardSummary& summary = *event.mutable_summary();
  for (const Scalar& scalar : scalars) {
    if (!(std::abs(scalar.value) <= std::numeric_limits<float>::max())) continue;
    wire::TensorboardSummary::Value& value = *summary.add_value();
    value.set_tag(std::string(scalar.tag));
    value.set_simple_value(static_cast<float>(scalar.value));
  }
  return event.SerializeAsString();
}

}  // namespace slalom::run
