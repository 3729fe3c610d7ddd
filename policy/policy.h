#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "env/action.h"
#include "env/observation.h"
#include "env/step_shape.h"
#include "policy/nn/model_shape.h"
#include "policy/nn/network_config.h"
#include "policy/nn/network_shape.h"
#include "policy/nn/safetensors.h"

namespace slalom::policy {

/// The kind of distribution whose parameters a policy's outputs are.
enum class DistributionKind { kDeterministic, kGaussian };
inline base::OneOf EnumNames(DistributionKind) { return {"deterministic", "gaussian"}; }

/// How a policy's outputs become an action. A value.
///
/// deterministic: a = tanh(x) of A outputs. gaussian: a = tanh(mean + std * noise) of 2 A outputs,
/// mean and raw log std. Without exploration the agent takes tanh(mean), the mode.
struct ActionDistribution {
  DistributionKind kind = DistributionKind::kDeterministic;
  double log_std_min = 0.0;  ///< Lower bound of a gaussian's log std.
  double log_std_max = 0.0;

  bool is_deterministic() const { return kind == DistributionKind::kDeterministic; }
  /// Outputs for an action of A numbers.
  int num_outputs(int action_size) const { return (is_deterministic() ? 1 : 2) * action_size; }
  /// Logarithm of the standard deviation, from the network's output x: between the bounds by
  /// tanh(x) (docs/original-system.md, section 3.2).
  float log_std(float x) const {
    return static_cast<float>(log_std_min) +
           0.5f * static_cast<float>(log_std_max - log_std_min) * (std::tanh(x) + 1.0f);
  }

  template <class Visitor>
  void Visit(Visitor& v) {
    v("kind", kind);
    v("log_std_min", log_std_min, base::Range{-20.0, 5.0});
    v("log_std_max", log_std_max, base::Range{-20.0, 5.0});
  }

  friend bool operator==(const ActionDistribution&, const ActionDistribution&) = default;
};

/// The parts of a policy that agents plan with: a transition model, and the discount and goal of
/// its critic. A value. Without a model ("none") a policy carries none of them.
struct PlanningSpec {
  nn::TransitionModelConfig model;
  double gamma = 0.99;  ///< Discount per step that its critic was trained with.
  nn::GoalRule goal;    ///< Goal of the task that it was trained for.

  template <class Visitor>
  void Visit(Visitor& v) {
    v("gamma", gamma, base::Range{0.0, 1.0});
    v("goal_radius", goal.radius, base::Range{0.0, 1e6});
    v("goal_reward", goal.reward, base::Range{0.0, 1e12});
    model.Visit(v);
  }

  bool is_carried() const { return model.kind != nn::ModelKind::kNone; }
  friend bool operator==(const PlanningSpec&, const PlanningSpec&) = default;
};

/// The observation, network and action bounds of a policy. A value.
struct PolicySpec {
  env::ObservationSpec observation;
  nn::NetworkConfig network;
  int action_size = env::kActionSize;  ///< A
  env::ActionBounds actions;           ///< Of a robot on a course.
  ActionDistribution distribution;
  PlanningSpec planning;

  env::StepShape step_shape() const {
    return {observation.num_beams, observation.state_size, action_size};
  }
  /// Throws `base::Error`, "SOURCE: ..., expected a policy for courses", if it is not for a robot
  /// with a range finder that drives on a course.
  void RequireCourses(const std::string& source) const;
  /// These throw `base::Error` if the sectors do not divide the beams, or as `ActorShape` does.
  nn::NetworkShape actor_shape() const;
  nn::NetworkShape critic_shape(int num_outputs = 1) const;
  /// Throws, too, if the model contradicts itself. Requires: planning.is_carried().
  nn::ModelShape model_shape() const;
};

/// A policy at one moment of its training. A value; the weights are shared and never
/// change.
struct PolicySnapshot {
  std::int64_t version = 0;  ///< Rises with each snapshot that a learner gives out.
  PolicySpec spec;
  std::shared_ptr<const std::vector<float>> weights;  ///< [spec.actor_shape().num_parameters()]
  /// Weights of the model, [spec.model_shape().num_parameters()], and of one critic. Null unless
  /// the spec says that the policy carries them.
  std::shared_ptr<const std::vector<float>> model_weights = nullptr;
  std::shared_ptr<const std::vector<float>> critic_weights = nullptr;
};

/// The policy without its model and critic, which only agents that plan need.
PolicySnapshot WithoutPlanning(PolicySnapshot snapshot);

/// A policy of version -1 whose weights are all 0.
PolicySnapshot ZeroSnapshot(const PolicySpec& spec);

struct LoadedPolicy {
  PolicySnapshot snapshot;
  nn::Metadata metadata;  ///< As given to `PrintPolicy`.
};

/// A policy as the bytes of a safetensors file, which is also how it travels in messages: tensors
/// "actor.encoder.0.weight" and so on, "critic...." and "model.0...." for each member of a model's
/// ensemble if the policy carries them, and `metadata` (config, commit, seed, steps, ...) beside
/// the spec.
std::string PrintPolicy(const PolicySnapshot& snapshot, const nn::Metadata& metadata);

/// Parses the bytes of a policy, which are untrusted. Throws `base::Error` that begins with
/// `source` if they are cut short, damaged or not a policy of this program, or if a weight is not
/// finite. Allocates a few times their size.
LoadedPolicy ParsePolicy(std::span<const std::byte> bytes, std::string_view source);

/// Saves a policy as a file. Throws `base::Error` if it cannot be written.
void SavePolicy(const std::filesystem::path& path, const PolicySnapshot& snapshot,
                const nn::Metadata& metadata);

/// Loads a policy. Throws `base::Error` naming the file if it is missing, or as `ParsePolicy` does.
LoadedPolicy LoadPolicy(const std::filesystem::path& path);

/// Throws `base::Error` naming `source`, the policy's file, if a policy of `spec` cannot drive
/// on `observation` with `actions`.
void RequireSameInterface(const std::string& source, const PolicySpec& spec,
                          const env::ObservationSpec& observation,
                          const env::ActionBounds& actions);

}  // namespace slalom::policy
