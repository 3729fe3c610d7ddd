#include "policy/nn/autograd_networks.h"

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <string>
#include <vector>

#include "base/error.h"
#include "learner/adam.h"
#include "policy/nn/network.h"
#include "tests/learner/every_encoder.h"
#include "tests/learner/reference_network.h"

/// Networks as functions beside LibTorch's own operations, through which autograd goes by itself.

namespace slalom::learner {
namespace {

using at::Tensor;

constexpr int kBatch = 6;
constexpr int kFrame = 16;
constexpr int kNumNetworks = 3;

Tensor RandomParameters(const nn::NetworkShape& shape, int num_networks, at::ScalarType type) {
  base::Random random(1);
  std::vector<float> parameters(static_cast<std::size_t>(num_networks * shape.num_parameters()));
  for (int k = 0; k < num_networks; ++k) {
    nn::InitialiseParameters(
        shape, random,
        std::span(parameters).subspan(k * shape.num_parameters(), shape.num_parameters()));
  }
  return torch::tensor(parameters).to(type);
}

/// Some networks and what they read.
struct Scene {
  explicit Scene(const nn::NetworkConfig& config, at::ScalarType type = torch::kFloat,
                 int num_outputs = 2, base::Random* dropout = nullptr)
      : shape(nn::CriticShape(config, kFrame, num_outputs)),
        parameters(RandomParameters(shape, kNumNetworks, type)),
        networks(shape, parameters, dropout) {
    torch::manual_seed(3);
    features = torch::rand({kBatch, shape.num_inputs()}, type) * 2 - 1;
    extra = torch::rand({kBatch, 2}, type) * 2 - 1;
  }

  /// What `networks` computes by LibTorch's operations in float64.
  Tensor Reference(const Tensor& all, const Tensor& action) const {
    std::vector<Tensor> outputs;
    for (const Tensor& one : all.view({kNumNetworks, -1}).unbind(0)) {
      outputs.push_back(ReferenceForward(shape, one, features.to(torch::kDouble), action));
    }
    return torch::stack(outputs, 1);
  }

