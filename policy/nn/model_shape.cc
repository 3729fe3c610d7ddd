#include "policy/nn/model_shape.h"

#include <string>

#include "base/check.h"
#include "base/error.h"
#include "env/action.h"
#include "env/observation.h"

namespace slalom::nn {
namespace {

void RequireConsistent(const TransitionModelConfig& config, const NetworkConfig& network) {
  base::ThrowIf(
      config.log_std == LogStdBounds::kBounded && config.log_std_min >= config.log_std_max,
      "model.log_std_min is {}, expected less than log_std_max = {}", config.log_std_min,
      config.log_std_max);
  if (!config.bound_ranges) return;
  base::ThrowIf(
      config.targets != ModelTargets::kAbsolute,
      "model.bound_ranges is true, expected model.targets = \"absolute\", found \"{}\": a change "
      "of range is not bounded by -1 and 1",
      base::EnumName(config.targets));
  base::ThrowIf(
      network.range_transform != RangeTransform::kLinear,
      "model.bound_ranges is true, expected network.range_transform = \"linear\", found \"{}\", "
      "whose features go beyond 1",
      base::EnumName(network.range_transform));
}

}  // namespace

std::int64_t ModelShape::num_member_parameters() const { return network.num_parameters(); }

std::int64_t ModelShape::num_parameters() const { return ensemble * num_member_parameters(); }

ModelShape MakeModelShape(const TransitionModelConfig& config, const NetworkConfig& network,
                          int frame_size, const env::ObservationSpec& observation,
                          const GoalRule& goal) {
  SLALOM_CHECK(config.kind != ModelKind::kNone);
  RequireConsistent(config, network);
  base::ThrowIf(
      observation.state_size != env::kStateSize,
      "model.kind is \"{}\", expected environment.observation to add nothing to the state: a "
      "model predicts {} numbers, goal and last action, and found {}",
      base::EnumName(config.kind), env::kStateSize, observation.state_size);
  ModelShape shape;
  shape.ensemble = config.ensemble;
  shape.num_ranges = frame_size - env::kStateSize;
  shape.num_predicted = config.predict_last_action ? frame_size : frame_size - env::kActionSize;
  shape.probabilistic = config.kind == ModelKind::kProbabilistic;
  shape.difference = config.targets == ModelTargets::kDifference;
  shape.bound_ranges = config.bound_ranges;
  const bool published = config.log_std == LogStdBounds::kPublished;
  shape.num_bounded = published ? shape.num_ranges : shape.num_predicted;
  shape.log_std_min = published ? -1.0f : static_cast<float>(config.log_std_min);
  shape.log_std_max = published ? 1.0f : static_cast<float>(config.log_std_max);
  // Values of FeatureMap's transforms for ranges of the clip and of 0.
  const bool inverse = network.range_transform == RangeTransform::kInverse;
  shape.range_low =
      inverse ? 0.6f / (static_cast<float>(observation.range_clip) + 0.2f) - 0.8f : -1.0f;
  shape.range_high = inverse ? 2.2f : 1.0f;
  if (config.success == ModelSuccess::kKnown) {
    base::ThrowIf(goal.radius <= 0.0,
                  "model.success is \"known\", expected a radius of the goal above 0 beside it");
    const bool bounded = network.goal_transform == GoalTransform::kBounded;
    const double scale = observation.goal_scale + (bounded ? goal.radius : 0.0);
    const auto radius = static_cast<float>(goal.radius / scale);
    shape.squared_goal_radius = radius * radius;
    shape.goal_x_offset = bounded ? 0.0f : 1.0f;
    shape.goal_y_offset = network.goal_transform == GoalTransform::kLinear ? 1.0f : 0.0f;
    shape.goal_reward = static_cast<float>(goal.reward);
  }

  NetworkConfig layers = network;
  layers.dropout = 0.0;
  layers.dropout_everywhere = false;
  layers.encoder_layers = config.encoder_layers;
  layers.head_layers = config.head_layers;
  layers.layer_norm = config.layer_norm;
  try {
    shape.network = CriticShape(layers, frame_size, shape.termination_column() + 1);
  } catch (const base::Error& error) {
    std::string text = error.what();  // These layers are the model's own.
    if (text.starts_with("network.encoder_layers")) text.replace(0, 7, "model");
    throw base::Error(text);
  }
  return shape;
}

}  // namespace slalom::nn
