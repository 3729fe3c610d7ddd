#include "policy/policy.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "base/error.h"
#include "base/file.h"
#include "policy/policy_spec.h"
#include "tests/support/every_value.h"

namespace slalom::policy {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

PolicySnapshot SmallPolicy() {
  PolicySnapshot snapshot;
  snapshot.version = 7;
  snapshot.spec.observation = {{}, 12, env::kStateSize, 4.0, 3.0};
  snapshot.spec.network.encoder_layers = {5};
  snapshot.spec.network.head_layers = {4};
  snapshot.spec.network.history = 2;
  snapshot.spec.network.sectors = 3;
  snapshot.spec.network.range_transform = nn::RangeTransform::kInverse;
  snapshot.spec.actions.linear_max = 1.5;
  std::vector<float> weights(snapshot.spec.actor_shape().num_parameters());
  base::Random random(1);
  nn::InitialiseParameters(snapshot.spec.actor_shape(), random, weights);
  snapshot.weights = std::make_shared<const std::vector<float>>(std::move(weights));
  return snapshot;
}

class PolicyFileTest : public testing::Test {
 protected:
  ~PolicyFileTest() override { std::filesystem::remove(path_); }

  /// Writes the file again with another text in its spec.
  void ReplaceInSpec(const std::string& old, const std::string& replacement) const {
    const nn::TensorFile file = nn::LoadTensors(path_);
    nn::Metadata metadata = file.metadata;
    std::string& spec = metadata["slalom_policy"];
    const std::size_t place = spec.find(old);
    ASSERT_NE(place, std::string::npos) << spec;
    spec.replace(place, old.size(), replacement);
    nn::SaveTensors(path_, file.tensors, metadata);
  }

  std::string Refusal() const {
    try {
      LoadPolicy(path_);
    } catch (const base::Error& error) {
      return error.what();
    }
    return "not refused";
  }

