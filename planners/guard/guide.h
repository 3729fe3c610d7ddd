#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/geometry.h"
#include "env/observation.h"
#include "env/sensing/scan.h"
#include "planners/guard/guard_config.h"
#include "planners/navigation/local_planner.h"
#include "planners/navigation/navigator.h"

/// Frames: `O` odometry (fixed to the ground), `R` the robot. Shapes: `N` beams.

namespace slalom::planners {

/// The planner that a guide plans with, and that drives where the agent does not get on.
struct GuidePlanner {
  NavigationConfig navigation;
  PlannerNavigationConfig own;
  std::function<std::unique_ptr<LocalPlanner>()> make;
};

/// A planner that is asked only while it is awake, and commands standing still otherwise.
class RestingPlanner : public LocalPlanner {
 public:
  explicit RestingPlanner(std::unique_ptr<LocalPlanner> planner) : planner_(std::move(planner)) {}
  void Reset(std::uint64_t seed) override { planner_->Reset(seed); }
  std::optional<Twist> ComputeCommand(const LocalView& view) override {
    return awake ? planner_->ComputeCommand(view) : Twist{};
  }

  bool awake = false;

 private:
  const std::unique_ptr<LocalPlanner> planner_;
};

/// Shows an agent the way where it does not find one: waypoints on a path over what the scans have
/// shown so far, a turn on the spot towards one that is beside or behind the robot, and a planner
/// that drives for a while where the robot does not get on, each time for longer; if it stands,
/// after backing up. Only once the robot has come no nearer to the goal for `guard.waypoint_after`,
/// from then on to the end of the episode. A robot that believes to be at its goal, and is not, is
/// left alone there. Confined to one thread at a time. Cost: about 0.1 ms a step, and 1 ms once it
/// guides.
class Guide {
 public:
  /// `step`: control step, [s].
  Guide(const GuardConfig& config, const GuidePlanner& planner, const env::ScanGeometry& geometry,
        double step);

  /// Begins an episode, and forgets everything before. `seed`: of the planner's random numbers.
  void Reset(const base::Pose2& X_OR, base::Vec2 goal_R, std::uint64_t seed);

  /// What is better than the agent on its own: nothing, another goal for it, or a command.
  struct Advice {
    std::optional<base::Vec2> waypoint_R{};  ///< [m]
    std::optional<Twist> command{};
  };

  /// Takes the newest scan [N] [cm], where the robot was then and how it moved. Once in each step.
  Advice See(std::span<const std::uint16_t> ranges_cm, const env::Odometry& odometry);

 private:
  /// Tells when a distance has not become less by `kProgress` for a time.
  struct Progress {
    double best = 0.0;
    int num_steps = 0;  // Since `best`.

    void Take(double distance);
  };

  /// The way that is left: its length, [m], and the point of the path that is `lookahead` along it,
  /// or the goal if that is nearer.
  struct Way {
    double length = 0.0;
    base::Vec2 waypoint_O;
  };

  Guide(const GuardConfig& config, const GuidePlanner& planner, const env::ScanGeometry& geometry,
        double step, std::unique_ptr<RestingPlanner> resting);
  int Steps(double time) const;
  Way WayFrom(base::Vec2 p_O) const;
  bool IsStuck(base::Vec2 p_O, double way);

  const GuardConfig config_;
  const double step_;              // [s]
  RestingPlanner* const planner_;  // The navigator's.
  Navigator navigator_;
  base::Vec2 goal_O_;
  bool guides_ = false, turns_ = false, has_arrived_ = false;
  Progress to_goal_, along_path_;
  int num_rescues_ = 0, num_rescue_steps_ = 0;  // In this episode; left of the last one.
  int num_back_steps_ = 0;                      // Left before its planner drives.
  std::vector<base::Vec2> places_O_;            // Of the last steps, the newest last.
};

}  // namespace slalom::planners
