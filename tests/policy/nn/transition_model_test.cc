#include "policy/nn/transition_model.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/torch.h>

#include <cmath>
#include <string>

#include "base/error.h"
#include "policy/nn/kernels/smooth_math.h"
#include "tests/support/allocation_count.h"

namespace slalom::nn {
namespace {

constexpr int kBatch = 7;
constexpr int kFrame = 9;  // Five ranges and the state.

struct Case {
  const char* name;
  TransitionModelConfig config;
  int history;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

TransitionModelConfig Small(ModelKind kind, ModelTargets targets) {
  return {
      .kind = kind, .targets = targets, .ensemble = 2, .encoder_layers = {11}, .head_layers = {12}};
}

TransitionModelConfig AsPublished(ModelKind kind) {
  TransitionModelConfig config = Small(kind, ModelTargets::kAbsolute);
  config.log_std = LogStdBounds::kPublished;
  config.bound_ranges = true;
  config.predict_last_action = true;
  return config;
}

TransitionModelConfig KnowingSuccess(ModelKind kind) {
  TransitionModelConfig config = Small(kind, ModelTargets::kDifference);
  config.success = ModelSuccess::kKnown;
  return config;
}

constexpr double kGoalScale = 2.0;  // [m] per unit of a goal's features.
constexpr GoalRule kGoal = {.radius = 3.0, .reward = 2.5};

using enum ModelKind;
using enum ModelTargets;

const Case kCases[] = {
    {"DeterministicDifference", Small(kDeterministic, kDifference), 1},
    {"DeterministicAbsolute", Small(kDeterministic, kAbsolute), 3},
    {"DeterministicAsPublished", AsPublished(kDeterministic), 1},
    {"ProbabilisticDifference", Small(kProbabilistic, kDifference), 3},
    {"ProbabilisticAbsolute", Small(kProbabilistic, kAbsolute), 1},
    {"ProbabilisticAsPublished", AsPublished(kProbabilistic), 3},
    {"DeterministicKnowingSuccess", KnowingSuccess(kDeterministic), 1},
    {"ProbabilisticKnowingSuccess", KnowingSuccess(kProbabilistic), 3},
};

class TransitionModelTest : public testing::TestWithParam<Case> {
 protected:
  TransitionModelTest()
      : network_{.history = GetParam().history},
        shape_(MakeModelShape(GetParam().config, network_, kFrame,
                              {{}, 720, env::kStateSize, 5.0, kGoalScale}, kGoal)) {
    torch::manual_seed(1);
    parameters_ = torch::randn({shape_.num_parameters()}, torch::kDouble) * 0.5;
    input_ = torch::randn({kBatch, shape_.network.num_inputs() + 2}, torch::kDouble);
    noise_ = torch::randn({kBatch, shape_.num_predicted}, torch::kDouble);
  }

  /// The stack after row `i`'s action, by the words of the config alone.
  std::vector<double> Expected(int i, int member, bool noisy, double* reward, double* termination) {
    const TransitionModelConfig& config = GetParam().config;
    const std::int64_t size = shape_.num_member_parameters();
    const Network mlp(shape_.network, parameters_.narrow(0, member * size, size));
    const at::Tensor row = input_.narrow(0, i, 1).clone();
    NetworkPass pass(shape_.network, row);
    mlp.Forward(pass);
    const double* const in = row.data_ptr<double>();
    const double* const out = pass.output().data_ptr<double>();
    const int width = shape_.network.num_inputs();
    const int predicted = config.predict_last_action ? kFrame : kFrame - 2;
    std::vector<double> stack(in + kFrame, in + width);
    for (int j = 0; j < predicted; ++j) {
      double value = out[j];
      const bool is_range = j < kFrame - 4;
      if (config.bound_ranges && is_range) value = std::tanh(value);
      if (config.targets == ModelTargets::kDifference) value += in[width - kFrame + j];
      if (noisy && config.kind == ModelKind::kProbabilistic) {
        double log_std = out[predicted + j];
        if (config.log_std == LogStdBounds::kBounded)
          log_std = -5.0 + 6.0 * (1.0 + std::tanh(log_std)) / 2.0;
        if (config.log_std == LogStdBounds::kPublished && is_range) log_std = std::tanh(log_std);
        value += std::exp(log_std) * noise_[i][j].item<double>();
      }
      if (!config.bound_ranges && is_range) value = std::min(1.0, std::max(-1.0, value));
      stack.push_back(value);
    }
    for (int j = 0; predicted + j < kFrame; ++j) {
      stack.push_back(std::min(1.0, std::max(-1.0, in[width + j])));
    }
    const int rest = config.kind == ModelKind::kProbabilistic ? 2 * predicted : predicted;
    *reward = out[rest];
    *termination = 1.0 / (1.0 + std::exp(-out[rest + 1]));
    // The goal [m], as FeatureMap writes it.
    const double* const goal = stack.data() + width - 4;
    const double distance = kGoalScale * std::hypot(goal[0] + 1.0, goal[1] + 1.0);
    if (config.success == ModelSuccess::kKnown && distance < kGoal.radius) {
      *reward += kGoal.reward;
      *termination = 1.0;
    }
    return stack;
  }

