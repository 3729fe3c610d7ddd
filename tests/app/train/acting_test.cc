#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "base/config.h"
#include "policy/nn/inference/inference_network.h"
#include "policy/nn/kernels/small_gemm.h"
#include "policy/nn/network.h"
#include "tests/app/train/presets.h"

/// Whether what drives robots computes what was trained, for the network of every preset.

namespace slalom::train {
namespace {

/// The actor of each preset that trains, by its parameters' names and shapes: each once.
std::vector<nn::NetworkShape> ShippedActors() {
  std::vector<nn::NetworkShape> shapes;
  std::set<std::string> seen;
  for (const std::filesystem::path& preset : test::TrainingPresets()) {
    const RunConfig config =
        config::Load<RunConfig>(preset, std::vector<std::string>{"learner.device=cpu"});
    const nn::NetworkShape shape = MakePolicySpec(config).actor_shape();
    std::string key;
    for (const nn::ParameterSlot& slot : shape.Slots()) {
      key += slot.name;
      for (const std::int64_t n : slot.shape) key += " " + std::to_string(n);
    }
    if (seen.insert(key).second) shapes.push_back(shape);
  }
  return shapes;
}

/// The most inputs of a layer.
std::int64_t Depth(const nn::NetworkShape& shape) {
  std::int64_t depth = 0;
  for (const nn::ParameterSlot& slot : shape.Slots()) {
    depth = std::max(depth, slot.size() / slot.shape.front());
  }
  return depth;
}

TEST(Acting, IsTheTrainedNetworkBitForBitWhereTrainingUsesTheSameProducts) {
  const std::vector<nn::NetworkShape> actors = ShippedActors();
  EXPECT_GE(actors.size(), 18u);  // Two sizes of nine networks and frames.
  int num_same = 0;
  for (const nn::NetworkShape& shape : actors) {
    const std::string name = std::string(base::EnumName(shape.config.encoder)) + " over " +
                             std::to_string(shape.config.history) + " frames, depth " +
                             std::to_string(Depth(shape));
    std::vector<float> parameters(shape.num_parameters());
    base::Random random(1);
    nn::InitialiseParameters(shape, random, parameters);
    const nn::Network network(shape, nn::ViewWeights(parameters));
    nn::InferenceNetwork inference(shape);
    inference.SetWeights(parameters);
    for (const int batch : {1, 7, 64}) {
      inference.Resize(batch);
      for (float& value : inference.input()) value = static_cast<float>(random.Uniform(-1.0, 1.0));
      const at::Tensor input =
          at::from_blob(inference.input().data(), {batch, shape.num_inputs()}, at::kFloat);
      nn::NetworkPass pass(shape, input, nn::PassUse::kInference);
      network.Forward(pass);
      inference.Forward();
      const std::span<const float> expected(pass.output().data_ptr<float>(),
                                            inference.output().size());
      if (nn::DetectCpuFeatures().avx2_fma && Depth(shape) <= nn::kMaxSmallDepth) {
        EXPECT_TRUE(std::ranges::equal(inference.output(), expected)) << name << ", " << batch;
        ++num_same;
        continue;
      }
      // The BLAS adds in another order: sums of up to 5,800 products of a number below 1 with
      // weights below 1 / sqrt(5,800), whose roundings mostly cancel: 1.5e-7 was seen.
      for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_NEAR(inference.output()[i], expected[i], 1e-6) << name << ", " << batch;
      }
    }
  }
  if (nn::DetectCpuFeatures().avx2_fma) EXPECT_GE(num_same, 9 * 3);
}

}  // namespace
}  // namespace slalom::train
