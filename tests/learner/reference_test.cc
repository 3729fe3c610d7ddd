#include <gtest/gtest.h>
#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "learner/adam.h"
#include "learner/td3.h"
#include "policy/feature_map.h"
#include "tests/learner/random_rows.h"

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
  Tensor parameters = start.to(type, /*non_blocking=*/false, /*copy=*/true);
  Tensor gradient = torch::zeros_like(parameters);
  Tensor follower = parameters.clone();
  Tensor expected_follower = start.clone();
  Tensor norm = torch::zeros({1}, torch::kDouble);
  double expected_norm = 0.0;
  Adam adam(parameters, gradient);
  for (int step = 0; step < 20; ++step) {
    const Tensor g = torch::randn({2500}, torch::kDouble) * (step % 3);
    gradient.copy_(g);
    expected.mutable_grad() = g;
    optimiser.step();
    expected_norm += g.norm().item<double>();
    expected_follower.lerp_(expected.detach(), 0.1);
    const Follower followers[] = {{follower, 0.1}};
    adam.Step(0.01, followers, norm);
  }
  EXPECT_LE((parameters - expected).abs().max().item<double>(), tolerance);
  EXPECT_LE((follower - expected_follower).abs().max().item<double>(), tolerance);
  EXPECT_NEAR(norm.item<double>(), expected_norm, tolerance * expected_norm);
}

// Each of 20 steps rounds numbers below 4 some four times: 20 * 4 * 4 roundings of 2^-24 and 2^-53.
TEST(Adam, KernelIsLibTorchsAdam) { CompareAdam(torch::kFloat, 2e-5); }
TEST(Adam, OperationsAreLibTorchsAdam) { CompareAdam(torch::kDouble, 1e-13); }

/// A network of LibTorch operations on one flat parameter tensor.
Tensor Forward(const policy::MlpShape& shape, const Tensor& parameters, Tensor x,
               const Tensor& action) {
  std::vector<Tensor> parts;
  for (const policy::ParameterSlot& slot : shape.Slots()) {
    parts.push_back(parameters.narrow(0, slot.offset, slot.size()).view(slot.shape));
  }
  std::size_t next = 0;
  for (int i = 0; i < shape.num_layers(); ++i) {
    if (shape.num_extra > 0 && i == shape.extra_layer) x = torch::cat({x, action}, 1);
    x = torch::linear(x, parts[next], parts[next + 1]);
    next += 2;
    if (i + 1 == shape.num_layers()) break;
    if (shape.layer_norm) {
      x = torch::layer_norm(x, {x.size(1)}, parts[next], parts[next + 1]);
      next += 2;
    }
    x = torch::relu(x);
  }
  return x;
}

Tensor Read(const Td3& td3, const std::string& name) {
  policy::TensorMap tensors;
  td3.SaveState(tensors);
  const policy::StoredTensor& stored = tensors.at(name);
  std::vector<float> values(stored.bytes.size() / sizeof(float));
  std::memcpy(values.data(), stored.bytes.data(), stored.bytes.size());
  return torch::tensor(values).to(torch::kDouble);
}

/// Algorithm 1 of the TD3 paper, as plainly as can be.
struct ReferenceTd3 {
  ReferenceTd3(const Td3Config& c, const policy::PolicySpec& s, const Td3& td3, std::uint64_t seed)
      : config(c),
        features(s.observation, s.network),
        actor_shape(policy::ActorShape(s.network, features.frame_size())),
        critic_shape(policy::CriticShape(s.network, features.frame_size())),
        actor(Read(td3, "actor.parameters").requires_grad_()),
        actor_target(actor.detach().clone()),
        critics(Read(td3, "critics.parameters").requires_grad_()),
        critics_target(critics.detach().clone()),
        actor_optimiser({actor}, torch::optim::AdamOptions(c.actor_learning_rate)),
        critics_optimiser({critics}, torch::optim::AdamOptions(c.critic_learning_rate)),
        noise_random(base::DeriveSeed(seed, "target noise")) {}

  Tensor Q(const Tensor& both, int k, const Tensor& s, const Tensor& a) const {
    const std::int64_t size = critic_shape.num_parameters();
    return Forward(critic_shape, both.narrow(0, k * size, size), s, a).squeeze(1);
  }

  Tensor ReadStates(const std::vector<const std::uint16_t*>& scans, const float* state) const {
    Tensor result = torch::zeros({config.batch_size, features.frame_size()});
    for (int i = 0; i < config.batch_size; ++i) {
      features.Write(scans[i], state + i * env::kStateSize, false,
                     result.data_ptr<float>() + i * features.frame_size());
    }
    return result.to(torch::kDouble);
  }

