#include "sim/speed_sensor.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::sim {

SpeedSensor::SpeedSensor(const LocalisationConfig& config, double step) : step_(step), random_(0) {
  SLALOM_CHECK_GT(step, 0.0);
  speeds_.reserve(static_cast<std::size_t>(std::ceil(kMaxSpeedDelay / step)) + 1);
  Configure(config);
}

void SpeedSensor::Configure(const LocalisationConfig& config) {
  SLALOM_CHECK_LE(config.speed_delay, kMaxSpeedDelay);
  speed_noise_ = config.speed_noise;
  turn_rate_noise_ = config.turn_rate_noise;
  delay_ = config.speed_delay / step_;
  speeds_.resize(static_cast<std::size_t>(std::ceil(delay_)) + 1);
}

void SpeedSensor::Reset(std::uint64_t seed) {
  std::ranges::fill(speeds_, Speeds{});
  random_ = base::Random(seed);
}

Speeds SpeedSensor::Observe(const Speeds& now) {
  std::shift_right(speeds_.begin(), speeds_.end(), 1);
  speeds_.front() = now;
  const auto age = static_cast<std::size_t>(delay_);
  const double share = delay_ - static_cast<double>(age);
  const Speeds& newer = speeds_[age];
  const Speeds& older = speeds_[std::min(age + 1, speeds_.size() - 1)];
  Speeds observed{(1.0 - share) * newer.forward + share * older.forward,
                  (1.0 - share) * newer.turn_rate + share * older.turn_rate};
  if (speed_noise_ > 0.0) observed.forward += speed_noise_ * random_.Normal();
  if (turn_rate_noise_ > 0.0) observed.turn_rate += turn_rate_noise_ * random_.Normal();
  return observed;
}

}  // namespace slalom::sim
