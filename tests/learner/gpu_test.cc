#include <fmt/format.h>
#include <gtest/gtest.h>
#include <torch/cuda.h>

#include <cmath>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "learner/algorithm.h"
#include "learner/learner.h"
#include "tests/learner/every_algorithm.h"
#include "tests/learner/every_encoder.h"
#include "tests/learner/random_rows.h"

/// Updates on a GPU, beside the same updates on the CPU.

namespace slalom::learner {
namespace {

constexpr int kBeams = 24;

class GpuTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!torch::cuda::is_available()) GTEST_SKIP() << "LibTorch finds no GPU here";
  }

  /// Small steps, so that the gradients of the second update are of nearly the same weights.
  static MethodConfig Method() {
    MethodConfig method;
    method.learner.batch_size = 32;
    method.learner.actor_learning_rate = 1e-6;
    method.learner.critic_learning_rate = 1e-6;
    method.learner.mirror = true;
    method.learner.average_rate = 0.01;
    return method;
  }

  /// Compares the gradients of two updates, which Adam's first moments hold, and the weights.
  static void ExpectTheSameOnBoth(MethodConfig method, const nn::NetworkConfig& network,
                                  const std::string& name) {
    policy::PolicySpec spec;
    spec.observation.num_beams = kBeams;
    spec.network = network;
    spec.distribution = DistributionOf(method.learner);
    spec.planning = PlanningOf(method);
    const auto train = [&](DeviceChoice device, std::string_view expected) {
      method.learner.device = device;
      Learner learner(method, spec, 5);
      EXPECT_EQ(learner.device(), expected);
      for (int i = 0; i < 2; ++i) {
        const RandomBatches drawn(learner.sample_specs(), kBeams, 100 + i, 1000 * i);
        learner.Update(drawn.batches, 0.0);
      }
      EXPECT_TRUE(learner.healthy());
      nn::TensorFile file;
      file.source = name;
      learner.SaveState(file.tensors);
      return file;
    };
    const nn::TensorFile host = train(DeviceChoice::kCpu, "cpu");
    const nn::TensorFile gpu = train(DeviceChoice::kCuda, "cuda");
    int num_gradients = 0;
    for (const auto& [key, tensor] : host.tensors) {
      const bool gradient = key.ends_with("first_moment");
      if (!gradient && !key.ends_with("parameters")) continue;
      std::vector<float> expected(tensor.bytes.size() / sizeof(float)), found(expected.size());
      host.Read(key, std::span(expected));
      gpu.Read(key, std::span(found));
      double difference = 0.0, size = 0.0;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        difference += std::pow(found[i] - expected[i], 2);
        size += std::pow(expected[i], 2);
      }
      EXPECT_GT(size, 0.0) << name << ", " << key;
      EXPECT_LE(std::sqrt(difference / size), 1e-3) << name << ", " << key;
      num_gradients += gradient;
    }
    EXPECT_GE(num_gradients, 2) << name;
  }
};

TEST_F(GpuTest, EveryAlgorithmLearnsAsOnTheCpu) {
  for (const char* algorithm : EveryAlgorithm()) {
    MethodConfig method = Method();
    method.learner.algorithm = algorithm;
    nn::NetworkConfig network;
    network.encoder_layers = {16};
    network.head_layers = {16};
    network.sectors = 12;
    network.layer_norm = true;
    ExpectTheSameOnBoth(method, network, algorithm);
  }
}

TEST_F(GpuTest, EveryEncoderLearnsAsOnTheCpu) {
  for (const EncoderCase& encoder : EveryEncoder()) {
    ExpectTheSameOnBoth(Method(), encoder.network, encoder.name);
  }
}

TEST_F(GpuTest, ConstraintsAndModelsLearnAsOnTheCpu) {
  nn::NetworkConfig network;
  network.encoder_layers = {16};
  network.head_layers = {16};
  MethodConfig constrained = Method();
  constrained.constraint.kind = ConstraintKind::kFixed;
  constrained.constraint.multiplier = 2.0;
  ExpectTheSameOnBoth(constrained, network, "constraint");
  for (const nn::ModelKind kind : {nn::ModelKind::kDeterministic, nn::ModelKind::kProbabilistic}) {
    MethodConfig method = Method();
    method.model.kind = kind;
    method.model.encoder_layers = {16};
    method.model.head_layers = {16};
    method.model_training.batch_size = 32;
    method.model_training.learning_rate = 1e-6;
    ExpectTheSameOnBoth(method, network, fmt::format("{} model", base::EnumName(kind)));
  }
}

}  // namespace
}  // namespace slalom::learner
