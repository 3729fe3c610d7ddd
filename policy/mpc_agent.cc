#include "policy/mpc_agent.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "env/action.h"
#include "policy/action_samples.h"
#include "policy/nn/feature_map.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/tensor_rows.h"
#include "policy/nn/network.h"
#include "policy/nn/transition_model.h"

namespace slalom::policy {
namespace {

/// How many sequences CEM takes for the best.
int NumBest(const MpcConfig& config) {
  return static_cast<int>(std::lround(config.elite_fraction * static_cast<double>(config.samples)));
}

const PolicySnapshot& Checked(const MpcConfig& config, const PolicySnapshot& snapshot) {
  base::ThrowIf(
      config.update == PlanUpdate::kCem && NumBest(config) < 2,
      "mpc.elite_fraction is {} of mpc.samples = {}, expected at least 2 sequences among the "
      "best",
      config.elite_fraction, config.samples);
  base::ThrowIf(
      !snapshot.spec.planning.is_carried() || !snapshot.model_weights || !snapshot.critic_weights,
      "mpc.enabled is true, but the policy carries no transition model and critic; expected one "
      "trained with model.kind = \"deterministic\" or \"probabilistic\"");
  return snapshot;
}

}  // namespace

/// The networks of a policy on S states at once, and the plan that they make.
struct MpcAgent::Planner {
  Planner(const MpcConfig& mpc, const PolicySnapshot& snapshot)
      : config(mpc),
        spec(snapshot.spec),
        features(spec.observation, spec.network),
        actor_shape(spec.actor_shape()),
        critic_shape(spec.critic_shape()),
        model_shape(spec.model_shape()),
        width(actor_shape.num_inputs()),
        state_action(at::zeros({mpc.samples, width + env::kActionSize}, at::kFloat)),
        state(state_action.narrow(1, 0, width)),
        model_noise(model_shape.probabilistic && mpc.model_noise
                        ? at::zeros({mpc.samples, model_shape.num_predicted}, at::kFloat)
                        : at::Tensor()),
        single_state(at::zeros({1, width}, at::kFloat)),
        actor_pass(actor_shape, state, nn::PassUse::kInference),
        single_pass(actor_shape, single_state, nn::PassUse::kInference),
        critic_pass(critic_shape, state_action, nn::PassUse::kInference),
        model_pass(model_shape, state_action, nn::PassUse::kInference),
        samples(mpc.horizon, mpc.samples),
        plan(mpc.horizon),
        policy_actions(mpc.samples),
        alive(mpc.samples) {
    SetWeights(snapshot);
  }

  void SetWeights(const PolicySnapshot& snapshot) {
    plans = snapshot.version >= config.learning_starts;
    actor.emplace(actor_shape, nn::ViewWeights(*snapshot.weights));
    critic.emplace(critic_shape, nn::ViewWeights(*snapshot.critic_weights));
    model.emplace(model_shape, nn::ViewWeights(*snapshot.model_weights));
  }

  /// The action to take after a stack of frames, [width].
  env::Action Plan(std::span<const float> frames, base::Random& random) {
    if (!plans) return ActWithNoise(frames, /*deviation=*/0.0, random);
    if (config.no_planning) return ActWithNoise(frames, config.noise, random);
    for (int iteration = 0; iteration < config.iterations; ++iteration) {
      RollOut(frames, /*by_policy=*/iteration == 0, random);
      Weigh();
      if (!draws() || iteration + 1 < config.iterations) FitPlan(samples, plan);
    }
    return draws() ? samples.At(0)[DrawSequence(samples, random)] : plan.mean[0];
  }

  env::Action ActWithNoise(std::span<const float> frames, double deviation, base::Random& random) {
    std::ranges::copy(frames, single_state.data_ptr<float>());
    env::Action action;
    ActByPolicy(single_pass, {&action, 1});
    action.linear += static_cast<float>(deviation * random.Normal());
    action.angular += static_cast<float>(deviation * random.Normal());
    return {std::clamp(action.linear, -1.0f, 1.0f), std::clamp(action.angular, -1.0f, 1.0f)};
  }

  /// Fills in the samples' actions and returns: R_s = sum_t gamma^t alive_t r_t + gamma^T alive_T
  /// Q(s_T, pi(s_T)) (mpc_agent.h; docs/original-system.md, section 5.2, with what M1 left out).
  void RollOut(std::span<const float> frames, bool by_policy, base::Random& random) {
    const nn::TensorRows states(state);
    for (int s = 0; s < config.samples; ++s) std::ranges::copy(frames, states[s]);
    std::ranges::fill(samples.returns, 0.0f);
    std::ranges::fill(alive, 1.0f);
    float discount = 1.0f;
    for (int t = 0; t < config.horizon; ++t) {
      SampleActions(t, by_policy, random);
      SetActions(samples.At(t));
      Predict(random);
      AddReturns(discount, model_pass.reward());
      const float* const termination = model_pass.termination().data_ptr<float>();
      for (int s = 0; s < config.samples; ++s) alive[s] *= 1.0f - termination[s];
      discount *= static_cast<float>(spec.planning.gamma);
    }
    ActByPolicy(actor_pass, policy_actions);
    SetActions(policy_actions);
    critic->Forward(critic_pass);
    AddReturns(discount, critic_pass.output());
  }

