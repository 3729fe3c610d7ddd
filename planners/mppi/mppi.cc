#include "planners/mppi/mppi.h"

#include <algorithm>

#include "base/check.h"
#include "base/error.h"
#include "base/vector_clones.h"

namespace slalom::planners {
namespace {

/// Draws in the table of noise; a step of the batch takes a run of them from a random place.
constexpr std::size_t kNoiseTableSize = std::size_t{1} << 17;

/// sampled[b] = mean + deviation * noise[b].
SLALOM_VECTOR_CLONES
void Perturb(const float* noise, float mean, float deviation, int size, float* sampled) {
  for (int b = 0; b < size; ++b) sampled[b] = mean + deviation * noise[b];
}

double LengthOf(std::span<const base::Vec2> path) {
  double length = 0.0;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) length += base::Norm(path[i + 1] - path[i]);
  return length;
}

const MppiConfig& Checked(const MppiConfig& config) {
  if (config.max_angular * config.model_dt > 0.5) {
    throw base::Error("mppi.max_angular times mppi.model_dt is {} rad a step; expected at most 0.5",
                      config.max_angular * config.model_dt);
  }
  return config;
}

}  // namespace

struct MppiPlanner::Cycle {
  const LocalView& view;
  RolloutStart start;
  CriticView critics;
};

MppiPlanner::MppiPlanner(const MppiConfig& config)
    : config_(Checked(config)),
      limits_{static_cast<float>(config.max_acceleration * config.model_dt),
              static_cast<float>(config.max_angular_acceleration * config.model_dt),
              static_cast<float>(config.model_dt)},
      outline_(config.outline_length, config.outline_width),
      clearance_(
          std::max(config.obstacle.inflation_radius + outline_.inscribed_radius(),
                   config.obstacle.collision_margin + outline_.circumscribed_radius() + 0.1)),
      rollouts_(config.batch_size, config.num_steps),
      mean_(1, config.num_steps),
      sequence_(config.num_steps),
      costs_(static_cast<std::size_t>(config.batch_size)),
      weights_(costs_.size()),
      collides_(costs_.size()) {
  Reset(0);
}

void MppiPlanner::Reset(std::uint64_t seed) {
  random_ = base::Random(base::DeriveSeed(seed, "mppi"));
  noise_.resize(kNoiseTableSize + costs_.size());
  for (float& draw : noise_) draw = static_cast<float>(random_.Normal());
  sequence_.Clear();
}

std::optional<Twist> MppiPlanner::ComputeCommand(const LocalView& view) {
  const Cycle cycle = Prepare(view);
  for (int attempt = 0; attempt <= config_.num_retries; ++attempt) {
    if (const auto command = Optimize(cycle)) return command;
    sequence_.Clear();
  }
  return std::nullopt;
}

std::optional<Twist> MppiPlanner::Optimize(const Cycle& cycle) {
  int num_free = 0;
  for (int i = 0; i < config_.num_iterations; ++i) {
    SampleControls();
    Drive(cycle.start, limits_, rollouts_);
    num_free = ScoreRollouts(cycle);
    UpdateSequence(cycle);
  }
  if (num_free == 0) return std::nullopt;
  if (MeanCollides(cycle)) TakeBestRollout();
  LimitControls(config_.min_linear, config_.max_linear, config_.max_angular, limits_,
                cycle.view.velocity, sequence_);
  const Twist command{sequence_.linear.front(), sequence_.angular.front()};
  sequence_.Shift();
  return command;
}