  const std::filesystem::path path_ =
      std::filesystem::path(testing::TempDir()) /
      ("policy_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
};

TEST_F(PolicyFileTest, RoundTrips) {
  const PolicySnapshot saved = SmallPolicy();
  SavePolicy(path_, saved, {{"commit", "abc"}});
  const LoadedPolicy loaded = LoadPolicy(path_);
  EXPECT_EQ(loaded.metadata, (nn::Metadata{{"commit", "abc"}}));
  EXPECT_EQ(loaded.snapshot.version, 7);
  EXPECT_EQ(loaded.snapshot.spec.observation, saved.spec.observation);
  EXPECT_EQ(loaded.snapshot.spec.network, saved.spec.network);
  EXPECT_EQ(loaded.snapshot.spec.actions.linear_max, 1.5);
  EXPECT_EQ(*loaded.snapshot.weights, *saved.weights);
}

TEST_F(PolicyFileTest, HoldsAllThatAPolicyMayObserveAndCommand) {
  PolicySnapshot saved = SmallPolicy();
  env::ObservationSpec& observation = saved.spec.observation;
  observation.speeds = observation.mounting = observation.privileged = true;
  observation.commands = 3;
  observation.state_size = env::StateSize(observation);
  saved.spec.actions = {.linear_min = -0.25, .linear_max = 1.5, .angular_max = 2.0};
  saved.spec.distribution = {
      .kind = DistributionKind::kGaussian, .log_std_min = -4.0, .log_std_max = 1.0};
  saved.weights = ZeroSnapshot(saved.spec).weights;
  SavePolicy(path_, saved, {});
  const PolicySpec loaded = LoadPolicy(path_).snapshot.spec;
  EXPECT_EQ(loaded.observation, observation);
  EXPECT_EQ(loaded.distribution, saved.spec.distribution);
  EXPECT_EQ(loaded.actions.linear_min, -0.25);
  EXPECT_EQ(loaded.actions.linear_max, 1.5);
  EXPECT_EQ(loaded.actions.angular_max, 2.0);
}

TEST_F(PolicyFileTest, NamesTensorsForReaders) {
  SavePolicy(path_, SmallPolicy(), {});
  const nn::TensorFile file = nn::LoadTensors(path_);
  std::vector<std::string> names;
  for (const auto& [name, tensor] : file.tensors) names.push_back(name);
  EXPECT_THAT(names, testing::ElementsAre("actor.encoder.0.bias", "actor.encoder.0.weight",
                                          "actor.head.0.bias", "actor.head.0.weight",
                                          "actor.head.1.bias", "actor.head.1.weight"));
  // Two frames of three sectors and four numbers.
  EXPECT_THAT(file.tensors.at("actor.encoder.0.weight").shape, testing::ElementsAre(5, 14));
}

TEST_F(PolicyFileTest, RefusesTensorFilesThatAreNoPolicy) {
  nn::SaveTensors(path_, {}, {});
  EXPECT_THROW(LoadPolicy(path_), base::Error);
}

TEST_F(PolicyFileTest, RefusesWhatIsNestedTooDeeply) {
  // Printing a value of that depth, as errors do, would end the program.
  const std::string deep = std::string(400'000, '[') + std::string(400'000, ']');
  SavePolicy(path_, SmallPolicy(), {});
  const nn::TensorFile file = nn::LoadTensors(path_);
  nn::Metadata metadata = file.metadata;
  metadata["slalom_policy"] = "{\"version\": " + deep + "}";
  nn::SaveTensors(path_, file.tensors, metadata);
  EXPECT_THAT(Refusal(), HasSubstr("not a JSON object"));
  const std::string header = "{\"a\": " + deep + "}";
  const std::uint64_t length = header.size();
  const std::string bytes(reinterpret_cast<const char*>(&length), sizeof(length));
  base::WriteFileAtomically(path_, bytes + header);
  EXPECT_THAT(Refusal(), HasSubstr("the header is not JSON"));
}

TEST_F(PolicyFileTest, RefusesSpecsThatDoNotFitTheTensors) {
  SavePolicy(path_, SmallPolicy(), {});
  const nn::TensorFile file = nn::LoadTensors(path_);
  const auto load_with = [&](const std::string& from, const std::string& to) {
    nn::Metadata metadata = file.metadata;
    std::string& spec = metadata["slalom_policy"];
    const std::size_t at = spec.find(from);
    ASSERT_NE(at, std::string::npos) << spec;
    spec.replace(at, from.size(), to);
    nn::SaveTensors(path_, file.tensors, metadata);
    EXPECT_THROW(LoadPolicy(path_), base::Error) << to;
  };
  load_with("\"sectors\":3", "\"sectors\":4");
  load_with("\"sectors\":3", "\"sectors\":3.5");
  load_with("\"sectors\":3", "\"sectors\":1e300");
  load_with("\"encoder\":\"mlp\"", "\"encoder\":\"cnn\"");
  load_with("\"goal_transform\":\"linear\"", "\"goal_transform\":\"lnear\"");
  load_with("\"goal_transform\":\"linear\"", "\"goal_transform\":0");
  load_with("\"layer_norm\":false", "\"layer_norm\":0");
  load_with("\"goal_scale\":3.0", "\"goal_scale\":0.0");
  load_with("\"linear_max\":1.5", "\"linear_max\":1e9");
  load_with("\"version\":7", "\"version\":-7");
  load_with("\"version\":7", "\"version\":18446744073709551615");
  load_with("\"sectors\":3", "\"sectors\":5");
  load_with("\"history\":2", "\"history\":2000000000");
  load_with("\"num_beams\":12", "\"num_beams\":0");
  load_with("\"num_beams\":12", "\"num_beams\":\"many\"");
  load_with("\"state_size\":4", "\"state_size\":0");
  load_with("\"state_size\":4", "\"state_size\":5");
  load_with("\"action_size\":2", "\"action_size\":0");
  load_with("\"action_size\":2", "\"action_size\":257");
  load_with("\"action_size\":2", "\"action_size\":3");
  load_with("\"action_size\":2", "\"action_size\":\"two\"");
  load_with("\"head_layers\":[4]", "\"head_layers\":[4,4]");
  load_with("\"version\"", "\"revision\"");
}

TEST_F(PolicyFileTest, HoldsPoliciesForOtherThanCourses) {
  for (const nn::EncoderFamily encoder : {nn::EncoderFamily::kMlp, nn::EncoderFamily::kGru}) {
    PolicySnapshot saved;
    saved.spec.observation.num_beams = 0;
    saved.spec.observation.state_size = 17;
    saved.spec.action_size = 6;
    saved.spec.network.encoder = encoder;
    saved.spec.network.encoder_layers = {8};
    saved.spec.network.head_layers = {8};
    saved.spec.network.history = 2;
    const nn::NetworkShape shape = saved.spec.actor_shape();
    EXPECT_EQ(shape.num_inputs(), 2 * 17);
    EXPECT_EQ(shape.num_outputs(), 6);
    EXPECT_EQ(saved.spec.critic_shape().num_extra(), 6);
    saved.weights = std::make_shared<const std::vector<float>>(
        static_cast<std::size_t>(shape.num_parameters()), 0.5f);
    SavePolicy(path_, saved, {});
    const PolicySpec spec = LoadPolicy(path_).snapshot.spec;
    EXPECT_EQ(spec.step_shape(), env::StepShape(0, 17, 6));
    EXPECT_THROW(spec.RequireCourses("p"), base::Error);
    EXPECT_THROW(RequireSameInterface("p", spec, {}, {}), base::Error);
    EXPECT_THROW(spec.model_shape(), base::Error);
  }
}

TEST_F(PolicyFileTest, AFieldThatIsMissingIsAnErrorThatNamesIt) {
  for (const auto& [name, text] : {std::pair{"observation.state_size", ",\"state_size\":4"},
                                   {"observation.speeds", ",\"speeds\":false"},
                                   {"network.dropout", "\"dropout\":0.0,"},
                                   {"action_size", "\"action_size\":2,"}}) {
    SavePolicy(path_, SmallPolicy(), {});
    ReplaceInSpec(text, "");
    EXPECT_THAT([this] { LoadPolicy(path_); },
                ThrowsMessage<base::Error>(HasSubstr(fmt::format("spec.{} is missing", name))));
  }
}

TEST_F(PolicyFileTest, HoldsWhatIsObservedBesides) {
  PolicySnapshot saved = SmallPolicy();
  saved.spec.observation.speeds = true;
  saved.spec.observation.mounting = true;
  saved.spec.observation.commands = 4;
  saved.spec.observation.privileged = true;
  saved.spec.observation.state_size = env::StateSize(saved.spec.observation);
  saved.spec.network.goal_transform = nn::GoalTransform::kBounded;
  saved.weights = std::make_shared<const std::vector<float>>(
      static_cast<std::size_t>(saved.spec.actor_shape().num_parameters()), 0.5f);
  SavePolicy(path_, saved, {});
  const PolicySpec spec = LoadPolicy(path_).snapshot.spec;
  EXPECT_EQ(spec.observation, saved.spec.observation);
  EXPECT_EQ(spec.network, saved.spec.network);
  EXPECT_EQ(spec.step_shape(), env::StepShape(12, 14 + env::kPrivilegedSize));
  EXPECT_NO_THROW(spec.RequireCourses("p"));
  // As many numbers, with another meaning.
  env::ObservationSpec other = spec.observation;
  other.speeds = false;
  other.mounting = false;
  other.commands = 6;
  ASSERT_EQ(env::StateSize(other), other.state_size);
  try {
    RequireSameInterface("p", spec, other, spec.actions);
    ADD_FAILURE();
  } catch (const base::Error& error) {
    EXPECT_THAT(
        error.what(),
        AllOf(HasSubstr("with speeds, with mounting, with earlier action x 3, with true speeds, "
                        "with nearest obstacle x 5, with drive, the simulator gives"),
              HasSubstr("with earlier action x 5")));
  }
}

TEST(PolicySpecTest, RefusesScansBesideAStateOfNoCourse) {
  PolicySpec spec;
  spec.observation.state_size = 5;
  EXPECT_THROW(spec.actor_shape(), base::Error);
  spec.observation.num_beams = 0;
  spec.network.encoder = nn::EncoderFamily::kCnn;
  spec.network.cnn_axis = nn::CnnAxis::kBeams;
  EXPECT_THROW(spec.actor_shape(), base::Error);
}

TEST_F(PolicyFileTest, HoldsEveryEncoder) {
  for (const nn::EncoderFamily encoder : test::EveryValue<nn::EncoderFamily>()) {
    PolicySnapshot saved = SmallPolicy();
    saved.spec.network.encoder = encoder;
    saved.spec.network.encoder_layers = {6, 6};
    saved.spec.network.attention_heads = 2;
    saved.weights = std::make_shared<const std::vector<float>>(
        static_cast<std::size_t>(saved.spec.actor_shape().num_parameters()), 0.5f);
    SavePolicy(path_, saved, {});
    EXPECT_EQ(LoadPolicy(path_).snapshot.spec.network, saved.spec.network);
  }
}

TEST_F(PolicyFileTest, RefusesNetworksThatAreNone) {
  PolicySnapshot saved = SmallPolicy();
  saved.spec.network.encoder = nn::EncoderFamily::kTransformer;
  saved.spec.network.encoder_layers = {6, 6};
  saved.spec.network.attention_heads = 2;
  saved.weights = std::make_shared<const std::vector<float>>(
      static_cast<std::size_t>(saved.spec.actor_shape().num_parameters()), 0.5f);
  SavePolicy(path_, saved, {});
  ReplaceInSpec("\"attention_heads\":2", "\"attention_heads\":4");
  EXPECT_EQ(Refusal(), path_.string() +
                           ": in its spec, network.attention_heads: found 4, expected a divisor of "
                           "the width 6");
}

TEST_F(PolicyFileTest, RefusesSectorsThatDoNotDivideTheBeams) {
  SavePolicy(path_, SmallPolicy(), {});
  ReplaceInSpec("\"sectors\":3", "\"sectors\":5");
  EXPECT_EQ(Refusal(),
            path_.string() +
                ": in its spec, network.sectors: found 5, expected 0 or a divisor of the "
                "12 beams of a scan");
}

TEST_F(PolicyFileTest, AKnownSuccessNeedsARadius) {
  PolicySpec spec = SmallPolicy().spec;
  spec.planning.model.kind = nn::ModelKind::kDeterministic;
  spec.planning.model.success = nn::ModelSuccess::kKnown;
  spec.planning.goal = {.radius = 0.5, .reward = 4.0};
  PolicySnapshot snapshot = ZeroSnapshot(spec);
  snapshot.version = 1;
  SavePolicy(path_, snapshot, {});
  EXPECT_EQ(LoadPolicy(path_).snapshot.spec.planning, spec.planning);
  ReplaceInSpec("\"goal_radius\":0.5", "\"goal_radius\":0.0");
  EXPECT_THROW(LoadPolicy(path_), base::Error);
}

TEST(PolicyBytesTest, AreThoseOfTheFile) {
  const PolicySnapshot policy = SmallPolicy();
  const std::string bytes = PrintPolicy(policy, {{"commit", "abc"}});
  const LoadedPolicy parsed = ParsePolicy(std::as_bytes(std::span(bytes)), "a message");
  EXPECT_EQ(*parsed.snapshot.weights, *policy.weights);
  EXPECT_EQ(parsed.metadata, (nn::Metadata{{"commit", "abc"}}));
  // Also where they do not begin on a multiple of anything.
  std::string shifted(1, 'x');
  shifted += bytes;
  EXPECT_NO_THROW(ParsePolicy(std::as_bytes(std::span(shifted)).subspan(1), "a message"));
}

TEST(PolicyBytesTest, NumbersThatAreNotFiniteAreRefused) {
  for (const float bad : {std::nanf(""), INFINITY, -INFINITY}) {
    PolicySnapshot policy = SmallPolicy();
    std::vector<float> weights = *policy.weights;
    weights.back() = bad;
    policy.weights = std::make_shared<const std::vector<float>>(weights);
    const std::string bytes = PrintPolicy(policy, {});
    try {
      ParsePolicy(std::as_bytes(std::span(bytes)), "snapshot 3");
      ADD_FAILURE() << "was not refused";
    } catch (const base::Error& error) {
      EXPECT_THAT(error.what(), testing::StartsWith("snapshot 3: tensor 'actor.head.1.bias'"));
    }
  }
}

TEST(RequireSameInterface, NamesWhatDiffers) {
  const PolicySpec spec;
  EXPECT_NO_THROW(RequireSameInterface("p", spec, {}, {}));
  EXPECT_THROW(RequireSameInterface("p", spec, {{}, 360}, {}), base::Error);
  EXPECT_THROW(RequireSameInterface("p", spec, {}, {.linear_min = -0.5}), base::Error);
  EXPECT_THROW(RequireSameInterface("p", spec, {}, {.linear_max = 1.0}), base::Error);
  EXPECT_THROW(RequireSameInterface("p", spec, {}, {.angular_max = 1.0}), base::Error);
}

TEST(RequireSameSpec, NamesTheFirstFieldThatDiffers) {
  PolicySpec expected;
  expected.planning.model.kind = nn::ModelKind::kProbabilistic;
  const auto refusal = [&](const PolicySpec& spec) -> std::string {
    try {
      RequireSameSpec("p", spec, expected);
    } catch (const base::Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal(expected), "");
  EXPECT_EQ(refusal({}), "p: carries no transition model, expected one");
  PolicySpec spec = expected;
  spec.network.history = 4;
  EXPECT_EQ(refusal(spec), "p: its network.history is 4, expected 1");
  spec = expected;
  spec.observation.num_beams = 360;
  EXPECT_EQ(refusal(spec), "p: its observation.num_beams is 360, expected 720");
  spec = expected;
  spec.actions.linear_max = 1.0;
  EXPECT_EQ(refusal(spec), "p: its actions.linear_max is 1.0, expected 2.0");
  spec = expected;
  spec.distribution.kind = DistributionKind::kGaussian;
  EXPECT_EQ(refusal(spec), "p: its distribution.kind is \"gaussian\", expected \"deterministic\"");
  spec = expected;
  spec.planning.model.ensemble = 3;
  EXPECT_EQ(refusal(spec), "p: its planning.ensemble is 3, expected 1");
}

}  // namespace
}  // namespace slalom::policy