  nn::NetworkShape shape;
  Tensor parameters;
  nn::AutogradNetworks networks;
  Tensor features, extra;
};

/// A loss in which every output counts, and counts otherwise.
Tensor Loss(const Tensor& outputs) {
  const Tensor weight = torch::arange(1, 1 + outputs.numel(), outputs.options()).view_as(outputs);
  return (weight.sin() * outputs.square() + weight.cos() * outputs).mean();
}

double RelativeError(const Tensor& found, const Tensor& expected) {
  return ((found.to(torch::kDouble) - expected).norm() / expected.norm()).item<double>();
}

class AutogradNetworksTest : public testing::TestWithParam<EncoderCase> {};

void CompareWithReference(const nn::NetworkConfig& config, at::ScalarType type, double tolerance) {
  const Scene scene(config, type);
  const Tensor action = scene.extra.clone().requires_grad_();
  const Tensor outputs = scene.networks(scene.features, action);
  EXPECT_EQ(outputs.sizes(), at::IntArrayRef({kBatch, kNumNetworks, 2}));
  const auto gradients =
      torch::autograd::grad({Loss(outputs)}, {scene.networks.parameters(), action});

  const Tensor all = scene.parameters.to(torch::kDouble).clone().requires_grad_();
  const Tensor reference_action = scene.extra.to(torch::kDouble).clone().requires_grad_();
  const Tensor reference = scene.Reference(all, reference_action);
  const auto expected = torch::autograd::grad({Loss(reference)}, {all, reference_action});
  EXPECT_LE(RelativeError(outputs.detach(), reference.detach()), tolerance);
  EXPECT_LE(RelativeError(gradients[0], expected[0]), tolerance);
  EXPECT_LE(RelativeError(gradients[1], expected[1]), tolerance);
}

// A number passes through some ten sums of up to a hundred products each, whose roundings, of
// 2^-24 = 6e-8 or 2^-53 = 1e-16, grow by the root of their number: some 30 of them.
TEST_P(AutogradNetworksTest, KernelsHaveLibTorchsGradients) {
  CompareWithReference(GetParam().network, torch::kFloat, 2e-6);
}
// Float64 is served by the operations that serve a GPU. LayerNorm's epsilon is a float32, 2.5e-13
// from LibTorch's beside variances of a tenth.
TEST_P(AutogradNetworksTest, OperationsHaveLibTorchsGradients) {
  CompareWithReference(GetParam().network, torch::kDouble, 1e-11);
}

INSTANTIATE_TEST_SUITE_P(Encoders, AutogradNetworksTest, testing::ValuesIn(EveryEncoder()),
                         [](const auto& test) { return test.param.name; });

nn::NetworkConfig SmallConfig() { return EveryEncoder().front().network; }

TEST(AutogradNetworks, SeveralCallsAndLossesInOneGraph) {
  const Scene scene(SmallConfig(), torch::kDouble);
  Tensor features = scene.features.clone();
  const Tensor first = scene.networks(features, scene.extra);
  features.zero_();  // What the first call read is kept.
  const Tensor second = scene.networks(features, scene.extra);
  Tensor gradient = torch::zeros_like(scene.parameters);
  scene.networks.Differentiate(Loss(first) + 3.0 * Loss(second), gradient);

  const Tensor all = scene.parameters.clone().requires_grad_();
  Scene zero(SmallConfig(), torch::kDouble);
  zero.features.zero_();
  const Tensor loss =
      Loss(scene.Reference(all, scene.extra)) + 3.0 * Loss(zero.Reference(all, scene.extra));
  EXPECT_LE(RelativeError(gradient, torch::autograd::grad({loss}, {all})[0]), 1e-13);
  EXPECT_FALSE(scene.networks.parameters().grad().defined());
}

TEST(AutogradNetworks, CallsGoOnWithMemoryThatGraphsGaveBack) {
  const Scene scene(SmallConfig());
  Tensor before;
  for (int i = 0; i < 3; ++i) {
    Tensor gradient = torch::zeros_like(scene.parameters);
    const Tensor dropped = scene.networks(scene.features * 2, scene.extra);
    scene.networks.Differentiate(Loss(scene.networks(scene.features, scene.extra)), gradient);
    EXPECT_TRUE(i == 0 || torch::equal(gradient, before));
    before = gradient;
  }
}

TEST(AutogradNetworks, RecordNothingWithoutGradMode) {
  const Scene scene(SmallConfig());
  const Tensor recorded = scene.networks(scene.features, scene.extra);
  const torch::NoGradGuard no_grad;
  const Tensor outputs = scene.networks(scene.features, scene.extra);
  EXPECT_TRUE(recorded.requires_grad());
  EXPECT_FALSE(outputs.requires_grad());
  EXPECT_TRUE(torch::equal(outputs, recorded));
}

// What `Network` itself does with masks is tested in tests/policy/nn/network_test.cc.
TEST(AutogradNetworks, DropoutHasTheGradientsOfNetworksThatDrawTheSameMasks) {
  nn::NetworkConfig config = EveryEncoder().back().network;
  config.dropout = 0.3;
  base::Random masks(5), same_masks(5);
  const Scene scene(config, torch::kFloat, 2, &masks);
  const Tensor action = scene.extra.clone().requires_grad_();
  const Tensor outputs = scene.networks(scene.features, action);
  const auto gradients =
      torch::autograd::grad({Loss(outputs)}, {scene.networks.parameters(), action});

  const Tensor leaf = outputs.detach().requires_grad_();
  const Tensor output_gradient = torch::autograd::grad({Loss(leaf)}, {leaf}).front();
  const Tensor input = torch::cat({scene.features, scene.extra}, 1);
  const Tensor by_parameters = torch::zeros_like(scene.parameters);
  Tensor by_action = torch::zeros_like(scene.extra);
  const std::int64_t size = scene.shape.num_parameters();
  for (int k = 0; k < kNumNetworks; ++k) {
    const nn::Network network(scene.shape, scene.parameters.narrow(0, k * size, size));
    nn::Network gradient(scene.shape, by_parameters.narrow(0, k * size, size));
    nn::NetworkPass pass(scene.shape, input, nn::PassUse::kTraining, &same_masks);
    network.Forward(pass);
    EXPECT_TRUE(torch::equal(outputs.select(1, k), pass.output())) << k;
    pass.output_gradient().copy_(output_gradient.select(1, k));
    network.ExtraGradient(pass);
    by_action += pass.extra_gradient();
    network.ParameterGradient(pass, gradient);
  }
  EXPECT_TRUE(torch::equal(gradients[0], by_parameters));
  EXPECT_TRUE(torch::equal(gradients[1], by_action));
}

TEST(AutogradNetworks, DropOutInCallsThatAreNotRecordedOnlyIfEverywhere) {
  nn::NetworkConfig config = EveryEncoder().back().network;
  config.dropout = 0.3;
  for (const bool everywhere : {false, true}) {
    config.dropout_everywhere = everywhere;
    base::Random masks(5), same_masks(5);
    const Scene recorded(config, torch::kFloat, 2, &masks);
    const Scene unrecorded(config, torch::kFloat, 2, &same_masks);
    const Tensor expected = recorded.networks(recorded.features, recorded.extra).detach();
    const torch::NoGradGuard no_grad;
    const Tensor outputs = unrecorded.networks(unrecorded.features, unrecorded.extra);
    EXPECT_EQ(torch::allclose(outputs, expected), everywhere);
  }
}

/// Runs `function` and returns the text of its error.
template <class Error, class Function>
std::string ErrorOf(const Function& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(AutogradNetworks, RefuseByName) {
  const Scene scene(SmallConfig());
  const auto call = [&] { return Loss(scene.networks(scene.features, scene.extra)); };
  const std::vector<Tensor> leaf = {scene.networks.parameters()};
  EXPECT_NE(ErrorOf<base::Error>([&] {
              torch::autograd::grad({call()}, leaf, {}, /*retain_graph=*/true,
                                    /*create_graph=*/true);
            }).find("double backward (create_graph)"),
            std::string::npos);
  const Tensor loss = call();
  torch::autograd::grad({loss}, leaf, {}, /*retain_graph=*/true);
  EXPECT_NE(ErrorOf<base::Error>([&] {
              torch::autograd::grad({loss}, leaf);
            }).find("second backward through one call (retain_graph)"),
            std::string::npos);
  const Tensor features = scene.features.clone().requires_grad_();
  EXPECT_NE(ErrorOf<base::Error>([&] {
              scene.networks(features, scene.extra);
            }).find("features require a gradient"),
            std::string::npos);
  const Tensor old = call();
  Tensor parameters = scene.parameters;
  parameters.add_(1.0);
  EXPECT_NE(ErrorOf<c10::Error>([&] { torch::autograd::grad({old}, leaf); }).find("modified"),
            std::string::npos);
  const Tensor older = call();
  Tensor norm = torch::zeros({1}, torch::kDouble);
  Adam(parameters, torch::ones_like(parameters)).Step(1e-3, {}, norm);
  EXPECT_NE(ErrorOf<c10::Error>([&] { torch::autograd::grad({older}, leaf); }).find("modified"),
            std::string::npos);
}

TEST(AutogradNetworks, SayWhatIsWrongWithALoss) {
  const Scene scene(SmallConfig()), other(SmallConfig());
  Tensor gradient = torch::zeros_like(scene.parameters);
  const auto expect = [&](const Tensor& loss, const std::string& words) {
    const std::string error =
        ErrorOf<base::Error>([&] { scene.networks.Differentiate(loss, gradient); });
    EXPECT_NE(error.find(words), std::string::npos) << error;
    EXPECT_EQ(error.find("frame #0"), std::string::npos) << "LibTorch's list of addresses";
  };
  const auto call = [&](const Scene& of) { return of.networks(of.features, of.extra); };
  expect(call(scene).square(), "the loss has the shape [6, 3, 2], expected one number");
  expect(Loss(call(scene)).detach(), "does not depend on the networks");
  expect(Loss(call(other)), "does not depend on the networks");
  const Tensor loss = call(scene).square().mean();
  scene.networks.Differentiate(loss, gradient);
  expect(loss, "expected one that is differentiated once");
  const Tensor old = Loss(call(scene));
  Tensor parameters = scene.parameters;
  parameters.add_(1.0);
  expect(old, "before its weights move");
}

}  // namespace
}  // namespace slalom::learner
