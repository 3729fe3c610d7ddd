#include <fmt/format.h>
#include <gtest/gtest.h>
#include <torch/torch.h>

#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "learner/adam.h"
#include "learner/algorithm.h"
#include "learner/learner.h"
#include "policy/nn/feature_map.h"
#include "tests/learner/random_rows.h"
#include "tests/learner/reference_network.h"

/// The learner beside the same algorithm written with LibTorch's autograd and optimisers, in
/// float64.

namespace slalom::learner {
namespace {

using at::Tensor;

/// `type` chooses the fused kernel (float32) or the operations for other devices (float64).
void CompareAdam(at::ScalarType type, double tolerance) {
  torch::manual_seed(1);
  const Tensor start = torch::randn({2500}, torch::kDouble);
  Tensor expected = start.clone().requires_grad_();
  torch::optim::Adam optimiser({expected}, torch::optim::AdamOptions(0.01));
  // Each thread takes some of the parameters, and the gradient is a sum of three.
  base::ParallelFor parallel(2);
  const Tensor number = torch::arange(2500);
  Tensor parameters = start.to(type, /*non_blocking=*/false, /*copy=*/true);
  Tensor gradients = torch::zeros({3, 2500}, parameters.options());
  Tensor average = parameters.clone();
  Tensor expected_average = start.clone();
  Tensor norm = torch::zeros({1}, torch::kDouble);
  double expected_norm = 0.0;
  Adam adam(parameters, gradients, &parallel);
  for (int step = 0; step < 20; ++step) {
    const Tensor g = torch::randn({2500}, torch::kDouble) * (step % 3);
    for (int s = 0; s < 3; ++s) gradients[s].copy_(g * (number % 3 == s));
    expected.mutable_grad() = g;
    optimiser.step();
    expected_norm += g.norm().item<double>();
    expected_average.lerp_(expected.detach(), 0.1);
    const PolyakAverage averages[] = {{average, 0.1}};
    adam.Step(0.01, averages, norm, /*num_gradients=*/3);
  }
  EXPECT_LE((parameters - expected).abs().max().item<double>(), tolerance);
  EXPECT_LE((average - expected_average).abs().max().item<double>(), tolerance);
  EXPECT_NEAR(norm.item<double>(), expected_norm, tolerance * expected_norm);
}

// Each of 20 steps rounds numbers below 4 some four times: 20 * 4 * 4 roundings of 2^-24 and 2^-53.
TEST(Adam, KernelIsLibTorchsAdam) { CompareAdam(torch::kFloat, 2e-5); }
TEST(Adam, OperationsAreLibTorchsAdam) { CompareAdam(torch::kDouble, 1e-13); }

Tensor Read(const Learner& learner, const std::string& name) {
  nn::TensorMap tensors;
  learner.SaveState(tensors);
  const nn::StoredTensor& stored = tensors.at(name);
  std::vector<float> values(stored.bytes.size() / sizeof(float));
  std::memcpy(values.data(), stored.bytes.data(), stored.bytes.size());
  return torch::tensor(values).to(torch::kDouble);
}

Tensor Normal(base::Random& random, int batch) {
  Tensor noise = torch::zeros({batch, 2}, torch::kDouble);
  for (int i = 0; i < batch; ++i) {
    for (int j = 0; j < 2; ++j) noise[i][j] = random.Normal();
  }
  return noise;
}

/// Some critics with their targets.
struct ReferenceCritics {
  ReferenceCritics(Tensor initial, nn::NetworkShape of_shape, double learning_rate)
      : shape(std::move(of_shape)),
        parameters(initial.clone().requires_grad_()),
        target(initial.clone()),
        optimiser({parameters}, torch::optim::AdamOptions(learning_rate)) {}

  Tensor Q(const Tensor& all, int k, const Tensor& s, const Tensor& a) const {
    const std::int64_t size = shape.num_parameters();
    return ReferenceForward(shape, all.narrow(0, k * size, size), s, a).squeeze(1);
  }
  int size() const { return static_cast<int>(parameters.numel() / shape.num_parameters()); }
  std::vector<Tensor> Targets(const Tensor& s, const Tensor& a) const {
    std::vector<Tensor> values;
    for (int k = 0; k < size(); ++k) values.push_back(Q(target, k, s, a));
    return values;
  }
  void GradientStep(const Tensor& s, const Tensor& a, const Tensor& y) {
    optimiser.zero_grad();
    Tensor loss = torch::zeros({}, torch::kDouble);
    for (int k = 0; k < size(); ++k) loss = loss + torch::mse_loss(Q(parameters, k, s, a), y);
    loss.backward();
    optimiser.step();
  }
  void UpdateTargets(double tau) {
    torch::NoGradGuard no_grad;
    target = (1.0 - tau) * target + tau * parameters;
  }

