#pragma once

#include <cstdint>
#include <vector>

#include "base/config_field.h"
#include "env/observation.h"
#include "policy/nn/network_config.h"
#include "policy/nn/network_shape.h"

/// Shapes: `H` frames of history, `R` ranges and `F` = R + env::kStateSize numbers of a frame, `M`
/// <= F of them that a model predicts, `P` parameters of one member of an ensemble.

namespace slalom::nn {

/// Kind of a transition model's predictions.
enum class ModelKind { kNone, kDeterministic, kProbabilistic };
inline base::OneOf EnumNames(ModelKind) { return {"none", "deterministic", "probabilistic"}; }

/// Output of a transition model's network: the change of a frame, or the next frame.
enum class ModelTargets { kDifference, kAbsolute };
inline base::OneOf EnumNames(ModelTargets) { return {"difference", "absolute"}; }

/// How the logarithms of a model's standard deviations are bounded.
enum class LogStdBounds { kBounded, kPublished };
inline base::OneOf EnumNames(LogStdBounds) { return {"bounded", "published"}; }

/// How an imagined episode ends in success.
enum class ModelSuccess { kLearned, kKnown };
inline base::OneOf EnumNames(ModelSuccess) { return {"learned", "known"}; }

/// Settings of a transition model (docs/original-system.md, section 5.1; docs/models.md). Its
/// networks read frames by the encoder of the actor and critics. Part of a policy that carries a
/// model.
struct TransitionModelConfig {
  ModelKind kind = ModelKind::kNone;
  ModelTargets targets = ModelTargets::kDifference;
  int ensemble = 1;
  std::vector<int> encoder_layers = {512, 512};
  std::vector<int> head_layers = {512, 512};
  bool layer_norm = false;
  LogStdBounds log_std = LogStdBounds::kBounded;
  double log_std_min = -5.0;
  double log_std_max = 1.0;
  bool bound_ranges = false;
  bool predict_last_action = false;
  ModelSuccess success = ModelSuccess::kLearned;

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf for_probabilistic{"kind", {"probabilistic"}};
    v("kind", kind,
      "What the model predicts. none: there is no model. deterministic: the next frame. "
      "probabilistic: mean and standard deviation of each number of the next frame.");
    v("targets", targets,
      "What the network computes: the change from the newest frame to the next, or the next frame "
      "itself.");
    v("ensemble", ensemble, base::Range{1, 64}, "",
      "Networks in the ensemble, each trained independently.");
    v("encoder_layers", encoder_layers, base::Range{1, 8192}, "",
      "Widths of the layers before the action enters; [] for none.");
    v("head_layers", head_layers, base::Range{1, 8192}, "",
      "Widths of the layers after the action has entered; [] for none.");
    v("layer_norm", layer_norm, "LayerNorm before each ReLU.");
    v("log_std", log_std,
      "How the logarithms of the standard deviations are bounded. bounded: all lie between "
      "log_std_min and log_std_max, smoothly. published: those of the ranges go through tanh, the "
      "others have no bound.",
      for_probabilistic);
    v("log_std_min", log_std_min, base::Range{-20.0, 20.0}, "",
      "Smallest logarithm of a standard deviation, in units of the features.", for_probabilistic);
    v("log_std_max", log_std_max, base::Range{-20.0, 20.0}, "",
      "Largest logarithm of a standard deviation, in the same units.", for_probabilistic);
    v("bound_ranges", bound_ranges,
      "Pass the predicted means of the ranges through tanh, as published. Otherwise predictions "
      "are clipped to the values that a range can have.");
    v("predict_last_action", predict_last_action,
      "Predict the next frame's last action, too, as published, although it is known.");
    v("success", success,
      "How an imagined episode ends in success. learned: the heads for reward and termination "
      "predict it, as in the paper. known: it ends so if the predicted goal lies within "
      "environment.episode.goal_tolerance; the heads predict the rest.");
  }

  friend bool operator==(const TransitionModelConfig&, const TransitionModelConfig&) = default;
};

/// The condition under which an episode ends in success, a part of the task. A value.
struct GoalRule {
  double radius = 0.0;  ///< The goal is nearer than this, [m].
  double reward = 0.0;  ///< Reward of the success, scaled as the learner's.

  friend bool operator==(const GoalRule&, const GoalRule&) = default;
};

/// The sizes of a transition model: the inputs of its networks and the meaning of their outputs. A
/// value.
///
/// A network reads the stack of frames [H * F] with the action [2] as its extra input, and gives M
/// means, M raw logarithms of standard deviations if probabilistic, the reward and the logit of
/// termination. All members lie in one flat array, [ensemble * P].
struct ModelShape {
  NetworkShape network;
  int ensemble = 1;
  int num_ranges = 0;     ///< R
  int num_predicted = 0;  ///< M: F, or F less the last action, which is filled in.
  bool probabilistic = false;
  bool difference = true;
  bool bound_ranges = false;
  float log_std_min = 0.0f;  ///< Bound of the first `num_bounded` numbers; the others have none.
  float log_std_max = 0.0f;
  int num_bounded = 0;
  float range_low = 0.0f;  ///< The features of ranges of `clip` and 0, in either order.
  float range_high = 0.0f;
  /// Squared distance to the goal, in features, below which an episode succeeds. Negative if
  /// success is learned.
  float squared_goal_radius = -1.0f;
  float goal_x_offset = 1.0f;  ///< Of the goal's features when it is reached, negated.
  float goal_y_offset = 0.0f;
  float goal_reward = 0.0f;

  int history() const { return network.config.history; }  ///< H
  int frame_size() const { return network.frame_size; }   ///< F
  std::int64_t num_member_parameters() const;             ///< P
  std::int64_t num_parameters() const;                    ///< ensemble * P
  int log_std_column() const { return num_predicted; }
  int reward_column() const { return num_predicted * (probabilistic ? 2 : 1); }
  int termination_column() const { return reward_column() + 1; }
  bool knows_success() const { return squared_goal_radius >= 0.0f; }
  /// Whether an episode ends in success in `frame` [F]. False if success is learned.
  bool IsSuccess(const float* frame) const {
    const float x = frame[num_ranges] + goal_x_offset;
    const float y = frame[num_ranges + 1] + goal_y_offset;
    return x * x + y * y < squared_goal_radius;
  }
};

/// Makes the shape of a model that predicts frames of `frame_size` F numbers, written by a
/// `FeatureMap` of `observation` and `network`. `goal` is used if success is known. Throws
/// `base::Error` naming the key if the config contradicts itself or the features. Requires:
/// config.kind is not "none".
ModelShape MakeModelShape(const TransitionModelConfig& config, const NetworkConfig& network,
                          int frame_size, const env::ObservationSpec& observation = {},
                          const GoalRule& goal = {});

}  // namespace slalom::nn