MppiPlanner::Cycle MppiPlanner::Prepare(const LocalView& view) {
  SLALOM_CHECK(!view.path_O.empty());
  const base::Vec2 p_OL = view.X_OR.p;
  clearance_.Update(view.costmap, p_OL);
  CutLocalPath(view.path_O, p_OL, config_.prune_distance, config_.prune_distance,
               config_.path_spacing, local_path_);
  path_.x.clear();
  path_.y.clear();
  for (const base::Vec2 p_O : local_path_.points) {
    path_.x.push_back(static_cast<float>(p_O.x - p_OL.x));
    path_.y.push_back(static_cast<float>(p_O.y - p_OL.y));
  }
  path_.spacing = static_cast<float>(local_path_.spacing);
  path_.length_to_goal = static_cast<float>(local_path_.ends_at_goal ? LengthOf(local_path_.points)
                                                                     : LengthOf(view.path_O));

  const auto [sine, cosine] = base::SinCos(view.X_OR.yaw);
  const RolloutStart start{static_cast<float>(cosine), static_cast<float>(sine),
                           static_cast<float>(view.velocity.linear),
                           static_cast<float>(view.velocity.angular)};
  const base::Vec2 p_LG = view.goal_O - p_OL;
  // A robot that overlaps a cell already may move as long as it gets no deeper.
  const float clearance = outline_.Clearance(clearance_, 0.0f, 0.0f, start.cosine, start.sine);
  CriticView critics{rollouts_,
                     clearance_,
                     outline_,
                     path_,
                     static_cast<float>(p_LG.x),
                     static_cast<float>(p_LG.y),
                     static_cast<float>(base::Norm(p_LG)),
                     start,
                     std::min(0.0f, clearance - 0.01f),
                     limits_.dt};
  return {view, start, critics};
}

void MppiPlanner::SampleControls() {
  const auto linear_std = static_cast<float>(config_.linear_std);
  const auto angular_std = static_cast<float>(config_.angular_std);
  for (int t = 0; t < config_.num_steps; ++t) {
    const std::size_t row = rollouts_.Index(t, 0);
    Perturb(&noise_[random_.UniformInt(kNoiseTableSize)], sequence_.linear[t], linear_std,
            config_.batch_size, &rollouts_.control_linear[row]);
    Perturb(&noise_[random_.UniformInt(kNoiseTableSize)], sequence_.angular[t], angular_std,
            config_.batch_size, &rollouts_.control_angular[row]);
  }
}

int MppiPlanner::ScoreRollouts(const Cycle& cycle) {
  std::fill(costs_.begin(), costs_.end(), 0.0f);
  const CriticView& view = cycle.critics;
  const int num_free = AddObstacleCost(config_.obstacle, view, costs_, collides_);
  SurveyPath(rollouts_, limits_.dt, collides_, clearance_, outline_, path_);
  AddConstraintCost(config_.constraint, config_, view, costs_);
  AddGoalCost(config_.goal, view, costs_);
  AddPathAlignCost(config_.path_align, view, costs_);
  AddPathFollowCost(config_.path_follow, view, costs_);
  AddPathAngleCost(config_.path_angle, view, costs_);
  AddPreferForwardCost(config_.prefer_forward, view, costs_);
  return num_free;
}

void MppiPlanner::UpdateSequence(const Cycle& cycle) {
  AddControlCosts(rollouts_, sequence_, config_.gamma, config_.linear_std, config_.angular_std,
                  costs_);
  SoftmaxOfCosts(costs_, config_.temperature, weights_);
  TakeWeightedMean(rollouts_, weights_, sequence_);
  Smooth(sequence_);
  LimitControls(config_.min_linear, config_.max_linear, config_.max_angular, limits_,
                cycle.view.velocity, sequence_);
}

bool MppiPlanner::MeanCollides(const Cycle& cycle) {
  mean_.control_linear = sequence_.linear;
  mean_.control_angular = sequence_.angular;
  Drive(cycle.start, limits_, mean_);
  const int num_checked =
      std::min(static_cast<int>(config_.validation_time / config_.model_dt), config_.num_steps);
  for (int t = 0; t < num_checked; ++t) {
    if (outline_.Clearance(clearance_, mean_.x[t], mean_.y[t], mean_.cosine[t], mean_.sine[t]) <=
        cycle.critics.collision_clearance) {
      return true;
    }
  }
  return false;
}

void MppiPlanner::TakeBestRollout() {
  const auto best = std::min_element(costs_.begin(), costs_.end()) - costs_.begin();
  for (int t = 0; t < config_.num_steps; ++t) {
    const std::size_t i = rollouts_.Index(t, static_cast<int>(best));
    sequence_.linear[t] = rollouts_.linear[i];
    sequence_.angular[t] = rollouts_.angular[i];
  }
}

std::unique_ptr<LocalPlanner> MakePlanner(const MppiConfig& config, const NavigationConfig&) {
  return std::make_unique<MppiPlanner>(config);
}

}  // namespace slalom::planners