  nn::NetworkShape shape;
  Tensor parameters, target;
  torch::optim::Adam optimiser;
};

/// TD3, DDPG and SAC with a fixed multiplier, as plainly as can be.
struct Reference {
  Reference(const MethodConfig& method, const policy::PolicySpec& spec, const Learner& learner,
            std::uint64_t seed)
      : config(method.learner),
        multiplier(method.constraint.multiplier),
        features(spec.observation, spec.network),
        distribution(spec.distribution),
        actor_shape(nn::ActorShape(spec.network, features.frame_size(),
                                   spec.distribution.num_outputs(env::kActionSize))),
        actor(Read(learner, "actor.parameters").requires_grad_()),
        actor_target(actor.detach().clone()),
        critics(Read(learner, "critics.parameters"),
                nn::CriticShape(spec.network, features.frame_size()), config.critic_learning_rate),
        cost_critics(
            Read(learner, multiplier > 0.0 ? "cost_critics.parameters" : "critics.parameters"),
            critics.shape, config.critic_learning_rate),
        log_temperature(
            torch::full({1}, std::log(config.temperature), torch::kDouble).requires_grad_()),
        actor_optimiser({actor}, torch::optim::AdamOptions(config.actor_learning_rate)),
        temperature_optimiser({log_temperature},
                              torch::optim::AdamOptions(config.temperature_learning_rate)),
        target_noise(base::DeriveSeed(seed, "target noise")),
        policy_noise(base::DeriveSeed(seed, "policy noise")),
        next_policy_noise(base::DeriveSeed(seed, "next policy noise")) {}

  Tensor ReadStates(const std::vector<const std::uint16_t*>& scans, const float* state) const {
    const int history = actor_shape.config.history;
    Tensor result = torch::zeros({config.batch_size, history * features.frame_size()});
    for (int i = 0; i < config.batch_size * history; ++i) {
      features.Write(scans[i], state + i * env::kStateSize, false,
                     result.data_ptr<float>() + i * features.frame_size());
    }
    return result.to(torch::kDouble);
  }

  /// a and log pi(a|s) by LibTorch's own density of a normal, and the slope of tanh as it stands.
  std::pair<Tensor, Tensor> Sample(const Tensor& state, const Tensor& noise) const {
    const Tensor output = ReferenceForward(actor_shape, actor, state, {});
    const Tensor mean = output.narrow(1, 0, 2);
    const double low = distribution.log_std_min, high = distribution.log_std_max;
    const Tensor deviation =
        torch::exp(low + (high - low) * (torch::tanh(output.narrow(1, 2, 2)) + 1.0) / 2.0);
    const Tensor u = mean + deviation * noise, action = torch::tanh(u);
    const Tensor density = torch::exp(-0.5 * torch::pow((u - mean) / deviation, 2)) /
                           (deviation * std::sqrt(2.0 * M_PI));
    return {action, (torch::log(density) - torch::log(1.0 - action * action)).sum(1)};
  }

  /// What the actor descends, beside an entropy: -Q + lambda Q_C.
  Tensor ActorLoss(const Tensor& q, const Tensor& action) const {
    Tensor loss = -q.mean();
    if (multiplier > 0.0) {
      loss =
          loss + multiplier * cost_critics.Q(cost_critics.parameters.detach(), 0, s, action).mean();
    }
    return loss;
  }

  void UpdateActor(const Tensor& loss) {
    actor_optimiser.zero_grad();
    loss.backward();
    actor_optimiser.step();
  }

  void UpdateCritics(const Tensor& next_a, const Tensor& soft_cost) {
    Tensor y, cost_y;
    {
      torch::NoGradGuard no_grad;
      const std::vector<Tensor> q = critics.Targets(next_s, next_a);
      y = r + discount * ((q.size() == 1 ? q[0] : torch::minimum(q[0], q[1])) - soft_cost);
      const std::vector<Tensor> c = cost_critics.Targets(next_s, next_a);
      if (c.size() > 1) cost_y = cost + discount * torch::maximum(c[0], c[1]);
    }
    critics.GradientStep(s, a, y);
    if (multiplier > 0.0) cost_critics.GradientStep(s, a, cost_y);
  }

  void UpdateTargets() {
    critics.UpdateTargets(config.tau);
    cost_critics.UpdateTargets(config.tau);
    torch::NoGradGuard no_grad;
    actor_target = (1.0 - config.tau) * actor_target + config.tau * actor;
  }

