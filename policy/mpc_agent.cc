#include "policy/mpc_agent.h"

#include <ATen/ATen.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "env/action.h"
#include "nn/feature_map.h"
#include "nn/layer_ops.h"
#include "nn/network.h"
#include "nn/transition_model.h"

namespace slalom::policy {
namespace {

/// Least standard deviation of a CEM's next round.
constexpr float kLeastStd = 0.01f;

const PolicySnapshot& Checked(const MpcConfig& config, const PolicySnapshot& snapshot) {
  if (config.update == "cem" &&
      std::lround(config.elite_fraction * static_cast<double>(config.samples)) < 2) {
    throw base::Error(
        fmt::format("mpc.elite_fraction is {} of mpc.samples = {}, expected at least 2 sequences "
                    "among the best",
                    config.elite_fraction, config.samples));
  }
  const std::string& kind = snapshot.spec.planning.model.kind;
  if (kind == "none" || !snapshot.model_weights || !snapshot.critic_weights) {
    throw base::Error(
        "mpc.enabled is true, but the policy carries no transition model and critic; expected one "
        "trained with model.kind = \"deterministic\" or \"probabilistic\"");
  }
  return snapshot;
}

}  // namespace

struct MpcAgent::Planner {
  Planner(const MpcConfig& mpc, const PolicySnapshot& snapshot)
      : config(mpc),
        spec(snapshot.spec),
        features(spec.observation, spec.network),
        actor_shape(spec.actor_shape()),
        critic_shape(spec.critic_shape()),
        model_shape(spec.model_shape()),
        width(actor_shape.num_inputs()),
        input(at::zeros({mpc.samples, width + env::kActionSize}, at::kFloat)),
        stack(input.narrow(1, 0, width)),
        noise(model_shape.probabilistic && mpc.model_noise
                  ? at::zeros({mpc.samples, model_shape.num_predicted}, at::kFloat)
                  : at::Tensor()),
        alone(at::zeros({1, width}, at::kFloat)),
        actor_pass(actor_shape, stack, nn::PassUse::kInference),
        alone_pass(actor_shape, alone, nn::PassUse::kInference),
        critic_pass(critic_shape, input, nn::PassUse::kInference),
        model_pass(model_shape, input, nn::PassUse::kInference),
        actions(static_cast<std::size_t>(mpc.horizon) * mpc.samples * env::kActionSize),
        mean(static_cast<std::size_t>(mpc.horizon) * env::kActionSize),
        std(mean.size()),
        returns(mpc.samples),
        alive(mpc.samples),
        weights(mpc.samples),
        order(mpc.samples) {
    SetWeights(snapshot);
  }

  void SetWeights(const PolicySnapshot& snapshot) {
    plans = snapshot.version >= config.learning_starts;
    actor.emplace(actor_shape, nn::ViewWeights(*snapshot.weights));
    critic.emplace(critic_shape, nn::ViewWeights(*snapshot.critic_weights));
    model.emplace(model_shape, nn::ViewWeights(*snapshot.model_weights));
  }

  /// The action to take after a stack of frames, [width].
  env::Action Plan(const float* from, base::Random& random) {
    if (!plans) return PolicyWithNoise(from, /*deviation=*/0.0, random);
    if (config.no_planning) return PolicyWithNoise(from, config.noise, random);
    for (int iteration = 0; iteration < config.iterations; ++iteration) {
      RollOut(from, /*by_policy=*/iteration == 0, random);
      Weigh();
      if (iteration + 1 < config.iterations || config.update != "sample") Average();
    }
    if (config.update != "sample") return {mean[0], mean[1]};
    const float* const drawn = Actions(0) + Draw(random) * env::kActionSize;
    return {drawn[0], drawn[1]};
  }

  env::Action PolicyWithNoise(const float* from, double deviation, base::Random& random) {
    std::copy_n(from, width, alone.data_ptr<float>());
    actor->Forward(alone_pass);
    nn::Tanh(alone_pass.output());
    const float* const output = alone_pass.output().data_ptr<float>();
    env::Action action{output[0], output[1]};
    action.linear += static_cast<float>(deviation * random.Normal());
    action.angular += static_cast<float>(deviation * random.Normal());
    return {std::clamp(action.linear, -1.0f, 1.0f), std::clamp(action.angular, -1.0f, 1.0f)};
  }

  void ActByPolicy() {
    actor->Forward(actor_pass);
    nn::Tanh(actor_pass.output());
  }
  const float* policy_actions() { return actor_pass.output().data_ptr<float>(); }
  /// The actions at step `t`, [S, 2].
  float* Actions(int t) {
    return actions.data() + static_cast<std::size_t>(t) * config.samples * env::kActionSize;
  }

  /// Fills `actions` and `returns`: R_s = sum_t gamma^t alive_t r_t + gamma^T alive_T Q(s_T,
  /// pi(s_T)) (mpc_agent.h; docs/original-system.md, section 5.2, with what M1 left out of it).
  void RollOut(const float* from, bool by_policy, base::Random& random) {
    const std::int64_t stride = input.stride(0);
    float* const rows = input.data_ptr<float>();
    for (int s = 0; s < config.samples; ++s) std::copy_n(from, width, rows + s * stride);
    std::fill(returns.begin(), returns.end(), 0.0f);
    std::fill(alive.begin(), alive.end(), 1.0f);
    float discount = 1.0f;
    for (int t = 0; t < config.horizon; ++t) {
      ChooseActions(t, by_policy, random);
      for (int s = 0; s < config.samples; ++s) {
        std::copy_n(Actions(t) + s * env::kActionSize, env::kActionSize, rows + s * stride + width);
      }
      for (std::int64_t i = 0; noise.defined() && i < noise.numel(); ++i) {
        noise.data_ptr<float>()[i] = static_cast<float>(random.Normal());
      }
      const auto member = random.UniformInt(static_cast<std::uint64_t>(model_shape.ensemble));
      model->Predict(model_pass, static_cast<int>(member), noise, stack);
      const float* const reward = model_pass.reward().data_ptr<float>();
      const float* const termination = model_pass.termination().data_ptr<float>();
      for (int s = 0; s < config.samples; ++s) {
        returns[s] += discount * alive[s] * reward[s];
        alive[s] *= 1.0f - termination[s];
      }
      discount *= static_cast<float>(spec.planning.gamma);
    }
    ActByPolicy();
    const std::int64_t outputs = actor_pass.output().size(1);
    for (int s = 0; s < config.samples; ++s) {
      std::copy_n(policy_actions() + s * outputs, env::kActionSize, rows + s * stride + width);
    }
    critic->Forward(critic_pass);
    const float* const value = critic_pass.output().data_ptr<float>();
    for (int s = 0; s < config.samples; ++s) returns[s] += discount * alive[s] * value[s];
  }

