#pragma once

#include <span>
#include <vector>

#include "planners/mppi/mppi_config.h"
#include "planners/mppi/rollouts.h"
#include "planners/navigation/clearance_map.h"

/// The cost of rollouts: each function is one critic of Nav2's nav2_mppi_controller and adds its
/// cost to every rollout's.
///
/// Shapes: `B` rollouts, `T` steps, `P` path points. Frames: `L` axes of O at the robot's place.

namespace slalom::planners {

/// The path as the critics see it, in L.
struct CriticPath {
  std::vector<float> x, y;      ///< [P] at equal spacing, starting at the robot, P >= 1, [m].
  std::vector<char> is_free;    ///< [P] 0 if the robot's inscribed circle hits an obstacle here.
  float spacing = 0.0f;         ///< [m]
  float length_to_goal = 0.0f;  ///< Length of the whole plan from here to the goal, [m].
  int furthest = 0;  ///< The point farthest along the path that a rollout ends nearest to.
};

/// The input of all critics.
struct CriticView {
  const Rollouts& rollouts;
  const ClearanceMap& clearance;
  const DiscOutline& outline;
  const CriticPath& path;
  float goal_x = 0.0f, goal_y = 0.0f;  ///< In L, [m].
  float goal_distance = 0.0f;          ///< [m]
  RolloutStart start;
  float collision_clearance = 0.0f;  ///< A rollout collides at this clearance or less, [m].
  float dt = 0.05f;                  ///< [s]
};

/// Marks the path points whose inscribed circle is free, and finds `furthest` among the rollouts
/// that do not collide (`collides`: [B], 1 if it does); it is 0 if all collide. Unlike in Nav2, a
/// rollout cannot reach a path point much farther along the path than the way it drove. If the path
/// comes back behind a wall, the nearest point would lead the robot into that wall. Cost: B x P.
void SurveyPath(const Rollouts& rollouts, float dt, std::span<const char> collides,
                const ClearanceMap& clearance, const DiscOutline& outline, CriticPath& path);

void AddConstraintCost(const MppiConstraintConfig& config, const MppiConfig& limits,
                       const CriticView& view, std::span<float> costs);

/// Also writes which rollouts collide, [B], 1 if it does. Returns how many do not.
int AddObstacleCost(const MppiObstacleConfig& config, const CriticView& view,
                    std::span<float> costs, std::span<char> collides);

void AddGoalCost(const MppiGoalConfig& config, const CriticView& view, std::span<float> costs);
void AddPathAlignCost(const MppiPathAlignConfig& config, const CriticView& view,
                      std::span<float> costs);
void AddPathFollowCost(const MppiPathFollowConfig& config, const CriticView& view,
                       std::span<float> costs);
void AddPathAngleCost(const MppiPathAngleConfig& config, const CriticView& view,
                      std::span<float> costs);
void AddPreferForwardCost(const MppiPreferForwardConfig& config, const CriticView& view,
                          std::span<float> costs);

}  // namespace slalom::planners