  void Update(const replay::SampledRows& rows) {
    s = ReadStates(rows.ranges_cm, rows.state.data());
    next_s = ReadStates(rows.next_ranges_cm, rows.next_state.data());
    a = torch::zeros({config.batch_size, 2}, torch::kDouble);
    r = torch::zeros({config.batch_size}, torch::kDouble);
    discount = torch::zeros_like(r);
    cost = torch::zeros_like(r);
    for (int i = 0; i < config.batch_size; ++i) {
      a[i][0] = rows.action[2 * i];
      a[i][1] = rows.action[2 * i + 1];
      r[i] = config.reward_scale * rows.n_step_return[i];
      cost[i] = rows.cost_return[i];
      discount[i] = rows.discount[i];
    }
    ++num_updates;
    if (config.algorithm == "sac") {
      UpdateSac();
    } else {
      UpdateDeterministic(config.algorithm == "td3");
    }
  }

  void UpdateDeterministic(bool is_td3) {
    const Tensor zero = torch::zeros({1}, torch::kDouble);
    Tensor next_a = torch::tanh(ReferenceForward(actor_shape, actor_target, next_s, {})).detach();
    if (is_td3) {
      const Tensor noise = (config.target_noise * Normal(target_noise, config.batch_size))
                               .clamp(-config.noise_clip, config.noise_clip);
      next_a = (next_a + noise).clamp(-1.0, 1.0);
    }
    UpdateCritics(next_a, zero);
    if (is_td3 && num_updates % config.policy_delay != 0) return;
    const Tensor u = ReferenceForward(actor_shape, actor, s, {});
    const Tensor act = torch::tanh(u);
    UpdateActor(ActorLoss(critics.Q(critics.parameters.detach(), 0, s, act), act) +
                config.preactivation_penalty * u.square().sum(1).mean());
    UpdateTargets();
  }

  void UpdateSac() {
    const Tensor alpha = torch::exp(log_temperature).detach();
    const auto [next_a, next_log_pi] = Sample(next_s, Normal(next_policy_noise, config.batch_size));
    UpdateCritics(next_a.detach(), alpha * next_log_pi.detach());
    UpdateTargets();
    const auto [act, log_pi] = Sample(s, Normal(policy_noise, config.batch_size));
    const Tensor frozen = critics.parameters.detach();
    const Tensor q = torch::minimum(critics.Q(frozen, 0, s, act), critics.Q(frozen, 1, s, act));
    UpdateActor(ActorLoss(q, act) + (alpha * log_pi).mean());
    temperature_optimiser.zero_grad();
    (-log_temperature * (log_pi.detach() + config.target_entropy).mean()).backward();
    temperature_optimiser.step();
  }