  /// Around the policy's actions in the states that were reached, or around the plan so far.
  void ChooseActions(int t, bool by_policy, base::Random& random) {
    if (by_policy) ActByPolicy();
    const std::int64_t outputs = actor_pass.output().size(1);
    const bool narrows = !by_policy && config.update == "cem";
    for (int s = 0; s < config.samples; ++s) {
      for (int j = 0; j < env::kActionSize; ++j) {
        const int place = t * env::kActionSize + j;
        const float centre = by_policy ? policy_actions()[s * outputs + j] : mean[place];
        const float spread = narrows ? std[place] : static_cast<float>(config.noise);
        const float offset = spread * static_cast<float>(random.Normal());
        Actions(t)[s * env::kActionSize + j] =
            std::clamp(centre + (s == 0 ? 0.0f : offset), -1.0f, 1.0f);
      }
    }
  }

  /// MPPI (Williams et al. 2017, equation 6): w_s in proportion to e^(R_s / temperature). CEM (Chua
  /// et al. 2018, §5): alike for the best, 0 for others. They sum to 1.
  void Weigh() {
    if (config.update == "cem") {
      const auto num_elites = static_cast<int>(
          std::lround(config.elite_fraction * static_cast<double>(config.samples)));
      std::iota(order.begin(), order.end(), 0);
      std::stable_sort(order.begin(), order.end(),
                       [&](int a, int b) { return returns[a] > returns[b]; });
      std::fill(weights.begin(), weights.end(), 0.0f);
      for (int i = 0; i < num_elites; ++i)
        weights[order[i]] = 1.0f / static_cast<float>(num_elites);
      return;
    }
    const double best = *std::max_element(returns.begin(), returns.end());
    double sum = 0.0;
    for (int s = 0; s < config.samples; ++s) {
      const double weight = std::exp((static_cast<double>(returns[s]) - best) / config.temperature);
      weights[s] = static_cast<float>(weight);
      sum += weight;
    }
    for (float& weight : weights) weight = static_cast<float>(static_cast<double>(weight) / sum);
  }

  /// The plan: mean and deviation of the actions, as weighed. MPPI's update is the mean, CEM refits
  /// both.
  void Average() {
    for (int t = 0; t < config.horizon; ++t) {
      for (int j = 0; j < env::kActionSize; ++j) {
        const float* const values = Actions(t) + j;
        double sum = 0.0, squares = 0.0;
        for (int s = 0; s < config.samples; ++s) {
          const double value = values[s * env::kActionSize];
          sum += static_cast<double>(weights[s]) * value;
          squares += static_cast<double>(weights[s]) * value * value;
        }
        mean[t * env::kActionSize + j] = static_cast<float>(sum);
        std[t * env::kActionSize + j] =
            std::max(kLeastStd, static_cast<float>(std::sqrt(std::max(0.0, squares - sum * sum))));
      }
    }
  }

  int Draw(base::Random& random) const {
    const double quantile = random.Uniform();
    double sum = 0.0;
    for (int s = 0; s < config.samples; ++s) {
      sum += static_cast<double>(weights[s]);
      if (quantile < sum) return s;
    }
    return config.samples - 1;
  }

  const MpcConfig config;
  const PolicySpec spec;
  bool plans = false;  // Whether the policy has been trained enough.
  const nn::FeatureMap features;
  const nn::NetworkShape actor_shape;
  const nn::NetworkShape critic_shape;
  const nn::ModelShape model_shape;
  const int width;   // H * F
  at::Tensor input;  // [S, H * F + 2]
  at::Tensor stack;  // [S, H * F], its first columns
  at::Tensor noise;  // [S, M], where the model's is wanted
  at::Tensor alone;  // [1, H * F], where nothing is planned
  nn::NetworkPass actor_pass;
  nn::NetworkPass alone_pass;
  nn::NetworkPass critic_pass;
  nn::ModelPass model_pass;
  std::optional<nn::Network> actor, critic;
  std::optional<nn::TransitionModel> model;
  std::vector<float> actions;                  // [T, S, 2]
  std::vector<float> mean, std;                // [T, 2]
  std::vector<float> returns, alive, weights;  // [S]
  std::vector<int> order;                      // [S]
  std::vector<float> seen;                     // [B, H * F], each environment's last frames
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

void MpcAgent::Act(const env::ObservationBatch& observations, std::span<env::Action> actions) {
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
    actions[i] = p.Plan(p.seen.data() + static_cast<std::ptrdiff_t>(i) * p.width, random);
    if (config_.unscaled_action) {
      actions[i] = snapshot_.spec.actions.Normalise(static_cast<double>(actions[i].linear),
                                                    static_cast<double>(actions[i].angular));
    }
  }
}

}  // namespace slalom::policy
