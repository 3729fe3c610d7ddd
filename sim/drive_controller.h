#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/random.h"
#include "sim/environment_config.h"

namespace slalom::sim {

/// Speeds that the drive is asked for. A value.
struct DriveCommand {
  double linear = 0.0;   ///< [m/s]
  double angular = 0.0;  ///< [rad/s]
};

/// Turns commands into wheel speeds: the drive's limits, the delay with its jitter, the gains, and
/// the velocity controller, which ticks at `control_rate` and limits the accelerations. It is the
/// same in every physics.
///
/// Thread-compatible; a value. Allocates only when constructed.
class DriveController {
 public:
  /// `num_ticks`: ticks of the controller in a control step. Requires: num_ticks >= 1.
  DriveController(const RobotConfig& config, int num_ticks);

  /// Forgets all commands and asks the wheels to stand still. `seed` determines the commands'
  /// jitter.
  void Reset(std::uint64_t seed);

  /// Takes the command of the control step that begins now (`linear` [m/s], `angular` [rad/s]).
  void Push(double linear, double angular);

  /// Advances the controller to tick `tick` of the control step, counted from 0, and returns the
  /// speeds that it asks of the wheels. Requires: ticks come in order, after `Push`.
  const DriveCommand& Tick(int tick) {
    const DriveCommand& command = CommandAt(tick);
    wheels_.linear += std::clamp(speed_gain_ * command.linear - wheels_.linear, -max_speed_step_,
                                 max_speed_step_);
    wheels_.angular += std::clamp(yaw_gain_ * command.angular - wheels_.angular,
                                  -max_yaw_rate_step_, max_yaw_rate_step_);
    rolled_ += wheels_.linear * tick_;
    return wheels_;
  }

  /// Forward speed of the wheels, the mean of both sides, [m/s].
  double speed() const { return wheels_.linear; }

  /// Distance that the wheels have rolled forward in the control step, the mean of both sides, [m].
  double rolled() const { return rolled_; }

  /// Sets the wheels' speeds before the next tick, for wheels that the body drags along.
  void Force(const DriveCommand& wheels) { wheels_ = wheels; }

 private:
  struct PendingCommand {
    DriveCommand command;
    int due = 0;  // Ticks from the beginning of the control step until the command takes effect.
  };

  // Returns the newest command that has taken effect. The oldest always has.
  const DriveCommand& CommandAt(int tick) const {
    auto arrived = commands_.begin();
    while (arrived + 1 != commands_.end() && arrived->due > tick) ++arrived;
    return arrived->command;
  }

  const double tick_;               // [s]
  const double max_speed_step_;     // Largest change of speed per tick, [m/s].
  const double max_yaw_rate_step_;  // [rad/s]
  const double linear_limit_;       // [m/s]
  const double angular_limit_;      // [rad/s]
  const double speed_gain_;
  const double yaw_gain_;
  const int num_ticks_;
  const double delay_;   // [ticks]
  const double jitter_;  // [ticks]

  DriveCommand wheels_;                   // The speeds that the controller asks of the wheels.
  double rolled_ = 0.0;                   // Way in this control step, [m].
  std::vector<PendingCommand> commands_;  // Commands of this control step and before, newest first.
  base::Random random_jitter_;
};

}  // namespace slalom::sim
