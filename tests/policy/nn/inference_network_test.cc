#include "policy/nn/inference/inference_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>

#include "base/file.h"
#include "tests/policy/nn/network_cases.h"
#include "tests/support/allocation_count.h"

/// What acts without LibTorch. No test here needs LibTorch either, so that all run on processors
/// that have none of it, under an emulator or on a robot.

namespace slalom::nn {
namespace {

constexpr int kBatch = 3;

std::vector<float> Spread(std::int64_t count, double scale, std::uint32_t stream) {
  const std::vector<double> numbers = SpreadNumbers(count, scale, stream);
  return {numbers.begin(), numbers.end()};
}

std::vector<Case> AllCases() {
  std::vector<Case> cases = Cases();
  cases.push_back({"Mlp", Make(EncoderFamily::kMlp, {9, 7}, 2)});
  cases.push_back({"MlpWithoutEncoderLayers", Make(EncoderFamily::kMlp, {}, 1)});
  NetworkConfig norm = Make(EncoderFamily::kMlp, {40, 20}, 1);
  norm.layer_norm = true;
  cases.push_back({"MlpWithLayerNorm", norm});
  // Wider than one panel and than several, and deeper than a product that training leaves to the
  // BLAS.
  cases.push_back({"WideMlp", Make(EncoderFamily::kMlp, {300, 150}, 1)});
  cases.push_back({"DeepMlp", Make(EncoderFamily::kMlp, {1100, 70}, 1)});
  return cases;
}

/// The instruction sets that this processor has.
std::map<std::string, CpuFeatures> InstructionSets() {
  const CpuFeatures here = DetectCpuFeatures();
  std::map<std::string, CpuFeatures> sets = {{"portable", {}}};
  if (here.avx2_fma) sets["AVX2"] = {.avx2_fma = true};
  if (here.avx2_fma && here.avx512) sets["AVX-512"] = here;
  return sets;
}

class InferenceNetworkTest : public testing::TestWithParam<Case> {
 protected:
  InferenceNetworkTest()
      : shape_(CriticShape(GetParam().config, kFrame, 3)),
        parameters_(Spread(shape_.num_parameters(), 0.6, 1)) {}

  /// Outputs of the first `batch` rows of input.
  std::vector<float> Run(InferenceNetwork& network, int batch) const {
    network.Resize(batch);
    const std::vector<float> input =
        Spread(static_cast<std::int64_t>(network.input().size()), 1.0, 2);
    std::ranges::copy(input, network.input().begin());
    network.Forward();
    return {network.output().begin(), network.output().end()};
  }

  std::vector<float> Run(const CpuFeatures& cpu, int batch) const {
    InferenceNetwork network(shape_, cpu);
    network.SetWeights(parameters_);
    return Run(network, batch);
  }

  NetworkShape shape_;
  std::vector<float> parameters_;
};

// Sums of at most 60 products of numbers below 1 through ten operations: 60 * 10 * 2^-24 = 4e-5.
TEST(InferenceNetworkGolden, IsPyTorchsToItsPrecision) {
  int num_cases = 0;
  for (const Golden& golden : ReadGolden()) {
    SCOPED_TRACE(golden.name);
    const auto found = std::ranges::find(Cases(), golden.name, &Case::name);
    ASSERT_NE(found, Cases().end());
    const NetworkShape shape = CriticShape(found->config, kFrame, 3);
    for (const auto& [name, cpu] : InstructionSets()) {
      SCOPED_TRACE(name);
      InferenceNetwork network(shape, cpu);
      network.SetWeights(Spread(shape.num_parameters(), 0.6, 1));
      network.Resize(kBatch);
      std::ranges::copy(Spread(std::ssize(network.input()), 1.0, 2), network.input().begin());
      network.Forward();
      ASSERT_EQ(golden.output.size(), network.output().size());
      for (std::size_t i = 0; i < golden.output.size(); ++i) {
        EXPECT_NEAR(network.output()[i], golden.output[i], 5e-5);
      }
    }
    ++num_cases;
  }
  EXPECT_EQ(num_cases, 8);
}

TEST_P(InferenceNetworkTest, HasTheSameBitsWithEveryInstructionSet) {
  for (const int batch : {1, 2, 7, 33}) {
    const std::vector<float> expected = Run(CpuFeatures{}, batch);
    for (const auto& [name, cpu] : InstructionSets()) {
      EXPECT_EQ(Run(cpu, batch), expected) << name << ", batch " << batch;
    }
  }
}

TEST_P(InferenceNetworkTest, HasTheSameBitsInEveryBatch) {
  const std::vector<float> all = Run(DetectCpuFeatures(), 64);
  for (const int batch : {1, 2, 3, 7, 40}) {
    const std::vector<float> some = Run(DetectCpuFeatures(), batch);
    EXPECT_TRUE(std::equal(some.begin(), some.end(), all.begin())) << batch;
  }
}

TEST_P(InferenceNetworkTest, AllocatesNothingForAPassOrNewWeights) {
  InferenceNetwork network(shape_);
  network.Resize(kBatch);
  base::Random dropout(1);
  const long before = test::NumAllocations();
  network.SetWeights(parameters_);
  for (int i = 0; i < 5; ++i) network.Forward(&dropout);
  EXPECT_EQ(test::NumAllocations() - before, 0);
}

TEST_P(InferenceNetworkTest, TakesNewWeightsAndBatchesAsIfNew) {
  InferenceNetwork network(shape_);
  network.SetWeights(Spread(shape_.num_parameters(), 0.3, 7));
  Run(network, 9);
  network.SetWeights(parameters_);
  EXPECT_EQ(Run(network, kBatch), Run(DetectCpuFeatures(), kBatch));
}

// Recorded on x86-64: whatever else runs this test, an emulated ARM for one, must agree bit for
// bit.
TEST(InferenceNetworkBits, AreTheSameOnEveryProcessor) {
  std::vector<float> all;
  for (const Case& c : AllCases()) {
    const NetworkShape shape = CriticShape(c.config, kFrame, 3);
    InferenceNetwork network(shape);
    network.SetWeights(Spread(shape.num_parameters(), 0.6, 1));
    network.Resize(kBatch);
    std::ranges::copy(Spread(std::ssize(network.input()), 1.0, 2), network.input().begin());
    network.Forward();
    all.insert(all.end(), network.output().begin(), network.output().end());
  }
  EXPECT_EQ(base::Checksum(std::as_bytes(std::span(all))), 10985729536615080230u);
}

INSTANTIATE_TEST_SUITE_P(Networks, InferenceNetworkTest, testing::ValuesIn(AllCases()),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace slalom::nn
