#include "policy/nn/network.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "policy/nn/kernels/dropout.h"
#include "policy/nn/network_shape.h"
#include "tests/policy/nn/network_cases.h"
#include "tests/support/allocation_count.h"

namespace slalom::nn {
namespace {

/// `SpreadNumbers` as a tensor.
at::Tensor Numbers(std::int64_t count, double scale, std::uint32_t stream) {
  return at::tensor(SpreadNumbers(count, scale, stream), at::kDouble);
}

double Largest(const at::Tensor& a, const at::Tensor& b) {
  return (a.to(at::kDouble) - b.to(at::kDouble)).abs().max().item<double>();
}

class NetworkTest : public testing::TestWithParam<Case> {
 protected:
  static constexpr int kBatch = 3;

  NetworkTest()
      : shape_(CriticShape(GetParam().config, kFrame, 3)),
        parameters_(Numbers(shape_.num_parameters(), 0.6, 1)),
        input_(Numbers(kBatch * (shape_.num_inputs() + 2), 1.0, 2).view({kBatch, -1})),
        output_gradient_(Numbers(kBatch * 3, 1.0, 3).view({kBatch, 3})) {}

  NetworkShape shape_;
  at::Tensor parameters_, input_, output_gradient_;
};

TEST_P(NetworkTest, GradientsAreThoseOfFiniteDifferences) {
  at::Tensor gradient = at::full_like(parameters_, 1e3);
  const Network network(shape_, parameters_);
  Network network_gradient(shape_, gradient);
  base::Random dropout(1);
  NetworkPass pass(shape_, input_, PassUse::kTraining, &dropout);
  const auto forward = [&] {
    dropout = base::Random(1);
    network.Forward(pass);
    return (pass.output() * output_gradient_).sum().item<double>();
  };
  for (int i = 0; i < 2; ++i) {  // The second time over what the first left behind.
    forward();
    pass.output_gradient().copy_(output_gradient_);
    network.ParameterGradient(pass, network_gradient);
  }
  const at::Tensor parameter_gradient = gradient.clone();
  constexpr double kStep = 1e-6;
  const auto difference = [&](double* value) {
    const double before = *value;
    *value = before + kStep;
    const double above = forward();
    *value = before - kStep;
    const double below = forward();
    *value = before;
    return (above - below) / (2 * kStep);
  };
  for (std::int64_t i = 0; i < parameters_.numel(); i += 7) {
    // Rounding 10 * 2^-53 / kStep = 1e-9; curvature kStep^2 * 1e3 of the sharpest, LayerNorm.
    EXPECT_NEAR(parameter_gradient[i].item<double>(),
                difference(parameters_.data_ptr<double>() + i), 2e-8)
        << "parameter " << i;
  }
  forward();
  pass.output_gradient().copy_(output_gradient_);
  network.ExtraGradient(pass);
  const at::Tensor extra_gradient = pass.extra_gradient().clone();
  for (int b = 0; b < kBatch; ++b) {
    for (int j = 0; j < 2; ++j) {
      const double expected =
          difference(input_.data_ptr<double>() + (b + 1) * input_.size(1) - 2 + j);
      EXPECT_NEAR(extra_gradient[b][j].item<double>(), expected, 2e-8);
    }
  }
}

// Sums of at most 60 products of numbers below 1 through ten operations: 60 * 10 * 2^-24 = 4e-5. A
// ReLU at the very edge would differ by more; none is here.
TEST_P(NetworkTest, FusedKernelsAreLibTorchsOperationsToTheirPrecision) {
  const auto run = [&](at::ScalarType type, at::Tensor& gradient) {
    const at::Tensor parameters = parameters_.to(type);
    gradient = at::full_like(parameters, 1e3);
    const Network network(shape_, parameters);
    Network network_gradient(shape_, gradient);
    base::Random dropout(1);
    NetworkPass pass(shape_, input_.to(type), PassUse::kTraining, &dropout);
    network.Forward(pass);
    pass.output_gradient().copy_(output_gradient_);
    network.ParameterGradient(pass, network_gradient);
    return pass.output();
  };
  at::Tensor gradient, fused_gradient;
  const at::Tensor output = run(at::kDouble, gradient);
  EXPECT_LE(Largest(run(at::kFloat, fused_gradient), output), 5e-5);
  EXPECT_LE(Largest(fused_gradient, gradient), 2e-4);
}

TEST_P(NetworkTest, AllocatesNothing) {
  at::set_num_threads(1);
  const at::Tensor parameters = parameters_.to(at::kFloat);
  at::Tensor gradient = at::zeros_like(parameters);
  const Network network(shape_, parameters);
  Network network_gradient(shape_, gradient);
  base::Random dropout(1);
  NetworkPass pass(shape_, input_.to(at::kFloat), PassUse::kTraining, &dropout);
  const auto run = [&] {
    network.Forward(pass);
    network.ParameterGradient(pass, network_gradient);
  };
  run();
  const long before = test::NumAllocations();
  for (int i = 0; i < 5; ++i) run();
  EXPECT_EQ(test::NumAllocations() - before, 0);
}

TEST_P(NetworkTest, InferenceIsTrainingWithoutDropout) {
  const Network network(shape_, parameters_);
  NetworkPass training(shape_, input_);
  base::Random dropout(1);
  NetworkPass inference(shape_, input_, PassUse::kInference, &dropout);
  network.Forward(training);
  network.Forward(inference);
  EXPECT_TRUE(inference.output().equal(training.output()));
}

INSTANTIATE_TEST_SUITE_P(Encoders, NetworkTest, testing::ValuesIn(Cases()),
                         [](const auto& test) { return std::string(test.param.name); });

// The numbers above with 2^-53: 7e-14.
TEST(NetworkGolden, IsPyTorchsInDoublePrecision) {
  int num_cases = 0;
  for (const Golden& golden : ReadGolden()) {
    SCOPED_TRACE(golden.name);
    const auto found = std::ranges::find(Cases(), golden.name, &Case::name);
    ASSERT_NE(found, Cases().end());
    const NetworkShape shape = CriticShape(found->config, kFrame, 3);
    ASSERT_EQ(shape.num_parameters(), golden.num_parameters);
    const at::Tensor input = Numbers(3 * (shape.num_inputs() + 2), 1.0, 2).view({3, -1});
    at::Tensor gradient = at::zeros({shape.num_parameters()}, at::kDouble);
    const Network network(shape, Numbers(shape.num_parameters(), 0.6, 1));
    Network network_gradient(shape, gradient);
    NetworkPass pass(shape, input);
    network.Forward(pass);
    ASSERT_EQ(std::ssize(golden.output), 9);
    for (std::int64_t i = 0; i < 9; ++i) {
      EXPECT_NEAR(pass.output().data_ptr<double>()[i], golden.output[i], 1e-12);
    }
    pass.output_gradient().copy_(Numbers(9, 1.0, 3).view({3, 3}));
    network.ParameterGradient(pass, network_gradient);
    for (std::size_t i = 0; i < golden.gradient.size(); ++i) {
      EXPECT_NEAR(gradient.data_ptr<double>()[29 * i], golden.gradient[i], 1e-12) << 29 * i;
    }
    ++num_cases;
  }
  EXPECT_EQ(num_cases, 8);
}

TEST(NetworkDropout, IsDrawnAnewInEachPassOfItsStream) {
  NetworkConfig config = Dropping(Make(EncoderFamily::kTransformer, {8}, 2));
  config.dropout_everywhere = true;
  const NetworkShape shape = ActorShape(config, kFrame);
  const Network network(shape, Numbers(shape.num_parameters(), 0.6, 1));
  const at::Tensor input = Numbers(3 * shape.num_inputs(), 1.0, 2).view({3, -1});
  base::Random first(1), second(1);
  NetworkPass pass(shape, input, PassUse::kInference, &first);
  NetworkPass same(shape, input, PassUse::kInference, &second);
  network.Forward(pass);
  network.Forward(same);
  EXPECT_TRUE(pass.output().equal(same.output()));
  network.Forward(pass);
  EXPECT_FALSE(pass.output().equal(same.output()));
}

// The share of 10,000 draws at 0.3 has the deviation sqrt(0.3 * 0.7 / 10000) = 0.0046; five of them
// are exceeded once in two million. A rate of 0.33 or a scale of 1 fails.
TEST(Dropout, DropsItsShareAndKeepsTheMean) {
  base::Random random(1);
  Dropout dropout(0.3, at::zeros({100, 100}, at::kFloat), &random);
  dropout.Draw();
  at::Tensor ones = at::ones({100, 100}, at::kFloat);
  dropout.Apply(ones);
  EXPECT_NEAR((ones == 0).sum().item<double>() / 1e4, 0.3, 5 * 0.0046);
  EXPECT_EQ(ones.max().item<float>(), static_cast<float>(1.0 / 0.7));
}

}  // namespace
}  // namespace slalom::nn