  LearnerConfig config;
  double multiplier;
  nn::FeatureMap features;
  policy::ActionDistribution distribution;
  nn::NetworkShape actor_shape;
  Tensor actor, actor_target;
  ReferenceCritics critics, cost_critics;
  Tensor log_temperature;
  torch::optim::Adam actor_optimiser, temperature_optimiser;
  base::Random target_noise, policy_noise, next_policy_noise;
  Tensor s, next_s, a, r, cost, discount;  // Of the update.
  int num_updates = 0;
};

struct Case {
  std::string name;
  const char* algorithm;
  std::vector<int> encoder_layers;
  std::vector<int> head;
  bool layer_norm = false;
  double multiplier = 0.0;
  double preactivation_penalty = 0.0;
  nn::EncoderFamily encoder = nn::EncoderFamily::kMlp;
  nn::CnnAxis cnn_axis = nn::CnnAxis::kTime;
  int history = 1;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class LearnerReferenceTest : public testing::TestWithParam<Case> {
 protected:
  static void CompareUpdates(int threads);
};

void LearnerReferenceTest::CompareUpdates(int threads) {
  MethodConfig method;
  LearnerConfig& config = method.learner;
  config.algorithm = GetParam().algorithm;
  config.device = DeviceChoice::kCpu;
  config.threads = threads;
  config.batch_size = 16;
  // Small steps keep the difference between float32 and float64 small: Adam divides by the size of
  // a gradient, so where one is near zero the two may step apart by the whole rate.
  config.actor_learning_rate = 1e-4;
  config.critic_learning_rate = 1e-4;
  config.temperature_learning_rate = 1e-2;
  config.tau = 0.1;
  config.reward_scale = 0.5;
  config.preactivation_penalty = GetParam().preactivation_penalty;
  if (GetParam().multiplier > 0.0) {
    method.constraint = {.kind = ConstraintKind::kFixed, .multiplier = GetParam().multiplier};
  }
  policy::PolicySpec spec;
  spec.observation.num_beams = 24;
  spec.network.encoder = GetParam().encoder;
  spec.network.cnn_axis = GetParam().cnn_axis;
  spec.network.encoder_layers = GetParam().encoder_layers;
  spec.network.attention_heads = 2;
  spec.network.history = GetParam().history;
  spec.network.head_layers = GetParam().head;
  spec.network.layer_norm = GetParam().layer_norm;
  spec.network.sectors = 12;
  spec.distribution = DistributionOf(config);
  constexpr std::uint64_t kSeed = 3;
  Learner learner(method, spec, kSeed);
  Reference reference(method, spec, learner, kSeed);
  constexpr int kUpdates = 6;
  for (int i = 0; i < kUpdates; ++i) {
    const RandomRows rows(config.batch_size, spec.network.history, 24, 50 + i);
    learner.Update(rows.batches(), 0.0);
    reference.Update(rows.rows);
  }
  const auto compare = [&](const std::string& name, const Tensor& expected) {
    const Tensor difference = (Read(learner, name) - expected.detach()).abs();
    // Six roundings of parameters below 1/2 to float32: 6 * 2^-26 = 9e-8 at most, a sixth of it
    // found. The largest says nothing: a parameter of near-zero gradient may be off by all steps.
    EXPECT_LE(difference.mean().item<double>(), 5e-8) << name;
  };
  compare("actor.parameters", reference.actor);
  compare("critics.parameters", reference.critics.parameters);
  compare("critics.target_parameters", reference.critics.target);
  if (config.algorithm != "sac") compare("actor.target_parameters", reference.actor_target);
  if (config.algorithm == "sac") {
    EXPECT_NEAR(learner.ReadStats().temperature, std::exp(reference.log_temperature.item<double>()),
                1e-5);
  }
  if (method.constraint.kind != ConstraintKind::kNone) {
    compare("cost_critics.parameters", reference.cost_critics.parameters);
    compare("cost_critics.target_parameters", reference.cost_critics.target);
  }
}

TEST_P(LearnerReferenceTest, UpdatesAreThoseOfThePaper) { CompareUpdates(1); }
TEST_P(LearnerReferenceTest, UpdatesBySlicesAreThoseOfThePaper) { CompareUpdates(2); }

INSTANTIATE_TEST_SUITE_P(Methods, LearnerReferenceTest,
                         testing::Values(Case{"Td3Paper", "td3", {32, 16}, {16, 16}},
                                         Case{"Td3Fast", "td3", {}, {32, 32}},
                                         Case{"Td3LayerNorm", "td3", {16}, {16}, true},
                                         Case{"Td3Constrained", "td3", {16}, {16}, false, 2.0},
                                         Case{"Td3Penalised", "td3", {16}, {16}, false, 0.0, 0.5},
                                         Case{"Ddpg", "ddpg", {16}, {16}},
                                         Case{"DdpgConstrained", "ddpg", {16}, {16}, false, 2.0},
                                         Case{"Sac", "sac", {16}, {16}},
                                         Case{"SacConstrained", "sac", {}, {16, 16}, true, 2.0}),
                         [](const auto& test) { return test.param.name; });

/// Every algorithm on every encoder, with a cost where it is TD3.
std::vector<Case> EncoderCases() {
  using enum nn::EncoderFamily;
  using enum nn::CnnAxis;
  std::vector<Case> cases;
  for (const char* algorithm : {"td3", "ddpg", "sac"}) {
    const double multiplier = std::string(algorithm) == "td3" ? 2.0 : 0.0;
    const auto add = [&](const char* name, std::vector<int> layers, nn::EncoderFamily encoder,
                         nn::CnnAxis axis, int history) {
      cases.push_back({fmt::format("{}_{}", algorithm, name),
                       algorithm,
                       std::move(layers),
                       {16},
                       /*layer_norm=*/false,
                       multiplier,
                       /*preactivation_penalty=*/0.0,
                       encoder,
                       axis,
                       history});
    };
    add("cnn", {16, 12}, kCnn, kTime, 4);
    add("cnn_one_frame", {16, 12}, kCnn, kTime, 1);
    add("beams", {6, 12}, kCnn, kBeams, 4);
    add("gru", {12, 12}, kGru, kTime, 4);
    add("transformer", {16, 16}, kTransformer, kTime, 4);
    add("mlp", {16}, kMlp, kTime, 4);
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Encoders, LearnerReferenceTest, testing::ValuesIn(EncoderCases()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace slalom::learner
