#include "policy/nn/mlp.h"

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <string>

#include "policy/nn/network_shape.h"

namespace slalom::nn {
namespace {

/// Batch, layers, where the action enters and LayerNorm, over which everything is checked.
struct Case {
  const char* name;
  std::vector<int> encoder;
  std::vector<int> head;
  bool layer_norm;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

const Case kCases[] = {
    {"ActionAtTheInput", {}, {33, 20}, false},
    {"ActionAfterTheEncoder", {19, 33}, {20, 17}, false},
    {"ActionAtTheOutput", {19}, {}, false},
    {"LayerNorm", {19}, {33}, true},
    {"LinearOnly", {}, {}, false},
};

class MlpTest : public testing::TestWithParam<Case> {
 protected:
  static constexpr int kBatch = 13;
  static constexpr int kFeatures = 21;

  MlpTest()
      : shape_(CriticShape({.encoder_layers = GetParam().encoder,
                            .head_layers = GetParam().head,
                            .layer_norm = GetParam().layer_norm},
                           kFeatures)
                   .mlp) {
    torch::manual_seed(1);
    parameters_ = torch::randn({shape_.num_parameters()}, torch::kDouble) * 0.3;
    input_ = torch::randn({kBatch, kFeatures + 2}, torch::kDouble);
    output_gradient_ = torch::randn({kBatch, 1}, torch::kDouble);
  }

  /// The same network from LibTorch's differentiable operations.
  at::Tensor Reference(const at::Tensor& parameters, const at::Tensor& input) const {
    at::Tensor x = input.narrow(1, 0, kFeatures);
    std::vector<at::Tensor> parts;
    for (const ParameterSlot& slot : shape_.Slots()) {
      parts.push_back(parameters.narrow(0, slot.offset, slot.size()).view(slot.shape));
    }
    std::size_t next = 0;
    for (int i = 0; i < shape_.num_layers(); ++i) {
      if (i == shape_.extra_layer) x = torch::cat({x, input.narrow(1, kFeatures, 2)}, 1);
      x = torch::linear(x, parts[next], parts[next + 1]);
      next += 2;
      if (i + 1 == shape_.num_layers()) break;
      if (shape_.layer_norm) {
        x = torch::layer_norm(x, {x.size(1)}, parts[next], parts[next + 1]);
        next += 2;
      }
      x = torch::relu(x);
    }
    return x;
  }

  /// What the network computes in one type, and what LibTorch computes in float64.
  void Check(at::ScalarType type, double tolerance) {
    const at::Tensor wanted_parameters = parameters_.clone().requires_grad_();
    const at::Tensor wanted_input = input_.clone().requires_grad_();
    const at::Tensor wanted = Reference(wanted_parameters, wanted_input);
    wanted.backward(output_gradient_);

    at::Tensor parameters = parameters_.to(type);
    at::Tensor gradient = torch::full_like(parameters, 1e3);
    const Mlp network(shape_, parameters);
    Mlp network_gradient(shape_, gradient);
    MlpPass pass(shape_, input_.to(type));
    const auto difference = [](const at::Tensor& a, const at::Tensor& b) {
      return (a.to(torch::kDouble) - b).abs().max().item<double>();
    };
    network.Forward(pass);
    EXPECT_LE(difference(pass.output(), wanted.detach()), tolerance);
    pass.output_gradient().copy_(output_gradient_);
    network.ParameterGradient(pass, network_gradient);
    EXPECT_LE(difference(gradient, wanted_parameters.grad()), tolerance);
    pass.output_gradient().copy_(output_gradient_);
    network.Forward(pass);
    network.ExtraGradient(pass);
    EXPECT_LE(difference(pass.extra_gradient(), wanted_input.grad().narrow(1, kFeatures, 2)),
              tolerance);
  }

  MlpShape shape_;
  at::Tensor parameters_, input_, output_gradient_;
};

// Sums of at most 35 products through five layers and back, values below about 30 (seen): in
// float64 errors stay near 10 * 35 * 30 * 2^-53 = 1e-12.
TEST_P(MlpTest, IsAutogradInDoublePrecision) { Check(torch::kDouble, 1e-11); }

// The same arithmetic with 2^-24 gives 6e-4. A ReLU at the very edge would differ by more; none is
// here.
TEST_P(MlpTest, FusedKernelsAreAutogradToTheirPrecision) { Check(torch::kFloat, 6e-4); }

TEST_P(MlpTest, ParameterGradientIsThatOfFiniteDifferences) {
  at::Tensor parameters = parameters_.clone();
  at::Tensor gradient = torch::zeros_like(parameters);
  const Mlp network(shape_, parameters);
  Mlp network_gradient(shape_, gradient);
  MlpPass pass(shape_, input_);
  const auto loss = [&] {
    network.Forward(pass);
    return (pass.output() * output_gradient_).sum().item<double>();
  };
  loss();
  pass.output_gradient().copy_(output_gradient_);
  network.ParameterGradient(pass, network_gradient);
  constexpr double kStep = 1e-6;
  for (std::int64_t i = 0; i < parameters.numel(); i += 37) {
    double* const value = parameters.data_ptr<double>() + i;
    const double before = *value;
    *value = before + kStep;
    const double above = loss();
    *value = before - kStep;
    const double below = loss();
    *value = before;
    // Rounding 100 * 2^-53 / kStep = 1e-8; curvature of LayerNorm kStep^2 * 1e3.
    EXPECT_NEAR(gradient[i].item<double>(), (above - below) / (2 * kStep), 1e-6)
        << "parameter " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, MlpTest, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace slalom::nn
