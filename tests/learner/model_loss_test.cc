#include "learner/model_loss.h"

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <string>

#include "tests/learner/reference_model_loss.h"

namespace slalom::learner {
namespace {

constexpr int kBatch = 13;
constexpr int kFrame = 21;  // Seventeen ranges and the state: more than sums take side by side.

struct Case {
  const char* name;
  nn::TransitionModelConfig config;
  nn::NetworkConfig network = {.history = 2};
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

nn::TransitionModelConfig Small(nn::ModelKind kind, nn::ModelTargets targets, bool published) {
  return {.kind = kind,
          .targets = targets,
          .encoder_layers = {11},
          .head_layers = {12},
          .log_std = published ? nn::LogStdBounds::kPublished : nn::LogStdBounds::kBounded,
          .log_std_min = -1.5,
          .bound_ranges = published,
          .predict_last_action = published};
}

nn::TransitionModelConfig KnowingSuccess(nn::ModelKind kind) {
  nn::TransitionModelConfig config = Small(kind, nn::ModelTargets::kDifference, false);
  config.success = nn::ModelSuccess::kKnown;
  return config;
}

constexpr nn::GoalRule kGoal = {.radius = 5.0, .reward = 2.5};

/// For every encoder alike.
nn::TransitionModelConfig OnEncoder(nn::ModelKind kind) {
  nn::TransitionModelConfig config = Small(kind, nn::ModelTargets::kDifference, false);
  config.encoder_layers = {8, 8};
  return config;
}

const nn::NetworkConfig kOfTransformer = {
    .encoder = nn::EncoderFamily::kTransformer, .attention_heads = 2, .history = 4};

using enum nn::ModelKind;
using enum nn::ModelTargets;
using enum nn::EncoderFamily;

const Case kCases[] = {
    {"DeterministicDifference", Small(kDeterministic, kDifference, false)},
    {"DeterministicAsPublished", Small(kDeterministic, kAbsolute, true)},
    {"ProbabilisticDifference", Small(kProbabilistic, kDifference, false)},
    {"ProbabilisticAbsolute", Small(kProbabilistic, kAbsolute, false)},
    {"ProbabilisticAsPublished", Small(kProbabilistic, kAbsolute, true)},
    {"DeterministicKnowingSuccess", KnowingSuccess(kDeterministic)},
    {"ProbabilisticKnowingSuccess", KnowingSuccess(kProbabilistic)},
    {"DeterministicMlp", OnEncoder(kDeterministic), {.encoder = kMlp, .history = 4}},
    {"DeterministicCnn", OnEncoder(kDeterministic), {.encoder = kCnn, .history = 4}},
    {"DeterministicGru", OnEncoder(kDeterministic), {.encoder = kGru, .history = 4}},
    {"DeterministicTransformer", OnEncoder(kDeterministic), kOfTransformer},
    {"ProbabilisticMlp", OnEncoder(kProbabilistic), {.encoder = kMlp, .history = 4}},
    {"ProbabilisticCnn", OnEncoder(kProbabilistic), {.encoder = kCnn, .history = 4}},
    {"ProbabilisticGru", OnEncoder(kProbabilistic), {.encoder = kGru, .history = 4}},
    {"ProbabilisticTransformer", OnEncoder(kProbabilistic), kOfTransformer},
};

class ModelLossTest : public testing::TestWithParam<Case> {
 protected:
  static constexpr double kStateScale = 0.7;

  ModelLossTest()
      : shape_(MakeModelShape(GetParam().config, GetParam().network, kFrame, {}, kGoal)),
        width_(shape_.network.num_inputs()),
        newest_(width_ - kFrame) {
    torch::manual_seed(1);
    parameters_ = torch::randn({shape_.num_parameters()}, torch::kDouble) * 0.3;
    input_ = torch::randn({kBatch, width_ + 2}, torch::kDouble);
    next_ = torch::randn({kBatch, width_}, torch::kDouble);
    reward_ = torch::randn({kBatch}, torch::kDouble);
    discount_ = torch::ones({kBatch}, torch::kDouble);
    discount_.slice(0, 0, kBatch, 4).zero_();
    // Of the four that ended one is a collision at the goal, one a success and held out, one lies
    // elsewhere; and one at the goal has not ended.
    cost_ = torch::zeros({kBatch}, torch::kDouble);
    cost_[4] = 1.0;
    for (const int i : {0, 4, 8, 9}) {
      next_.slice(1, width_ - 4, width_ - 2).select(0, i).fill_(-0.6);
    }
    next_.slice(1, width_ - 4, width_ - 2).select(0, 12).fill_(0.6);
    weight_ = torch::ones({kBatch}, torch::kDouble);
    weight_[3] = 0.0;
    weight_[8] = 0.0;
    weight_[5] = 2.0;
  }

  ModelTargets Targets(at::ScalarType type) const {
    return {input_.narrow(1, 0, width_).to(type),
            next_.to(type),
            reward_.to(type),
            discount_.to(type),
            cost_.to(type),
            weight_.to(type)};
  }