  void Check(at::ScalarType type, bool noisy, bool in_place, double tolerance) {
    const TransitionModel model(shape_, parameters_.to(type));
    const at::Tensor input = input_.to(type, /*non_blocking=*/false, /*copy=*/true);
    ModelPass pass(shape_, input);
    at::Tensor next = in_place ? input.narrow(1, 0, shape_.network.num_inputs())
                               : torch::zeros({kBatch, shape_.network.num_inputs() + 5}, type)
                                     .narrow(1, 0, shape_.network.num_inputs());
    model.Predict(pass, 1, noisy ? noise_.to(type) : at::Tensor(), next);
    int successes = 0;
    for (int i = 0; i < kBatch; ++i) {
      double reward = 0.0, termination = 0.0;
      const std::vector<double> expected = Expected(i, 1, noisy, &reward, &termination);
      ASSERT_EQ(std::ssize(expected), next.size(1));
      for (std::int64_t j = 0; j < next.size(1); ++j) {
        EXPECT_NEAR(next[i][j].item<double>(), expected[j],
                    tolerance * (1.0 + std::abs(expected[j])))
            << i << " " << j;
      }
      EXPECT_NEAR(pass.reward()[i].item<double>(), reward, tolerance);
      EXPECT_NEAR(pass.termination()[i].item<double>(), termination, tolerance);
      successes += termination == 1.0 ? 1 : 0;
    }
    const bool known = GetParam().config.success == ModelSuccess::kKnown;
    EXPECT_EQ(successes > 0 && successes < kBatch, known) << successes;
  }

  NetworkConfig network_;
  ModelShape shape_;
  at::Tensor parameters_, input_, noise_;
};

// Values below about 100 before an exponential, sums of 30 products: 100 * 30 * 2^-53 is 3e-13.
TEST_P(TransitionModelTest, PredictsAsTheConfigSaysInDoublePrecision) {
  for (const bool noisy : {false, true}) Check(torch::kDouble, noisy, /*in_place=*/false, 1e-11);
}

// The same with 2^-24: 2e-4.
TEST_P(TransitionModelTest, FusedKernelsPredictTheSame) {
  for (const bool noisy : {false, true}) {
    Check(torch::kFloat, noisy, /*in_place=*/false, 5e-4);
    Check(torch::kFloat, noisy, /*in_place=*/true, 5e-4);
  }
}

TEST_P(TransitionModelTest, AllocatesNothing) {
  at::set_num_threads(1);
  const at::NoGradGuard no_grad;
  const TransitionModel model(shape_, parameters_.to(torch::kFloat));
  const at::Tensor input = input_.to(torch::kFloat);
  const at::Tensor noise = noise_.to(torch::kFloat);
  ModelPass pass(shape_, input);
  at::Tensor next = input.narrow(1, 0, shape_.network.num_inputs());
  model.Predict(pass, 0, noise, next);
  const long before = test::NumAllocations();
  for (int i = 0; i < 10; ++i) model.Predict(pass, 1, noise, next);
  EXPECT_EQ(test::NumAllocations() - before, 0);
}

INSTANTIATE_TEST_SUITE_P(Kinds, TransitionModelTest, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

// 2^-24 is 6e-8; the argument of the exponential has that error times its size, at most 88.
TEST(SmoothMath, IsTheStandardLibrarys) {
  double exp_error = 0.0, tanh_error = 0.0, sigmoid_error = 0.0;
  for (int i = -8700; i <= 8700; ++i) {
    const float x = 0.01f * static_cast<float>(i);
    const double wide = static_cast<double>(x);
    exp_error = std::max(exp_error, std::abs(SmoothExp(x) / std::exp(wide) - 1.0));
    tanh_error = std::max(tanh_error, std::abs(SmoothTanh(x) - std::tanh(wide)));
    sigmoid_error =
        std::max(sigmoid_error, std::abs(SmoothSigmoid(x) - 1.0 / (1.0 + std::exp(-wide))));
  }
  EXPECT_LT(exp_error, 3e-7);
  EXPECT_LT(tanh_error, 3e-7);
  EXPECT_LT(sigmoid_error, 3e-7);
  EXPECT_EQ(Softplus(1000.0), 1000.0);
  EXPECT_NEAR(Softplus(0.5), std::log(1.0 + std::exp(0.5)), 1e-15);
}

TEST(ModelShape, IsTheOriginals) {
  TransitionModelConfig config;
  config.kind = ModelKind::kProbabilistic;
  config.targets = ModelTargets::kAbsolute;
  config.predict_last_action = true;
  const ModelShape shape = MakeModelShape(config, NetworkConfig{}, 724);
  // Encoder 724 -> 512 -> 512, the action, head 514 -> 512 -> 512, then mean and log-std of 724
  // numbers, reward and termination (docs/original-system.md, section 5.1).
  constexpr std::int64_t kEncoder = (724 + 1) * 512 + (512 + 1) * 512;
  constexpr std::int64_t kHead = (514 + 1) * 512 + (512 + 1) * 512;
  constexpr std::int64_t kOutputs = (512 + 1) * (2 * 724 + 2);
  EXPECT_EQ(shape.num_parameters(), kEncoder + kHead + kOutputs);
  EXPECT_EQ(shape.num_parameters(), 1904042);
}

std::string Refusal(const TransitionModelConfig& config, const NetworkConfig& network) {
  try {
    MakeModelShape(config, network, kFrame);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

TEST(ModelShape, RefusesWhatMakesNoSense) {
  TransitionModelConfig config = AsPublished(kDeterministic);
  EXPECT_EQ(Refusal(config, {}), "");
  EXPECT_THAT(Refusal(config, {.range_transform = RangeTransform::kInverse}),
              testing::HasSubstr("network.range_transform"));
  config.targets = ModelTargets::kDifference;
  EXPECT_THAT(Refusal(config, {}), testing::HasSubstr("model.targets"));
  config = Small(kProbabilistic, kDifference);
  config.log_std_min = 2.0;
  EXPECT_THAT(Refusal(config, {}), testing::HasSubstr("model.log_std_min"));
}

}  // namespace
}  // namespace slalom::nn
