#include <gtest/gtest.h>
#include <torch/torch.h>

#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "learner/actor_critic.h"
#include "learner/deterministic_actor.h"
#include "learner/gaussian_actor.h"
#include "learner/method.h"
#include "learner/noise.h"
#include "policy/nn/feature_map.h"
#include "tests/learner/every_encoder.h"
#include "tests/learner/random_rows.h"
#include "tests/learner/written_td3.h"

/// TD3 and SAC as their papers' losses in LibTorch's operations, beside the algorithms whose
/// gradients are written by hand.

namespace slalom::learner {
namespace {

using at::Tensor;

/// Haarnoja et al. 2018, algorithm 1, with a constant temperature.
class WrittenSac : public ActorCritic<GaussianActor> {
 public:
  explicit WrittenSac(const AlgorithmContext& context)
      : ActorCritic(context, /*num_critics=*/2),
        random_(base::DeriveSeed(context.seed, "policy noise")),
        next_random_(base::DeriveSeed(context.seed, "next policy noise")),
        noise_(context.config.batch_size, 2, at::kCPU),
        next_noise_(context.config.batch_size, 2, at::kCPU) {}

  void Update(double rate) override {
    const auto& [s, a, next_s] =
        std::tie(minibatch_.features, minibatch_.actions, minibatch_.next_features);
    totals_.CountActorUpdate();
    const auto [next_a, next_log_pi] = actor_.Draw(next_s, next_noise_.Draw(next_random_));
    const Tensor next_q = critics_.TargetValues(next_s, next_a.detach()).amin({1, 2});
    const Tensor y = minibatch_.reward +
                     minibatch_.discount * (next_q - config_.temperature * next_log_pi.detach());
    critics_.Descend(CriticLoss(critics_.Values(s, a), y), rate * config_.critic_learning_rate,
                     config_.tau, totals_[Total::kCriticNorm]);
    if (constraint_) {
      constraint_->UpdateCritics(next_a.detach(), rate * config_.critic_learning_rate, config_.tau);
    }
    const auto [act, log_pi] = actor_.Draw(s, noise_.Draw(random_));
    const Tensor q = critics_.Values(s, act).amin({1, 2});
    Tensor loss = (config_.temperature * log_pi - q).mean();
    if (constraint_) loss = loss + constraint_->Penalty(s, act);
    actor_.Descend(loss, rate * config_.actor_learning_rate, AverageRate(),
                   totals_[Total::kActorNorm]);
  }

 private:
  base::Random random_, next_random_;
  Noise noise_, next_noise_;
};

/// The mean squared distance from the teachers' actions.
class WrittenDistillation : public ActorCritic<DeterministicActor> {
 public:
  explicit WrittenDistillation(const AlgorithmContext& context)
      : ActorCritic(context, /*num_critics=*/1) {}

  void Update(double rate) override {
    totals_.CountActorUpdate();
    const Tensor distance = actor_.Actions(minibatch_.features) - minibatch_.actions;
    actor_.Descend(distance.square().sum(1).mean(), rate * config_.actor_learning_rate,
                   /*polyak_rate=*/0.0, AverageRate(), totals_[Total::kActorNorm]);
  }
};

/// An algorithm with what it is constructed from.
class Runner {
 public:
  template <class Make>
  Runner(const LearnerConfig& config, const EncoderCase& encoder, double multiplier,
         const Make& make)
      : config_(config),
        spec_(MakeSpec(config, encoder)),
        features_(spec_.observation, spec_.network),
        reader_(features_, spec_.network.history, 1.0, /*mirror=*/false, 1.0),
        minibatch_(config.batch_size, spec_.network.history, features_.frame_size(), at::kCPU),
        totals_(at::kCPU) {
    if (multiplier > 0.0) {
      constraint_.emplace(
          ConstraintConfig{.kind = ConstraintKind::kFixed, .multiplier = multiplier},
          nn::CriticShape(spec_.network, features_.frame_size()), cost_weights_, minibatch_,
          totals_);
    }
    algorithm_ = make(AlgorithmContext{.config = config_,
                                       .spec = spec_,
                                       .seed = 3,
                                       .initial_weights = weights_,
                                       .minibatch = minibatch_,
                                       .totals = totals_,
                                       .constraint = constraint_ ? &*constraint_ : nullptr});
  }