  /// What `ModelLoss` gives in one type, and what LibTorch gives in float64.
  void Check(at::ScalarType type, double tolerance) {
    const nn::Network network(shape_.network, parameters_);
    nn::NetworkPass network_pass(shape_.network, input_);
    network.Forward(network_pass);
    const at::Tensor raw = network_pass.output().clone().requires_grad_();
    ModelTargets targets = Targets(torch::kDouble);
    if (GetParam().config.success == nn::ModelSuccess::kKnown) {
      // The heads are to give what is not success.
      const at::Tensor success = torch::zeros({kBatch}, torch::kDouble);
      success[0] = success[8] = 1.0;
      targets.reward = targets.reward - kGoal.reward * success;
      targets.discount = targets.discount + success;
    }
    const auto [losses, z] = ReferenceLossOf(GetParam().config, kStateScale, raw, targets);
    ((losses * weight_).sum() / weight_.sum()).backward();

    const nn::TransitionModel model(shape_, parameters_.to(type));
    const at::Tensor input = input_.to(type);
    nn::ModelPass pass(shape_, input);
    at::Tensor figures = torch::zeros({kNumModelFigures}, torch::kDouble);
    model.Forward(pass, 0);
    pass.output_gradient().fill_(1e3);
    ModelLoss(shape_, Targets(type), kStateScale, pass, figures);
    const at::Tensor difference = pass.output_gradient().to(torch::kDouble) - raw.grad();
    EXPECT_LE(difference.abs().max().item<double>(), tolerance);

    const auto figure = [&](int i) { return figures[i].item<double>(); };
    const double total =
        figure(kModelStateLoss) + figure(kModelRewardLoss) + figure(kModelTerminationLoss);
    EXPECT_NEAR(total, (losses.detach() * weight_).sum().item<double>(), tolerance * total);
    EXPECT_EQ(figure(kModelWeight), 12.0);
    EXPECT_EQ(figure(kHeldOutCount), 2.0);
    const at::Tensor held = (weight_ == 0).to(torch::kDouble);
    const int n = shape_.num_predicted;
    const at::Tensor change = next_.narrow(1, newest_, n) - input_.narrow(1, newest_, n);
    EXPECT_NEAR(figure(kHeldOutChange), (held * change.square().mean(1)).sum().item<double>(),
                10 * tolerance);
    if (shape_.probabilistic) {
      for (const auto& [place, half] : {std::pair(kHeldOutInside50, 0.6744897501960817),
                                        std::pair(kHeldOutInside90, 1.6448536269514722)}) {
        const at::Tensor inside = (z.abs() < half).to(torch::kDouble).mean(1);
        EXPECT_NEAR(figure(place), (held * inside).sum().item<double>(), 1e-9);
      }
    } else {
      EXPECT_EQ(figure(kHeldOutInside90), 0.0);
    }
  }

  nn::ModelShape shape_;
  std::int64_t width_;   // Of a stack of frames.
  std::int64_t newest_;  // Column where its newest frame begins.
  at::Tensor parameters_, input_, next_, reward_, discount_, cost_, weight_;
};

// Gradients below about 100 and a few hundred operations: 100 * 300 * 2^-53 is 3e-12.
TEST_P(ModelLossTest, IsAutogradInDoublePrecision) { Check(torch::kDouble, 1e-10); }

// The same with 2^-24, where errors add up like a random walk: 100 * sqrt(300) * 6e-8 is 1e-4.
TEST_P(ModelLossTest, FusedKernelsAreAutogradToTheirPrecision) { Check(torch::kFloat, 2e-4); }

TEST_P(ModelLossTest, ParameterGradientIsThatOfFiniteDifferences) {
  at::Tensor parameters = parameters_.clone();
  at::Tensor gradient = torch::zeros_like(parameters);
  const nn::TransitionModel model(shape_, parameters);
  nn::TransitionModel gradient_model(shape_, gradient);
  nn::ModelPass pass(shape_, input_);
  const ModelTargets targets = Targets(torch::kDouble);
  const auto loss = [&] {
    at::Tensor figures = torch::zeros({kNumModelFigures}, torch::kDouble);
    model.Forward(pass, 0);
    ModelLoss(shape_, targets, kStateScale, pass, figures);
    return figures.slice(0, 0, 3).sum().item<double>() / figures[kModelWeight].item<double>();
  };
  loss();
  model.member(0).ParameterGradient(pass.network(), gradient_model.member(0));
  constexpr double kStep = 1e-6;
  for (std::int64_t i = 0; i < parameters.numel(); i += 41) {
    double* const value = parameters.data_ptr<double>() + i;
    const double before = *value;
    *value = before + kStep;
    const double above = loss();
    *value = before - kStep;
    const double below = loss();
    *value = before;
    // Rounding: a loss of 1e3 * 2^-53 / kStep is 1e-7; curvature kStep^2 times a third derivative
    // below 1e5.
    EXPECT_NEAR(gradient[i].item<double>(), (above - below) / (2 * kStep), 2e-6) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, ModelLossTest, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace slalom::learner
