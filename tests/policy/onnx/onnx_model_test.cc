#include "policy/onnx/onnx_model.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "policy/onnx/onnx.pb.h"
#include "tests/policy/nn/network_cases.h"

/// The shape of what is written; tests/app/python/onnx_test.py runs it beside our own networks.

namespace slalom::policy {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

PolicySnapshot SnapshotOf(const nn::NetworkConfig& network) {
  PolicySpec spec;
  spec.observation.num_beams = nn::kFrame - env::kStateSize;
  spec.network = network;
  PolicySnapshot snapshot = ZeroSnapshot(spec);
  const auto numbers = nn::SpreadNumbers(std::ssize(*snapshot.weights), 0.5, 1);
  snapshot.weights = std::make_shared<std::vector<float>>(numbers.begin(), numbers.end());
  return snapshot;
}

slalom::onnx::ModelProto Parse(const std::string& bytes) {
  slalom::onnx::ModelProto model;
  EXPECT_TRUE(model.ParseFromString(bytes));
  return model;
}

std::vector<std::string> NamesOf(const auto& ports) {
  std::vector<std::string> names;
  for (const auto& port : ports) names.push_back(port.name());
  return names;
}

class OnnxModelTest : public ::testing::TestWithParam<nn::Case> {};

TEST_P(OnnxModelTest, EachNodeReadsWhatIsThereAndEachTensorIsWhole) {
  const auto model = Parse(PrintOnnx(SnapshotOf(GetParam().config), {}));
  const auto& graph = model.graph();
  std::set<std::string> known;
  for (const std::string& name : NamesOf(graph.input())) EXPECT_TRUE(known.insert(name).second);
  for (const auto& tensor : graph.initializer()) {
    EXPECT_TRUE(known.insert(tensor.name()).second) << tensor.name();
    std::int64_t size = tensor.data_type() == 7 ? 8 : 4;  // int64 and float.
    for (const std::int64_t dimension : tensor.dims()) size *= dimension;
    EXPECT_EQ(size, std::ssize(tensor.raw_data())) << tensor.name();
  }
  for (const auto& node : graph.node()) {
    for (const std::string& input : node.input()) {
      EXPECT_TRUE(known.contains(input)) << node.name() << " reads " << input;
    }
    for (const std::string& output : node.output()) EXPECT_TRUE(known.insert(output).second);
  }
  for (const std::string& name : NamesOf(graph.output())) EXPECT_TRUE(known.contains(name));
}

INSTANTIATE_TEST_SUITE_P(Networks, OnnxModelTest, ::testing::ValuesIn(nn::Cases()),
                         [](const auto& tested) { return tested.param.name; });

TEST(OnnxModelTest, FramesAreInputAndOutputWhereThereIsAHistory) {
  nn::NetworkConfig network;
  network.encoder_layers = {6};
  network.head_layers = {5};
  auto model = Parse(PrintOnnx(SnapshotOf(network), {{"seed", "7"}}));
  EXPECT_THAT(NamesOf(model.graph().input()), ElementsAre("ranges", "state"));
  EXPECT_THAT(NamesOf(model.graph().output()), ElementsAre("command", "action"));
  EXPECT_EQ(model.metadata_props(0).key(), "seed");
  EXPECT_THAT(model.metadata_props(1).value(), HasSubstr("\"linear_max\":2.0"));
  network.history = 2;
  model = Parse(PrintOnnx(SnapshotOf(network), {}));
  EXPECT_THAT(NamesOf(model.graph().input()), ElementsAre("ranges", "state", "frames", "first"));
  EXPECT_THAT(NamesOf(model.graph().output()), ElementsAre("frames_after", "command", "action"));
}

// In ONNX's default the reset gate comes before the product.
TEST(OnnxModelTest, AGruResetsAfterTheProductAsOursDoes) {
  const auto network = nn::Make(nn::EncoderFamily::kGru, {6, 5}, 3);
  const auto model = Parse(PrintOnnx(SnapshotOf(network), {}));
  int num_layers = 0;
  for (const auto& node : model.graph().node()) {
    if (node.op_type() != "GRU") continue;
    ++num_layers;
    EXPECT_TRUE(std::ranges::any_of(node.attribute(), [](const auto& attribute) {
      return attribute.name() == "linear_before_reset" && attribute.i() == 1;
    }));
  }
  EXPECT_EQ(num_layers, 2);
}

TEST(OnnxModelTest, TellsTheActionOfARobotThatStands) {
  PolicySnapshot snapshot = SnapshotOf(nn::Make(nn::EncoderFamily::kMlp, {6}, 2));
  snapshot.spec.actions = {.linear_min = -0.25, .linear_max = 0.75, .angular_max = 2.0};
  const auto model = Parse(PrintOnnx(snapshot, {}));
  const auto& last = model.metadata_props(model.metadata_props_size() - 1);
  EXPECT_EQ(last.key(), "standstill");
  EXPECT_EQ(last.value(), "[-0.5, 0]");
  EXPECT_THAT(model.graph().input(1).doc_string(),
              HasSubstr("at first [-0.5, 0], which commands standing still"));
}

TEST(OnnxModelTest, RefusesAPolicyThatDropsUnitsWhenItActs) {
  nn::NetworkConfig network = nn::Dropping(nn::Make(nn::EncoderFamily::kTransformer, {8}, 2));
  network.dropout_everywhere = true;
  try {
    PrintOnnx(SnapshotOf(network), {});
    FAIL() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("network.dropout_everywhere"));
  }
}

}  // namespace
}  // namespace slalom::policy
