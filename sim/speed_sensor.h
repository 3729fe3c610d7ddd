#pragma once

#include <cstdint>
#include <vector>

#include "base/random.h"
#include "sim/environment_config.h"

namespace slalom::sim {

/// Forward speed [m/s] and turn rate [rad/s]. A value.
struct Speeds {
  double forward = 0.0;
  double turn_rate = 0.0;

  friend bool operator==(const Speeds&, const Speeds&) = default;
};

/// The speeds that a robot observes: its odometry's some time ago, with noise. A value; a copy
/// continues with the same noise.
class SpeedSensor {
 public:
  /// `step`: time between two calls of `Observe`, [s]. Requires: step > 0.
  SpeedSensor(const LocalisationConfig& config, double step);

  /// Takes other settings. Allocates nothing. `Reset` must follow.
  void Configure(const LocalisationConfig& config);

  /// The robot stands, and has stood.
  void Reset(std::uint64_t seed);

  /// Returns what is observed when the odometry says `now`, which are interpolated between the
  /// calls. Allocates nothing.
  Speeds Observe(const Speeds& now);

 private:
  double step_;  // [s]
  double speed_noise_ = 0.0;
  double turn_rate_noise_ = 0.0;
  double delay_ = 0.0;          // [steps]
  std::vector<Speeds> speeds_;  // The newest first, as many as the delay needs.
  base::Random random_;
};

}  // namespace slalom::sim
