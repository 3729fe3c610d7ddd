#include <gtest/gtest.h>
#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "learner/algorithm.h"
#include "learner/learner.h"
#include "tests/learner/random_rows.h"
#include "tests/learner/reference_network.h"

/// The first updates of TQC beside the paper's sums, number by number, in float64.

namespace slalom::learner {
namespace {

using at::Tensor;

constexpr int kBatch = 8;
constexpr int kBeams = 8;
constexpr int kCritics = 3;
constexpr int kQuantiles = 5;
constexpr int kDropped = 2;
constexpr std::uint64_t kSeed = 3;

MethodConfig Method() {
  MethodConfig method;
  LearnerConfig& config = method.learner;
  config.algorithm = "tqc";
  config.device = DeviceChoice::kCpu;
  config.batch_size = kBatch;
  config.actor_learning_rate = config.critic_learning_rate = 1e-3;
  config.tau = 0.25;
  config.prioritized = true;
  config.quantile_critics = kCritics;
  config.quantiles = kQuantiles;
  config.dropped_quantiles = kDropped;
  return method;
}

policy::PolicySpec Spec(const MethodConfig& method) {
  policy::PolicySpec spec;
  spec.observation.num_beams = kBeams;
  spec.network.encoder_layers = {16};
  spec.network.head_layers = {16};
  spec.distribution = DistributionOf(method.learner);
  return spec;
}

Tensor Read(const Learner& learner, const std::string& name) {
  nn::TensorMap tensors;
  learner.SaveState(tensors);
  const nn::StoredTensor& stored = tensors.at(name);
  std::vector<float> values(stored.bytes.size() / sizeof(float));
  std::memcpy(values.data(), stored.bytes.data(), stored.bytes.size());
  return torch::tensor(values).to(torch::kDouble);
}

struct Draw {
  Tensor action, log_probability;
};

/// By the density of a normal number and the slope of tanh. `random`: the stream of the noise.
Draw DrawFrom(const nn::NetworkShape& shape, const policy::ActionDistribution& distribution,
              const Tensor& actor, const Tensor& state, base::Random& random) {
  const Tensor noise = torch::zeros({kBatch, 2}, torch::kDouble);
  for (int i = 0; i < kBatch; ++i) {
    for (int j = 0; j < 2; ++j) noise[i][j] = random.Normal();
  }
  const Tensor output = ReferenceForward(shape, actor, state, {});
  const double low = distribution.log_std_min, high = distribution.log_std_max;
  const Tensor log_std = low + (high - low) * (torch::tanh(output.narrow(1, 2, 2)) + 1.0) / 2.0;
  const Tensor action = torch::tanh(output.narrow(1, 0, 2) + log_std.exp() * noise);
  const Tensor log_normal = -0.5 * noise.square() - log_std - 0.5 * std::log(2.0 * M_PI);
  return {action, (log_normal - (1.0 - action.square()).log()).sum(1)};
}

struct CriticFigures {
  Tensor loss = torch::zeros({}, torch::kDouble);
  std::vector<double> td_errors;
};

/// Atom by atom: sorts the pool, keeps the smallest, and sums rho over all pairs. `pool`, `z`:
/// [B, K, M] of the target critics and of the critics.
CriticFigures ComputeCriticFigures(const replay::SampledRows& rows, const Tensor& pool,
                                   const Tensor& log_probability, const Tensor& z, double alpha) {
  CriticFigures figures;
  for (int i = 0; i < kBatch; ++i) {
    const Tensor flat = pool[i].flatten().contiguous();
    std::vector<double> atoms(flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel());
    std::sort(atoms.begin(), atoms.end());
    atoms.resize(kCritics * (kQuantiles - kDropped));
    double mean_y = 0.0;
    for (const double atom : atoms) {
      const double y = rows.n_step_return[i] +
                       rows.discount[i] * (atom - alpha * log_probability[i].item<double>());
      mean_y += y / static_cast<double>(atoms.size());
      for (int k = 0; k < kCritics; ++k) {
        for (int m = 0; m < kQuantiles; ++m) {
          const Tensor u = y - z[i][k][m];
          const double tau = (2.0 * m + 1.0) / (2.0 * kQuantiles);
          const double size = std::abs(u.item<double>());
          const Tensor huber = size <= 1.0 ? 0.5 * u * u : u.abs() - 0.5;
          const double factor = std::abs(tau - (u.item<double>() < 0.0 ? 1.0 : 0.0));
          figures.loss = figures.loss + rows.weight[i] * factor * huber /
                                            static_cast<double>(atoms.size() * kQuantiles * kBatch);
        }
      }
    }
    double td_error = 0.0;
    for (int k = 0; k < kCritics; ++k) {
      td_error += std::abs(z[i][k].mean().item<double>() - mean_y) / kCritics;
    }
    figures.td_errors.push_back(td_error);
  }
  return figures;
}

// In the first update the target critics equal the critics and Adam has no moments yet; in the
// second nothing does.
TEST(Tqc, TwoUpdatesAreThoseOfThePaper) {
  const MethodConfig method = Method();
  const policy::PolicySpec spec = Spec(method);
  const nn::FeatureMap features(spec.observation, spec.network);
  const nn::NetworkShape actor_shape = nn::ActorShape(spec.network, features.frame_size(), 4);
  const nn::NetworkShape critic_shape =
      nn::CriticShape(spec.network, features.frame_size(), kQuantiles);
  const auto quantiles = [&](const Tensor& all, const Tensor& state, const Tensor& action) {
    std::vector<Tensor> outputs;
    for (const Tensor& one : all.view({kCritics, -1}).unbind(0)) {
      outputs.push_back(ReferenceForward(critic_shape, one, state, action));
    }
    return torch::stack(outputs, 1);
  };
  const auto read = [&](const auto& scans, const float* state) {
    Tensor result = torch::zeros({kBatch, features.frame_size()});
    for (int i = 0; i < kBatch; ++i) {
      features.Write(scans[i], state + i * env::kStateSize, false,
                     result.data_ptr<float>() + i * features.frame_size());
    }
    return result.to(torch::kDouble);
  };

  Learner learner(method, spec, kSeed);
  base::Random noise(base::DeriveSeed(kSeed, "policy noise"));
  base::Random next_noise(base::DeriveSeed(kSeed, "next policy noise"));
  for (const std::uint64_t update : {1, 2}) {
    SCOPED_TRACE(update);
    RandomRows random_rows(kBatch, 1, kBeams, 49 + update);
    replay::SampledRows& rows = random_rows.rows;
    for (int i = 0; i < kBatch; ++i) rows.weight[i] = 0.25f + 0.125f * static_cast<float>(i);
    const Tensor s = read(rows.ranges_cm, rows.state.data());
    const Tensor next_s = read(rows.next_ranges_cm, rows.next_state.data());
    Tensor a = torch::zeros({kBatch, 2}, torch::kDouble);
    for (int i = 0; i < kBatch; ++i) {
      a[i][0] = rows.action[2 * i];
      a[i][1] = rows.action[2 * i + 1];
    }
    const Tensor actor = Read(learner, "actor.parameters").requires_grad_();
    const Tensor critics = Read(learner, "critics.parameters").requires_grad_();
    const Tensor targets = Read(learner, "critics.target_parameters");
    EXPECT_EQ(torch::equal(targets, critics), update == 1);
    const Tensor actor_moment = Read(learner, "actor.adam.first_moment");
    const Tensor critic_moment = Read(learner, "critics.adam.first_moment");
    const double alpha = std::exp(Read(learner, "sac.log_temperature").item<double>());
    learner.Update(random_rows.batches(), 0.0);

    const Draw next = DrawFrom(actor_shape, spec.distribution, actor, next_s, next_noise);
    const CriticFigures expected =
        ComputeCriticFigures(rows, quantiles(targets, next_s, next.action.detach()),
                             next.log_probability, quantiles(critics, s, a), alpha);
    const auto compare = [&](const char* name, const Tensor& before, const Tensor& gradient) {
      // Float32 has 30 roundings of 2^-24 on the way.
      const Tensor moment = 0.9 * before + 0.1 * gradient;
      EXPECT_LE(((Read(learner, name) - moment).norm() / moment.norm()).item<double>(), 2e-6)
          << name;
    };
    compare("critics.adam.first_moment", critic_moment,
            torch::autograd::grad({expected.loss}, {critics})[0]);
    EXPECT_NEAR(learner.ReadStats().critic_loss, expected.loss.item<double>() / kCritics, 1e-6);
    const std::span<const float> td_errors = learner.TdErrors();
    for (int i = 0; i < kBatch; ++i) EXPECT_NEAR(td_errors[i], expected.td_errors[i], 1e-6) << i;

    const Tensor stepped = Read(learner, "critics.parameters");
    const Tensor moved = targets + method.learner.tau * (stepped - targets);
    // Numbers below 1, rounded three times.
    EXPECT_LE((Read(learner, "critics.target_parameters") - moved).abs().max().item<double>(),
              2e-7);

    const Draw now = DrawFrom(actor_shape, spec.distribution, actor, s, noise);
    const Tensor actor_loss =
        (alpha * now.log_probability - quantiles(stepped, s, now.action).mean({1, 2})).mean();
    compare("actor.adam.first_moment", actor_moment,
            torch::autograd::grad({actor_loss}, {actor})[0]);
  }
}

}  // namespace
}  // namespace slalom::learner