  static policy::PolicySpec MakeSpec(const LearnerConfig& config, const EncoderCase& encoder) {
    policy::PolicySpec spec;
    spec.observation.num_beams = 24;
    spec.network = encoder.network;
    spec.network.sectors = 12;
    spec.distribution = DistributionOf(config);
    return spec;
  }

  void Update(std::uint64_t seed) {
    const RandomRows rows(config_.batch_size, spec_.network.history, 24, seed);
    base::Random unused(1);
    reader_.Read(rows.rows, unused, minibatch_);
    totals_.CountUpdate();
    algorithm_->Update(1.0);
  }

  Tensor Read(const std::string& name) const {
    nn::TensorMap tensors;
    algorithm_->SaveState(tensors);
    const nn::StoredTensor& stored = tensors.at(name);
    std::vector<float> values(stored.bytes.size() / sizeof(float));
    std::memcpy(values.data(), stored.bytes.data(), stored.bytes.size());
    return torch::tensor(values).to(torch::kDouble);
  }

 private:
  const LearnerConfig config_;
  const policy::PolicySpec spec_;
  nn::FeatureMap features_;
  MinibatchReader reader_;
  Minibatch minibatch_;
  Totals totals_;
  base::Random weights_{5}, cost_weights_{6};
  std::optional<Constraint> constraint_;
  std::unique_ptr<Algorithm> algorithm_;
};

class WrittenLossesTest : public testing::TestWithParam<EncoderCase> {};

/// `parts`: what both train.
template <class Written>
void CompareWithShipped(const char* algorithm, double multiplier,
                        const std::vector<std::string>& parts = {"critics", "actor"}) {
  LearnerConfig config;
  config.algorithm = algorithm;
  config.batch_size = 16;
  config.policy_delay = 1;
  config.actor_learning_rate = config.critic_learning_rate = 1e-4;
  config.temperature_learning_rate = 0.0;
  config.tau = 0.1;
  config.average_rate = 0.1;
  const EncoderCase& encoder = WrittenLossesTest::GetParam();
  Runner shipped(config, encoder, multiplier, MakeAlgorithm);
  Runner written(config, encoder, multiplier, [](const AlgorithmContext& context) {
    return std::make_unique<Written>(context);
  });
  shipped.Update(50);
  written.Update(50);
  for (const std::string& part : parts) {
    const std::string name = part + ".adam.first_moment";
    // After one step, a tenth of the gradient. Both paths have the same networks, and differ in the
    // few operations between their outputs and the loss: 16 roundings of 2^-24. The actor's
    // gradient is of critics that have made a step, whose numbers of near-zero gradient may differ.
    const Tensor expected = shipped.Read(name);
    const Tensor difference = written.Read(name) - expected;
    EXPECT_LE((difference.norm() / expected.norm()).item<double>(), 1e-6) << name;
  }
  for (int i = 1; i < 6; ++i) {
    shipped.Update(50 + i);
    written.Update(50 + i);
  }
  std::vector<std::string> names = {"actor.average_parameters"};
  for (const std::string& part : parts) {
    names.push_back(part + ".parameters");
    if (part == "critics") names.push_back(part + ".target_parameters");
  }
  for (const std::string& name : names) {
    // Six roundings of parameters below 1/2: 6 * 2^-26 = 9e-8 at most, and less on average.
    const Tensor difference = (written.Read(name) - shipped.Read(name)).abs();
    EXPECT_LE(difference.mean().item<double>(), 5e-8) << name;
  }
}

TEST_P(WrittenLossesTest, AreTd3) { CompareWithShipped<WrittenTd3>("td3", 0.0); }
TEST_P(WrittenLossesTest, AreTd3WithAConstraint) { CompareWithShipped<WrittenTd3>("td3", 2.0); }
TEST_P(WrittenLossesTest, AreSac) { CompareWithShipped<WrittenSac>("sac", 0.0); }
TEST_P(WrittenLossesTest, AreSacWithAConstraint) { CompareWithShipped<WrittenSac>("sac", 2.0); }
TEST_P(WrittenLossesTest, AreDistillation) {
  CompareWithShipped<WrittenDistillation>("distillation", 0.0, {"actor"});
}

INSTANTIATE_TEST_SUITE_P(Encoders, WrittenLossesTest, testing::ValuesIn(EveryEncoder()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace slalom::learner
