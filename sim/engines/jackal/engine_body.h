#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "sim/collision_map.h"
#include "sim/drive_controller.h"
#include "sim/engines/jackal/world.h"
#include "sim/moving_obstacles.h"
#include "sim/robot_body.h"
#include "sim/scene.h"
#include "sim/skid_steering.h"

namespace slalom::engines {

/// Finds the obstacles that a robot may touch within a step of an engine: those within 5 cm of its
/// outline. Thread-compatible.
class NearObstacles {
 public:
  /// Finds at most `max_obstacles`, the nearest.
  NearObstacles(const sim::Footprint& footprint, int max_obstacles);

  /// Returns the obstacles near the robot at motion time `time` [s]; fixed obstacles have speed 0.
  /// The order depends on the arguments alone. Valid until the next call.
  std::span<const sim::MovingShape> Find(const sim::Scene& scene, double time,
                                         const sim::BodyState& robot);

 private:
  void Consider(const sim::MovingShape& shape, const sim::FootprintPose& X_WR);

  struct Candidate {
    float clearance = 0.0f;  // [m]
    sim::MovingShape shape;
  };

  const sim::Footprint footprint_;
  const std::size_t max_obstacles_;
  std::vector<Candidate> candidates_;
  std::vector<sim::MovingShape> found_;
};

/// A robot that an engine moves. The drive's controller ticks as it does in Slalom, and between two
/// ticks the engine takes steps of about a millisecond, with the obstacles that the robot may
/// touch. The robot has touched something if the engine reports a contact, or if it was lifted by
/// more than 0.1 m, which ends an episode of the original, too.
class EngineBody final : public sim::RobotBody {
 public:
  /// `world` steps by `StepOf(config.robot)`. `num_ticks`: ticks of the controller in a control
  /// step.
  EngineBody(const sim::RobotConfig& config, int num_ticks, std::unique_ptr<World> world);

  /// Also draws the angle of each wheel uniformly from `seed`, because the original puts its robot
  /// back with the wheels as the last episode left them, and friction may depend on them.
  void Reset(const base::Pose2& X_WR, std::uint64_t seed) override;
  bool Drive(double linear, double angular, const sim::Scene& scene, double motion_time) override;
  base::Pose2 pose() const override;
  const sim::BodyState& body() const override { return state_; }
  const sim::DriveController& drive() const override { return controller_; }

  /// Steps of the engine between two ticks of the controller: about a millisecond each.
  static int StepsPerTick(const sim::RobotConfig& config);
  /// Duration of such a step, [s].
  static double StepOf(const sim::RobotConfig& config);

 private:
  const int num_ticks_;
  const int steps_per_tick_;
  const double step_;                 // [s]
  const sim::SkidSteering steering_;  // Only for the speed asked of each wheel.
  sim::DriveController controller_;
  NearObstacles near_;
  std::unique_ptr<World> world_;
  sim::BodyState state_;
};

/// Makes bodies in worlds of `make_worlds`, for `sim::CourseEnvironments`. The bodies' errors call
/// the engine `physics`. They throw `base::Error` for a key that no Jackal can honour
/// (`MakeJackal`), and for a course with an obstacle too thin or too fast for steps of a
/// millisecond.
sim::MakeRobotBodies BodiesIn(std::string_view physics, MakeWorlds make_worlds);

}  // namespace slalom::engines
