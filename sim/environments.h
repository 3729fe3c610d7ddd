#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "env/environment.h"
#include "env/sensing/obstacle_tracker.h"
#include "env/state_layout.h"
#include "sim/environment_config.h"
#include "sim/lidar.h"
#include "sim/localisation.h"
#include "sim/randomized_config.h"
#include "sim/robot.h"
#include "sim/robot_body.h"
#include "sim/scene.h"
#include "sim/scene_stream.h"
#include "sim/speed_sensor.h"

namespace slalom::sim {

/// The paper's task on a list of courses: B simulated robots stepped as a batch.
///
/// A step holds the command for `episode.step` and then decides the outcome, in this order:
///
/// - Contact at any of the rigid-body steps, the first included, is a collision. It ends the
///   episode if `episode.collision_ends`; if not, every control step in which a contact begins or
///   lasts has a cost.
/// - A robot that is nearer to the goal than the tolerance at the end of the step, or beyond
///   `episode.finish_ahead`, has succeeded. With `episode.look_period` this is only decided at the
///   end of a period.
/// - At the step limit the episode ends in a timeout.
///
/// Frames are taken at the end of the step and show moving obstacles where they are then.
///
/// An episode's seed draws the motion time of the obstacles at which it begins, uniformly from 1000
/// s (0 on a course where nothing moves).
///
/// Odometry and the observed goal follow from the robot's estimate of its pose
/// (sim/localisation.h), rewards and success from its true pose, unless
/// `LocalisationConfig::decides_arrival`.
///
/// Fields of `EnvironmentConfig::randomize` have values drawn from the episode's seed. The episode
/// is the same, bit for bit, as that of a config with these values.
///
/// An episode is a function of (config, course, seed, actions), bit for bit. It does not depend on
/// the batch, its order or the number of threads. `Reset` and `Step` do not allocate, except that
/// the first contacts grow Box2D's own pools, and that `Reset` makes another robot if a field of
/// the robot is drawn. Confined to one thread at a time.
class CourseEnvironments : public env::BatchEnvironment {
 public:
  /// `parallel` runs the batch on its threads and must outlive this object. If it is null, the
  /// batch runs on the caller's thread. `make_bodies` makes the robots of a physics. With `fresh`,
  /// its course i has the number `num_courses()` + i.
  ///
  /// Throws `base::Error` as `CheckConsistent` does, or if at the start of a course (of the fresh
  /// ones, the first) the robot would touch a fixed obstacle, or moving ones at nearly any time;
  /// and the errors of `make_bodies`.
  ///
  /// Requires: batch_size >= 1, at least one scene or `fresh`, no scene is null.
  CourseEnvironments(const EnvironmentConfig& config,
                     std::vector<std::shared_ptr<const Scene>> scenes, int batch_size,
                     base::ParallelFor* parallel, const MakeRobotBodies& make_bodies = MakeRobots(),
                     std::unique_ptr<SceneStream> fresh = nullptr);

  int batch_size() const override { return static_cast<int>(environments_.size()); }
  int num_courses() const override { return static_cast<int>(scenes_.size()); }
  bool has_fresh_courses() const override { return fresh_ != nullptr; }

  /// Draws the start pose, jittered as configured, and the motion time, until the robot touches no
  /// obstacle. After 1000 draws it takes the course's own start pose and motion time 0. Different
  /// environments may be reset at the same time.
  /// Requires: 0 <= i < batch_size(), spec.course >= 0, and below num_courses() without fresh ones.
  void Reset(int i, const env::EpisodeSpec& spec) override;

  /// Actions are clipped to [-1, 1]. Requires: they are finite for every environment with a running
  /// episode.
  void Step(std::span<const float> actions, std::span<env::StepResult> results) override;

  const env::ObservationBatch& observations() const override { return observations_; }
  base::Pose2 robot_pose(int i) const override { return environments_[i].robot->pose(); }
  double motion_time(int i) const override { return environments_[i].motion_time; }

  const EnvironmentConfig& config() const { return config_; }
  const Course& course(int index) const { return scenes_[index]->course(); }
  /// The course and the robot of environment `i`, for drivers that may know everything.
  /// Requires: environment `i` was reset.
  const Scene& scene(int i) const { return *environments_[i].scene; }
  const RobotBody& robot(int i) const { return *environments_[i].robot; }

 private:
  struct Environment {
    Environment(std::unique_ptr<RobotBody> body, const EnvironmentConfig& config)
        : robot(std::move(body)),
          localisation(config.localisation),
          speed_sensor(config.localisation, config.episode.step),
          lidar_noise(0),
          actions(static_cast<std::size_t>(config.observation.commands)) {}

    std::shared_ptr<const Scene> scene;             // Null before the first `Reset`.
    std::unique_ptr<RandomizedConfig> task;         // Null if nothing is drawn.
    std::unique_ptr<Lidar> lidar;                   // Null if nothing of it is drawn.
    std::unique_ptr<env::ObstacleTracker> tracker;  // Null if tracks are not observed.
    std::unique_ptr<RobotBody> robot;
    Localisation localisation;
    SpeedSensor speed_sensor;
    base::Random lidar_noise;
    MovingShapes moving;               // As the last scan saw them.
    std::vector<env::Action> actions;  // The last ones, the newest first.
    double motion_start = 0.0;         // Motion time at which the episode began, [s].
    double motion_time = 0.0;          // [s]
    double goal_distance = 0.0;        // [m]
    int num_steps = 0;
    bool running = false;
    bool touched = false;  // Whether the robot touched anything in the last step.
  };

  struct Start {
    base::Pose2 X_WR;
    double motion_time = 0.0;  // [s]
  };

  void RequireDrivable(const Scene& scene) const;
  void RequireBodies(RandomizedConfig& task) const;
  void DrawTask(Environment& environment, std::uint64_t seed) const;
  // Returns nothing if every draw touches an obstacle.
  std::optional<Start> DrawStart(const Scene& scene, std::uint64_t seed) const;
  bool Touches(const Scene& scene, const base::Pose2& X_WR) const;
  void DriveGroup(int group);
  void EndStep(int i);
  RobotBody::Order OrderFor(Environment& environment, const env::Action& action) const;
  env::StepResult ResultOf(Environment& environment) const;
  bool IsLookedAt(const Environment& environment) const;
  bool HasArrived(const Environment& environment) const;
  void Observe(int i);

  const EnvironmentConfig config_;
  const env::StateWriter state_writer_;
  const std::vector<std::shared_ptr<const Scene>> scenes_;
  const std::unique_ptr<SceneStream> fresh_;  // May be null.
  const MakeRobotBodies make_bodies_;
  const Footprint footprint_;
  const Lidar lidar_;
  base::ParallelFor* const parallel_;
  std::vector<Environment> environments_;  // [B]
  env::ObservationBatch observations_;
  // Arguments of the `Step` that is running.
  std::span<const env::Action> actions_;
  std::span<env::StepResult> results_;
};

}  // namespace slalom::sim
