#include "sim/drive_controller.h"

#include <cmath>

#include "base/check.h"

namespace slalom::sim {

DriveController::DriveController(const RobotConfig& config, int num_ticks)
    : tick_(1.0 / config.control_rate),
      max_speed_step_(config.linear_acceleration * (1.0 / config.control_rate)),
      max_yaw_rate_step_(config.angular_acceleration * (1.0 / config.control_rate)),
      linear_limit_(config.linear_speed_limit),
      angular_limit_(config.angular_speed_limit),
      speed_gain_(config.speed_gain),
      yaw_gain_(config.yaw_gain),
      num_ticks_(num_ticks),
      delay_(config.command_delay * config.control_rate),
      jitter_(config.command_jitter * config.control_rate),
      random_jitter_(0) {
  SLALOM_CHECK_GE(num_ticks, 1);
  const int latest = static_cast<int>(std::lround(delay_ + jitter_));
  commands_.resize(1 + (latest + num_ticks - 1) / num_ticks);
}

void DriveController::Reset(std::uint64_t seed) {
  wheels_ = {};
  rolled_ = 0.0;
  std::fill(commands_.begin(), commands_.end(), PendingCommand{});
  random_jitter_ = base::Random(seed);
}

void DriveController::Push(double linear, double angular) {
  rolled_ = 0.0;
  for (PendingCommand& pending : commands_) pending.due -= num_ticks_;
  const double lateness = jitter_ > 0.0 ? random_jitter_.Uniform(0.0, jitter_) : 0.0;
  const int due = static_cast<int>(std::lround(delay_ + lateness));
  const int not_before = commands_.front().due;
  std::move_backward(commands_.begin(), commands_.end() - 1, commands_.end());
  commands_.front() = {{std::clamp(linear, -linear_limit_, linear_limit_),
                        std::clamp(angular, -angular_limit_, angular_limit_)},
                       std::max(due, not_before)};
}

}  // namespace slalom::sim