  void Update(const replay::SampledRows& rows) {
    const Tensor s = ReadStates(rows.ranges_cm, rows.state.data());
    const Tensor next_s = ReadStates(rows.next_ranges_cm, rows.next_state.data());
    Tensor a = torch::zeros({config.batch_size, 2}, torch::kDouble), noise = torch::zeros_like(a);
    Tensor r = torch::zeros({config.batch_size}, torch::kDouble), discount = torch::zeros_like(r);
    for (int i = 0; i < config.batch_size; ++i) {
      a[i][0] = rows.action[i].linear;
      a[i][1] = rows.action[i].angular;
      for (int j = 0; j < 2; ++j) {
        noise[i][j] = std::clamp(config.target_noise * noise_random.Normal(), -config.noise_clip,
                                 config.noise_clip);
      }
      r[i] = config.reward_scale * rows.n_step_return[i];
      discount[i] = rows.discount[i];
    }
    Tensor y;
    {
      torch::NoGradGuard no_grad;
      const Tensor next_a =
          (torch::tanh(Forward(actor_shape, actor_target, next_s, {})) + noise).clamp(-1.0, 1.0);
      y = r + discount * torch::minimum(Q(critics_target, 0, next_s, next_a),
                                        Q(critics_target, 1, next_s, next_a));
    }
    critics_optimiser.zero_grad();
    (torch::mse_loss(Q(critics, 0, s, a), y) + torch::mse_loss(Q(critics, 1, s, a), y)).backward();
    critics_optimiser.step();
    if (++num_updates % config.policy_delay != 0) return;
    actor_optimiser.zero_grad();
    (-Q(critics.detach(), 0, s, torch::tanh(Forward(actor_shape, actor, s, {}))).mean()).backward();
    actor_optimiser.step();
    torch::NoGradGuard no_grad;
    critics_target = (1.0 - config.tau) * critics_target + config.tau * critics;
    actor_target = (1.0 - config.tau) * actor_target + config.tau * actor;
  }

  Td3Config config;
  policy::FeatureMap features;
  policy::MlpShape actor_shape, critic_shape;
  Tensor actor, actor_target, critics, critics_target;
  torch::optim::Adam actor_optimiser, critics_optimiser;
  base::Random noise_random;
  int num_updates = 0;
};

struct Case {
  const char* name;
  std::vector<int> encoder;
  std::vector<int> head;
  bool layer_norm;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class Td3ReferenceTest : public testing::TestWithParam<Case> {};

TEST_P(Td3ReferenceTest, UpdatesAreThoseOfThePaper) {
  policy::PolicySpec spec;
  spec.observation.num_beams = 24;
  spec.network.encoder_layers = GetParam().encoder;
  spec.network.head_layers = GetParam().head;
  spec.network.layer_norm = GetParam().layer_norm;
  spec.network.sectors = 12;
  Td3Config config;
  config.device = "cpu";
  config.batch_size = 16;
  // Small steps keep the difference between float32 and float64 small: Adam divides by the size of
  // a gradient, so where one is near zero the two may step apart by the whole rate.
  config.actor_learning_rate = 1e-4;
  config.critic_learning_rate = 1e-4;
  config.tau = 0.1;
  config.reward_scale = 0.5;
  constexpr std::uint64_t kSeed = 3;
  Td3 td3(config, spec, kSeed);
  ReferenceTd3 reference(config, spec, td3, kSeed);
  constexpr int kUpdates = 6;
  for (int i = 0; i < kUpdates; ++i) {
    const RandomRows rows(config.batch_size, 1, 24, 50 + i);
    td3.Update(rows.rows, 0.0);
    reference.Update(rows.rows);
  }
  const auto compare = [&](const std::string& name, const Tensor& expected) {
    const Tensor difference = (Read(td3, name) - expected.detach()).abs();
    // On average a hundredth of one step; a parameter of near-zero gradient may be off by all
    // steps.
    EXPECT_LE(difference.mean().item<double>(), 1e-6) << name;
    EXPECT_LE(difference.max().item<double>(), kUpdates * 2e-4) << name;
  };
  compare("critics.parameters", reference.critics);
  compare("critics.target_parameters", reference.critics_target);
  compare("actor.parameters", reference.actor);
  compare("actor.target_parameters", reference.actor_target);
}

INSTANTIATE_TEST_SUITE_P(Networks, Td3ReferenceTest,
                         testing::Values(Case{"Paper", {32, 16}, {16, 16}, false},
                                         Case{"Fast", {}, {32, 32}, false},
                                         Case{"LayerNorm", {16}, {16}, true}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace slalom::learner