  /// Draws actions around the policy's in the states that were reached, or around the plan so far.
  /// The first sequence has no noise.
  void SampleActions(int t, bool by_policy, base::Random& random) {
    if (by_policy) ActByPolicy(actor_pass, policy_actions);
    const bool narrows = !by_policy && refits();
    const env::Action deviation = narrows ? plan.deviation[t] : env::Action{noise(), noise()};
    const std::span<env::Action> actions = samples.At(t);
    for (int s = 0; s < config.samples; ++s) {
      actions[s] = DrawAround(by_policy ? policy_actions[s] : plan.mean[t],
                              s == 0 ? env::Action{} : deviation, random);
    }
  }

  /// R_s += discount alive_s value_s. values: one number for each sequence.
  void AddReturns(float discount, const at::Tensor& values) {
    const float* const value = values.data_ptr<float>();
    for (int s = 0; s < config.samples; ++s) samples.returns[s] += discount * alive[s] * value[s];
  }

  /// One step of the model, by one member of the ensemble, from `state_action` to `state`.
  void Predict(base::Random& random) {
    if (model_noise.defined()) {
      const std::span numbers(model_noise.data_ptr<float>(), model_noise.numel());
      for (float& number : numbers) number = static_cast<float>(random.Normal());
    }
    const auto member = random.UniformInt(static_cast<std::uint64_t>(model_shape.ensemble));
    model->Predict(model_pass, static_cast<int>(member), model_noise, state);
  }

  /// The policy's actions, or the means of their distributions, in the pass's states.
  void ActByPolicy(nn::NetworkPass& pass, std::span<env::Action> actions) {
    actor->Forward(pass);
    nn::Tanh(pass.output());
    const nn::TensorRows outputs(pass.output());
    for (std::size_t s = 0; s < actions.size(); ++s) {
      const float* const output = outputs[static_cast<std::int64_t>(s)];
      actions[s] = {output[0], output[1]};
    }
  }

  /// Puts actions beside the states.
  void SetActions(std::span<const env::Action> actions) {
    const nn::TensorRows rows(state_action);
    for (std::size_t s = 0; s < actions.size(); ++s) {
      float* const action = rows[static_cast<std::int64_t>(s)] + width;
      action[0] = actions[s].linear;
      action[1] = actions[s].angular;
    }
  }

  void Weigh() {
    if (refits()) {
      WeighTheBest(NumBest(config), samples);
    } else {
      WeighByReturn(config.temperature, samples);
    }
  }

  /// CEM: the plan's deviation follows from the best, too.
  bool refits() const { return config.update == PlanUpdate::kCem; }
  /// The plan's first action is one sequence's, not the mean.
  bool draws() const { return config.update == PlanUpdate::kSample; }
  float noise() const { return static_cast<float>(config.noise); }

  const MpcConfig config;
  const PolicySpec spec;
  bool plans = false;  // Whether the policy has been trained enough.
  const nn::FeatureMap features;
  const nn::NetworkShape actor_shape;
  const nn::NetworkShape critic_shape;
  const nn::ModelShape model_shape;
  const int width;          // H * F
  at::Tensor state_action;  // [S, H * F + 2]
  at::Tensor state;         // [S, H * F], its first columns
  at::Tensor model_noise;   // [S, M], undefined if the model has no noise
  at::Tensor single_state;  // [1, H * F], for actions without a plan
  nn::NetworkPass actor_pass;
  nn::NetworkPass single_pass;
  nn::NetworkPass critic_pass;
  nn::ModelPass model_pass;
  std::optional<nn::Network> actor, critic;
  std::optional<nn::TransitionModel> model;
  ActionSamples samples;
  ActionPlan plan;
  std::vector<env::Action> policy_actions;  // [S]
  std::vector<float> alive;                 // [S]
  std::vector<float> seen;                  // [B, H * F], each environment's last frames
};

MpcAgent::MpcAgent(const MpcConfig& config, PolicySnapshot snapshot, std::uint64_t seed)
    : config_(config),
      seed_(base::DeriveSeed(seed, "planning")),
      snapshot_(std::move(snapshot)),
      planner_(std::make_unique<Planner>(config, Checked(config, snapshot_))) {}

MpcAgent::~MpcAgent() = default;

void MpcAgent::SetSnapshot(PolicySnapshot snapshot) {
  SLALOM_CHECK(snapshot.spec.network == snapshot_.spec.network);
  SLALOM_CHECK(snapshot.spec.observation == snapshot_.spec.observation);
  SLALOM_CHECK(snapshot.spec.planning == snapshot_.spec.planning);
  planner_->SetWeights(snapshot);
  snapshot_ = std::move(snapshot);
}

void MpcAgent::Act(const env::ObservationBatch& observations, std::span<float> numbers) {
  const std::span<env::Action> actions = env::AsActions(numbers);
  Planner& p = *planner_;
  const int batch = observations.batch_size;
  SLALOM_CHECK_EQ(actions.size(), static_cast<std::size_t>(batch));
  SLALOM_CHECK_EQ(observations.num_beams, p.features.num_beams());
  p.seen.resize(static_cast<std::size_t>(batch) * p.width);
  p.features.PushFrames(observations, p.spec.network.history, p.seen.data());
  for (int i = 0; i < batch; ++i) {
    const env::FrameView view = observations.frame(i);
    const std::uint64_t checksum =
        base::Checksum(std::as_bytes(view.state), base::Checksum(std::as_bytes(view.ranges_cm)));
    base::Random random(base::DeriveSeed(seed_, "plan", {checksum}));
    actions[i] =
        p.Plan(std::span(p.seen).subspan(static_cast<std::size_t>(i) * p.width, p.width), random);
    if (config_.unscaled_action) {
      actions[i] = snapshot_.spec.actions.Normalise(static_cast<double>(actions[i].linear),
                                                    static_cast<double>(actions[i].angular));
    }
  }
}

}  // namespace slalom::policy
