#include "planners/mppi/mppi_critics.h"

#include <algorithm>
#include <cmath>

#include "base/vector_clones.h"

namespace slalom::planners {
namespace {

/// By how much a path point may be farther along the path than a rollout drove to it, [m].
constexpr float kFurthestSlack = 0.2f;

float Power(float base, int exponent) {
  float result = base;
  for (int i = 1; i < exponent; ++i) result *= base;
  return result;
}

/// costs[b] += (weight * measures[b]) ^ power.
SLALOM_VECTOR_CLONES
void AddWeighted(const CriticWeight& critic, const float* measures, int size, float* costs) {
  const auto weight = static_cast<float>(critic.weight);
  if (critic.power == 1) {
    for (int b = 0; b < size; ++b) costs[b] += weight * measures[b];
    return;
  }
  for (int b = 0; b < size; ++b) costs[b] += Power(weight * measures[b], critic.power);
}

/// sums[b] += distance of (x[b], y[b]) to a point.
SLALOM_VECTOR_CLONES
void AddDistances(const float* x, const float* y, float to_x, float to_y, int size, float* sums) {
  for (int b = 0; b < size; ++b) {
    const float dx = x[b] - to_x, dy = y[b] - to_y;
    sums[b] += std::sqrt(dx * dx + dy * dy);
  }
}

/// sums[b] += how far speeds[b] is outside of [low, high].
SLALOM_VECTOR_CLONES
void AddExcess(const float* speeds, float low, float high, int size, float* sums) {
  for (int b = 0; b < size; ++b) {
    const float above = speeds[b] - high, below = low - speeds[b];
    sums[b] += (above > 0.0f ? above : 0.0f) + (below > 0.0f ? below : 0.0f);
  }
}

/// sums[b] += how far linear[b] * angular[b] is beyond `limit`, either way.
SLALOM_VECTOR_CLONES
void AddLateralExcess(const float* linear, const float* angular, float limit, int size,
                      float* sums) {
  for (int b = 0; b < size; ++b) {
    const float excess = std::abs(linear[b] * angular[b]) - limit;
    sums[b] += excess > 0.0f ? excess : 0.0f;
  }
}

/// Keeps, for each rollout, the nearest of the path points shown to it so far; a point at `length`
/// along the path counts only if the rollout drove as far.
SLALOM_VECTOR_CLONES
void TakeNearer(const float* x, const float* y, const float* driven, float to_x, float to_y,
                float length, int index, int size, float* nearest, int* nearest_index) {
  for (int b = 0; b < size; ++b) {
    const float dx = x[b] - to_x, dy = y[b] - to_y;
    const float squared = driven[b] >= length ? dx * dx + dy * dy : 1e30f;
    const bool nearer = squared < nearest[b];
    nearest[b] = nearer ? squared : nearest[b];
    nearest_index[b] = nearer ? index : nearest_index[b];
  }
}

/// sums[b] += values[b] * factor.
SLALOM_VECTOR_CLONES
void AddScaled(const float* values, float factor, int size, float* sums) {
  for (int b = 0; b < size; ++b) sums[b] += factor * values[b];
}

/// Adds the length from the last point to this one, and finds the path point at that length.
SLALOM_VECTOR_CLONES
void WalkOn(const float* x, const float* y, const float* last_x, const float* last_y,
            float points_per_metre, float last_index, int size, float* walked, int* index) {
  for (int b = 0; b < size; ++b) {
    const float dx = x[b] - last_x[b], dy = y[b] - last_y[b];
    walked[b] += std::sqrt(dx * dx + dy * dy);
    const float place = walked[b] * points_per_metre + 0.5f;
    index[b] = static_cast<int>(place < last_index ? place : last_index);
  }
}

/// Returns the first free path point from `offset` points beyond the furthest one reached, or the
/// last.
int TargetOnPath(const CriticPath& path, int offset, bool must_be_free) {
  const int last = static_cast<int>(path.x.size()) - 1;
  int target = std::min(path.furthest + offset, last);
  while (must_be_free && target < last && !path.is_free[target]) ++target;
  return target;
}

/// Returns whether too much of the path is blocked for the robot to keep to it.
bool IsBlocked(const MppiPathAlignConfig& config, const CriticPath& path) {
  const int reach = static_cast<int>(config.occupancy_check_distance / path.spacing);
  const int num_checked =
      std::min(std::max(path.furthest, reach), static_cast<int>(path.is_free.size()));
  const auto num_blocked = std::count(path.is_free.begin(), path.is_free.begin() + num_checked, 0);
  return num_blocked > 2 && static_cast<double>(num_blocked) >
                                config.max_occupancy_ratio * static_cast<double>(num_checked);
}

}  // namespace

void SurveyPath(const Rollouts& rollouts, float dt, std::span<const char> collides,
                const ClearanceMap& clearance, const DiscOutline& outline, CriticPath& path) {
  const int num_points = static_cast<int>(path.x.size());
  path.is_free.resize(path.x.size());
  for (int i = 0; i < num_points; ++i) {
    path.is_free[i] = clearance.At(path.x[i], path.y[i]) > outline.inscribed_radius();
  }
  const auto batch_size = static_cast<std::size_t>(rollouts.batch_size);
  std::vector<float> driven(batch_size, 0.0f), nearest(batch_size, 1e30f);
  std::vector<int> nearest_index(batch_size, 0);
  for (int t = 0; t < rollouts.num_steps; ++t) {
    AddScaled(&rollouts.linear[rollouts.Index(t, 0)], dt, rollouts.batch_size, driven.data());
  }
  for (float& way : driven) way = std::abs(way);
  const std::size_t end = rollouts.Index(rollouts.num_steps - 1, 0);
  for (int i = 0; i < num_points; ++i) {
    const float length = path.spacing * static_cast<float>(i) - kFurthestSlack;
    TakeNearer(&rollouts.x[end], &rollouts.y[end], driven.data(), path.x[i], path.y[i], length, i,
               rollouts.batch_size, nearest.data(), nearest_index.data());
  }
  path.furthest = 0;
  for (std::size_t b = 0; b < batch_size; ++b) {
    if (!collides[b]) path.furthest = std::max(path.furthest, nearest_index[b]);
  }
}

void AddConstraintCost(const MppiConstraintConfig& config, const MppiConfig& limits,
                       const CriticView& view, std::span<float> costs) {
  const Rollouts& r = view.rollouts;
  std::vector<float> excess(costs.size(), 0.0f);
  for (int t = 0; t < r.num_steps; ++t) {
    AddExcess(&r.linear[r.Index(t, 0)], static_cast<float>(limits.min_linear),
              static_cast<float>(limits.max_linear), r.batch_size, excess.data());
    AddLateralExcess(&r.linear[r.Index(t, 0)], &r.angular[r.Index(t, 0)],
                     static_cast<float>(limits.max_lateral_acceleration), r.batch_size,
                     excess.data());
  }
  for (float& e : excess) e *= view.dt;
  AddWeighted(config.cost, excess.data(), r.batch_size, costs.data());
}

int AddObstacleCost(const MppiObstacleConfig& config, const CriticView& view,
                    std::span<float> costs, std::span<char> collides) {
  const Rollouts& r = view.rollouts;
  const auto margin = static_cast<float>(config.collision_margin);
  const auto inflation = static_cast<float>(config.inflation_radius);
  const float near = view.outline.circumscribed_radius() + margin + view.clearance.resolution();
  const float inscribed = view.outline.inscribed_radius();
  const bool repels = view.goal_distance > config.near_goal_distance;
  int num_free = 0;
  for (int b = 0; b < r.batch_size; ++b) {
    float critical = 0.0f, repulsive = 0.0f;
    int num_points = 0;
    collides[b] = 0;
    for (int t = 0; t < r.num_steps; t += config.point_step, ++num_points) {
      const std::size_t i = r.Index(t, b);
      const float distance = view.clearance.At(r.x[i], r.y[i]);
      repulsive += std::max(inflation - (distance - inscribed), 0.0f);
      if (distance > near) continue;
      const float clearance =
          view.outline.Clearance(view.clearance, r.x[i], r.y[i], r.cosine[i], r.sine[i]);
      if (clearance <= view.collision_clearance) {
        collides[b] = 1;
        break;
      }
      critical += std::max(margin - clearance, 0.0f);
    }
    if (collides[b]) {
      costs[b] += static_cast<float>(config.collision_cost);
      continue;
    }
    ++num_free;
    float cost = static_cast<float>(config.critical_weight) * critical;
    if (repels) {
      cost +=
          static_cast<float>(config.repulsion_weight) * repulsive / static_cast<float>(num_points);
    }
    costs[b] += Power(cost, config.power);
  }
  return num_free;
}

void AddGoalCost(const MppiGoalConfig& config, const CriticView& view, std::span<float> costs) {
  if (view.goal_distance > config.threshold) return;
  const Rollouts& r = view.rollouts;
  std::vector<float> distances(costs.size(), 0.0f);
  for (int t = 0; t < r.num_steps; ++t) {
    AddDistances(&r.x[r.Index(t, 0)], &r.y[r.Index(t, 0)], view.goal_x, view.goal_y, r.batch_size,
                 distances.data());
  }
  for (float& d : distances) d /= static_cast<float>(r.num_steps);
  AddWeighted(config.cost, distances.data(), r.batch_size, costs.data());
}

void AddPathAlignCost(const MppiPathAlignConfig& config, const CriticView& view,
                      std::span<float> costs) {
  const CriticPath& path = view.path;
  if (path.length_to_goal < config.threshold || path.furthest < config.offset_from_furthest ||
      IsBlocked(config, path)) {
    return;
  }
  const Rollouts& r = view.rollouts;
  const float points_per_metre = 1.0f / path.spacing;
  const auto last_index = static_cast<float>(path.x.size() - 1);
  std::vector<float> walked(costs.size(), 0.0f), sums(costs.size(), 0.0f);
  std::vector<int> index(costs.size()), num_samples(costs.size(), 0);
  for (int t = config.point_step; t < r.num_steps; t += config.point_step) {
    const std::size_t now = r.Index(t, 0), last = r.Index(t - config.point_step, 0);
    WalkOn(&r.x[now], &r.y[now], &r.x[last], &r.y[last], points_per_metre, last_index, r.batch_size,
           walked.data(), index.data());
    for (int b = 0; b < r.batch_size; ++b) {
      const int i = index[b];
      if (!path.is_free[i]) continue;
      const float dx = path.x[i] - r.x[now + b], dy = path.y[i] - r.y[now + b];
      sums[b] += std::sqrt(dx * dx + dy * dy);
      ++num_samples[b];
    }
  }
  for (int b = 0; b < r.batch_size; ++b) sums[b] /= static_cast<float>(std::max(num_samples[b], 1));
  AddWeighted(config.cost, sums.data(), r.batch_size, costs.data());
}

void AddPathFollowCost(const MppiPathFollowConfig& config, const CriticView& view,
                       std::span<float> costs) {
  const CriticPath& path = view.path;
  if (path.length_to_goal < config.threshold) return;
  const int target = TargetOnPath(path, config.offset_from_furthest, true);
  const Rollouts& r = view.rollouts;
  const std::size_t end = r.Index(r.num_steps - 1, 0);
  std::vector<float> distances(costs.size(), 0.0f);
  AddDistances(&r.x[end], &r.y[end], path.x[target], path.y[target], r.batch_size,
               distances.data());
  AddWeighted(config.cost, distances.data(), r.batch_size, costs.data());
}

void AddPathAngleCost(const MppiPathAngleConfig& config, const CriticView& view,
                      std::span<float> costs) {
  if (view.goal_distance < config.threshold) return;
  const CriticPath& path = view.path;
  const int target = TargetOnPath(path, config.offset_from_furthest, false);
  const auto angle_to = [&](float x, float y, float cosine, float sine) {
    const float dx = path.x[target] - x, dy = path.y[target] - y;
    return std::abs(std::atan2(cosine * dy - sine * dx, cosine * dx + sine * dy));
  };
  if (angle_to(0.0f, 0.0f, view.start.cosine, view.start.sine) < config.max_angle) return;
  const Rollouts& r = view.rollouts;
  std::vector<float> angles(costs.size());
  for (int b = 0; b < r.batch_size; ++b) {
    const std::size_t i = r.Index(r.num_steps - 1, b);
    angles[b] = angle_to(r.x[i], r.y[i], r.cosine[i], r.sine[i]);
  }
  AddWeighted(config.cost, angles.data(), r.batch_size, costs.data());
}

void AddPreferForwardCost(const MppiPreferForwardConfig& config, const CriticView& view,
                          std::span<float> costs) {
  if (view.goal_distance < config.threshold) return;
  const Rollouts& r = view.rollouts;
  std::vector<float> backward(costs.size(), 0.0f);
  for (int t = 0; t < r.num_steps; ++t) {
    AddExcess(&r.linear[r.Index(t, 0)], 0.0f, 1e30f, r.batch_size, backward.data());
  }
  for (float& way : backward) way *= view.dt;
  AddWeighted(config.cost, backward.data(), r.batch_size, costs.data());
}

}  // namespace slalom::planners
