#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "env/environment.h"
#include "sim/contact_world.h"
#include "sim/environment_config.h"
#include "sim/lidar.h"
#include "sim/localisation.h"
#include "sim/robot.h"
#include "sim/scene.h"

namespace slalom::sim {

/// The paper's task on a list of courses: B simulated robots stepped as a batch.
///
/// A step holds the command for `episode.step`, then looks: contact at any of the rigid-body steps
/// is a collision (from the first step on), which ends the episode if `episode.collision_ends`, and
/// else costs at each control step in which a contact begins or lasts; else nearer to the goal than
/// the tolerance at the end of the step is success; else the step limit is a timeout. Frames are
/// taken at the end of the step, and show moving obstacles where they are then.
///
/// In the original, moving obstacles keep running while the robot is put back, so every episode
/// meets them in another phase: here an episode's seed draws the motion time at which it begins,
/// uniformly from 1000 s (0 on a course where nothing moves).
///
/// Odometry and the goal that is observed come from where the robot believes to be
/// (sim/localisation.h); rewards and success from where it is.
///
/// An episode is a value of (config, course, seed, actions), bit for bit, whatever the batch, its
/// order or the number of threads. `Reset` and `Step` allocate nothing, save that the first
/// contacts grow Box2D's own pools. Confined to one thread at a time.
class CourseEnvironments : public env::BatchEnvironment {
 public:
  /// `parallel`: runs the batch on its threads; null: on the caller's. It must outlive this object.
  ///
  /// Throws `base::Error` where the config contradicts itself or where the robot would touch a
  /// fixed obstacle at the start of a course, or moving ones there at nearly any time. Requires:
  /// batch_size >= 1, at least one scene, none null.
  CourseEnvironments(const EnvironmentConfig& config,
                     std::vector<std::shared_ptr<const Scene>> scenes, int batch_size,
                     base::ParallelFor* parallel,
                     Robot::Stepping stepping = Robot::Stepping::kBox2dInContact);

  int batch_size() const override { return static_cast<int>(environments_.size()); }
  int num_courses() const override { return static_cast<int>(scenes_.size()); }

  /// The start pose is jittered as configured; a draw of pose and motion time in which the robot
  /// touches an obstacle is drawn again; after 1000 of them the course's own start pose and motion
  /// time 0 are taken.
  /// Requires: 0 <= i < batch_size(), 0 <= spec.course < num_courses().
  void Reset(int i, const env::EpisodeSpec& spec) override;

  /// Actions are clipped to [-1, 1]. Requires: they are finite where an episode is running.
  void Step(std::span<const env::Action> actions, std::span<env::StepResult> results) override;

  const env::ObservationBatch& observations() const override { return observations_; }
  base::Pose2 robot_pose(int i) const override { return environments_[i].robot.pose(); }
  double motion_time(int i) const override { return environments_[i].motion_time; }

  const EnvironmentConfig& config() const { return config_; }
  const Course& course(int index) const { return scenes_[index]->course(); }

 private:
  struct Environment {
    Environment(const Robot& at_rest, const LocalisationConfig& drift)
        : robot(at_rest), localisation(drift), lidar_noise(0) {}

    const Scene* scene = nullptr;  // Null: never reset.
    Robot robot;
    Localisation localisation;
    base::Random lidar_noise;
    MovingShapes moving;  // Where the last scan saw them.
    env::Action last_action;
    double motion_start = 0.0;   // Motion time at which the episode began, [s].
    double motion_time = 0.0;    // [s]
    double goal_distance = 0.0;  // [m]
    int num_steps = 0;
    bool running = false;
  };

  struct Start {
    base::Pose2 X_WR;
    double motion_time = 0.0;  // [s]
  };

  // Nothing where every draw touches an obstacle.
  std::optional<Start> DrawStart(const Scene& scene, std::uint64_t seed) const;
  bool Touches(const Scene& scene, const base::Pose2& X_WR) const;
  void StepShare(int share);
  env::StepResult StepOne(Environment& environment, const env::Action& action,
                          ContactWorld& contacts) const;
  void Observe(int i);

  const EnvironmentConfig config_;
  const std::vector<std::shared_ptr<const Scene>> scenes_;
  const Footprint footprint_;
  const Lidar lidar_;
  base::ParallelFor* const parallel_;
  std::vector<Environment> environments_;                      // [B]
  std::vector<std::unique_ptr<ContactWorld>> contact_worlds_;  // One per thread.
  env::ObservationBatch observations_;
  // Arguments of the `Step` that is running.
  std::span<const env::Action> actions_;
  std::span<env::StepResult> results_;
};

}  // namespace slalom::sim
