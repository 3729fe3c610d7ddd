#include "app/train/run_config.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "app/train/agent_run_config.h"
#include "app/train/resolved_run.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "tests/support/error_of.h"
#include "tests/support/log_lines.h"

namespace slalom::train {
namespace {

TEST(SpecHashTest, KeysAtTheirDefaultsAreNoPartOfIt) {
  const RunConfig config;
  const std::uint64_t algorithm = base::Checksum(config.method.learner.algorithm);
  EXPECT_EQ(SpecHash(config), base::Checksum("", base::Checksum("", algorithm)));
}

TEST(SpecHashTest, WhatIsSeenCommandedOrLearnedChangesIt) {
  std::set<std::uint64_t> hashes{SpecHash({})};
  const auto add = [&](auto change) {
    RunConfig config;
    change(config);
    EXPECT_TRUE(hashes.insert(SpecHash(config)).second);
  };
  add([](RunConfig& c) { c.environment.lidar.num_beams = 360; });
  add([](RunConfig& c) { c.environment.lidar.num_beams = 361; });
  add([](RunConfig& c) { c.environment.robot.control_rate = 10.0; });
  add([](RunConfig& c) { c.network.sectors = 7; });
  add([](RunConfig& c) { c.method.learner.algorithm = "sac"; });
  RunConfig other;
  other.run.seed = 99;
  other.replay.capacity = 17;
  EXPECT_EQ(SpecHash(other), SpecHash({}));
}

AgentRunConfig ResolveAgent(const std::vector<std::string>& overrides) {
  return ResolveAgentRun([&](AgentRunConfig& config) {
    for (const std::string& each : overrides) {
      config::ApplyOverride(each, config::ListFields(config));
    }
  });
}

TEST(RunConfigTest, ReplayServersAreOneAddressOrAListOfDifferentOnes) {
  const auto resolve = [](const std::string& servers, const std::string& more = "run.seed=1") {
    RunConfig config;
    config::ApplyOverride("service.replay=" + servers, config::ListFields(config));
    config::ApplyOverride(more, config::ListFields(config));
    return Resolve(config, {.serves = true}).service.replay;
  };
  using testing::ElementsAre;
  EXPECT_THAT(resolve("tcp://a:1"), ElementsAre("tcp://a:1"));
  EXPECT_THAT(resolve("\"tcp://a:1\""), ElementsAre("tcp://a:1"));
  EXPECT_THAT(resolve("[\"tcp://a:1\", \"tcp://b:1\"]"), ElementsAre("tcp://a:1", "tcp://b:1"));
  const auto error = [&](const std::string& servers, const std::string& more = "run.seed=1") {
    return test::ErrorOf([&] { resolve(servers, more); });
  };
  EXPECT_THAT(error("[]"), testing::HasSubstr("service.replay lists 0 addresses"));
  EXPECT_THAT(error("[\"tcp://a:1\", \"tcp://b:1\", \"tcp://a:1\"]"),
              testing::HasSubstr("service.replay lists tcp://a:1 twice"));
  EXPECT_EQ(error("tcp://a:1", "replay.capacity=1000"), "");
  EXPECT_THAT(error("[\"tcp://a:1\", \"tcp://b:1\"]", "replay.capacity=100"),
              testing::HasSubstr("replay.capacity is 100, expected at least"));
  EXPECT_THAT(error("[tcp://a:1, tcp://b:1]"), testing::HasSubstr("expected a list of strings"));
  EXPECT_THAT(error("7"), testing::HasSubstr("expected a list of strings"));
}

TEST(AgentRunConfigTest, AtHomePlannersHaveTheirOwnSettings) {
  EXPECT_EQ(config::Changes(ResolveAgent({}).planners), "");
  EXPECT_EQ(config::Changes(ResolveAgent({"evaluation.protocol=dwa-runs"}).planners), "");
  const test::LogLines log;
  EXPECT_EQ(ResolveAgent({"dwa.max_speed=2.0", "navigation.footprint.length=0.458"})
                .planners.dwa.max_speed,
            2.0);
  EXPECT_FALSE(log.Has("contradicts"));
}

// A robot of 0.99 x 0.64 m, as slow as a TurtleBot3 Waffle Pi and late.
TEST(AgentRunConfigTest, PlannersDriveTheRobotOfTheEnvironment) {
  const std::vector<std::string> robot = {
      "environment.robot.length=0.99",           "environment.robot.width=0.64",
      "environment.robot.linear_speed_limit=1",  "environment.robot.angular_speed_limit=1.4",
      "environment.robot.linear_acceleration=2", "environment.robot.angular_acceleration=3",
      "environment.robot.command_delay=0.1",     "environment.robot.command_jitter=0.06",
      "environment.action.linear_max=0.26",      "environment.action.linear_min=0"};
  const test::LogLines log;
  const planners::PlannersConfig fitted = ResolveAgent(robot).planners;
  EXPECT_FALSE(log.Has("contradicts")) << "nothing was set";
  EXPECT_EQ(config::Changes(fitted),
            "dwa.acceleration = 2.0\n"
            "dwa.escape_speed = 0.0\n"
            "dwa.max_speed = 0.26\n"
            "dwa.max_turn_rate = 1.4\n"
            "dwa.navigation.inflation_radius = 0.377\n"
            "dwa.turn_acceleration = 3.0\n"
            "eband.max_speed = 0.26\n"
            "eband.navigation.inflation_radius = 0.377\n"
            "mppi.max_acceleration = 2.0\n"
            "mppi.max_angular = 1.4\n"
            "mppi.max_angular_acceleration = 3.0\n"
            "mppi.max_linear = 0.26\n"
            "mppi.min_linear = 0.0\n"
            "mppi.outline_length = 0.99\n"
            "mppi.outline_width = 0.64\n"
            "navigation.command_delay = 0.13\n"
            "navigation.footprint.length = 0.952\n"
            "navigation.footprint.width = 0.554\n"
            "navigation.recovery_max_turn_rate = 1.4\n"
            "navigation.recovery_turn_acceleration = 3.0\n"
            "teb.navigation.inflation_radius = 0.377\n"
            "teb.obstacle.min_distance = 0.32\n"
            "teb.robot.max_backward = 0.01\n"
            "teb.robot.max_linear = 0.26\n"
            "teb.robot.outline_length = 0.99\n"
            "teb.robot.outline_width = 0.64\n");
}

TEST(AgentRunConfigTest, AKeyOfAPlannerThatContradictsTheRobotStaysAndIsNamed) {
  const test::LogLines log;
  const planners::PlannersConfig planners =
      ResolveAgent({"environment.robot.length=0.99", "mppi.outline_length=0.5",
                    "environment.robot.linear_speed_limit=1.0", "dwa.max_speed=1.5",
                    "navigation.command_delay=0.2", "mppi.outline_width=0.416"})
          .planners;
  EXPECT_EQ(planners.mppi.outline_length, 0.5);
  EXPECT_EQ(planners.dwa.max_speed, 1.5);
  EXPECT_EQ(planners.navigation.command_delay, 0.2);
  EXPECT_TRUE(
      log.Has("mppi.outline_length = 0.5 m contradicts the robot: expected 0.99 m by "
              "environment.robot.length"));
  EXPECT_TRUE(log.Has("dwa.max_speed = 1.5 m/s contradicts the robot: expected at most 1 m/s"));
  EXPECT_TRUE(log.Has("navigation.command_delay = 0.2 s contradicts the robot: expected 0 s"));
  EXPECT_FALSE(log.Has("mppi.max_linear")) << "it is at its default and follows the robot";
}

// After a way back to an older version of the program, a run and its policies are of the newer one.
TEST(RunConfigTest, KeysOfANewerVersionInARecordedConfigAreLeftOut) {
  const RunConfig config = ReadRecordedConfig(
      "[run]\nseed = 7\nfrom_the_future = \"yes\"\n[learner]\ngamma = 0.5\n[a_new_section]\nx = "
      "[1, 2]\n",
      "config.toml");
  EXPECT_EQ(config.run.seed, 7);
  EXPECT_EQ(config.method.learner.gamma, 0.5);
  EXPECT_THROW(ReadRecordedConfig("[run]\nseed = \"seven\"\n", "config.toml"), base::Error);
  EXPECT_THROW(ReadRecordedConfig("[run]\nseed = \"seven\"\nnew = 1\n", "config.toml"),
               base::Error);
}

// An earlier version recorded its defaults, which may not be today's.
TEST(RunConfigTest, WhatNothingReadsInARecordedConfigHasTodaysDefault) {
  RunConfig config;
  config.guard.margin = 0.123;
  EXPECT_EQ(ReadRecordedConfig(config::ToToml(config), "config.toml").guard.margin,
            RunConfig{}.guard.margin);
  config.guard.shield = true;
  EXPECT_EQ(ReadRecordedConfig(config::ToToml(config), "config.toml").guard.margin, 0.123);
}

TEST(RunConfigTest, RandomisedFieldsOfARecordedConfigAreKept) {
  RunConfig config;
  config.environment.randomize = {{"robot.command_delay", {"[0.0, 0.12]", ""}},
                                  {"robot.friction", {"['cone', 'gazebo']", ""}}};
  const std::string text = config::ToToml(config);
  for (const std::string added : {"", "[a_new_section]\nx = 1\n"}) {
    const RunConfig read = ReadRecordedConfig(text + added, "config.toml");
    ASSERT_EQ(read.environment.randomize.size(), 2u);
    EXPECT_EQ(read.environment.randomize[0], config.environment.randomize[0]);
    EXPECT_EQ(read.environment.randomize[1].key, "robot.friction");
  }
}

RunConfig OwnEnvironment() {
  RunConfig config;
  config.task = {.observation_size = 17, .action_low = {-1.0, 0.0}, .action_high = {1.0, 0.5}};
  return config;
}

TEST(CoursesConfigTest, FreshCoursesAreKindsJoinedByPlus) {
  RunConfig config;
  config.courses.train = "";
  config.courses.fresh = "static+crowds";
  EXPECT_NO_THROW((void)Resolve(config));
  EXPECT_EQ(config.courses.Mix(),
            sim::FreshMix({sim::FreshKind::kStatic, sim::FreshKind::kCrowds}));
  EXPECT_FALSE(config.courses.has_named());
  EXPECT_EQ(config.courses.DescribeTrain(), "fresh courses (static+crowds)");
  config.courses.fresh = "static+crowd";
  try {
    (void)Resolve(config);
    ADD_FAILURE();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::StartsWith(
                                  "courses.fresh: \"static+crowd\": expected \"none\", or one or"));
  }
}

TEST(CoursesConfigTest, LearnableSamplingThatHasNoEffectIsRefused) {
  RunConfig config;
  config.courses.fresh = "static";
  config.courses.sampling.fresh_episodes = 1;
  EXPECT_NO_THROW((void)Resolve(config));
  config.courses.sampling.sampling = actor::Sampling::kLearnable;
  const auto refusal = [&config]() -> std::string {
    try {
      (void)Resolve(config);
    } catch (const base::Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal(), testing::StartsWith("courses.fresh_episodes is 1, expected at least 2"));
  config.courses.sampling.fresh_episodes = 2;
  EXPECT_EQ(refusal(), "accepted");
  config.courses.sampling.learnable_share = 0.0;
  EXPECT_THAT(refusal(), testing::StartsWith("courses.learnable_share is 0"));
  config.courses = {};
  config.courses.sampling.sampling = actor::Sampling::kLearnable;
  EXPECT_EQ(refusal(), "accepted") << "named courses are measured all along";
}

TEST(TaskConfigTest, AnOwnEnvironmentHasItsSizes) {
  const RunConfig config = OwnEnvironment();
  EXPECT_NO_THROW((void)Resolve(config));
  EXPECT_EQ(StepShapeOf(config), env::StepShape(0, 17, 2));
  EXPECT_EQ(MakePolicySpec(config).step_shape(), env::StepShape(0, 17, 2));
  EXPECT_NE(SpecHash(config), SpecHash({}));
  EXPECT_THROW(RequireCourses(config, "slalom train"), base::Error);
  EXPECT_NO_THROW(RequireCourses({}, "slalom train"));
}

TEST(TaskConfigTest, WhatDoesNotFitIsRefusedByItsKey) {
  const auto refusal = [](auto change) -> std::string {
    RunConfig config = OwnEnvironment();
    change(config);
    try {
      (void)Resolve(config);
    } catch (const base::Error& error) {
      return error.what();
    }
    return "accepted";
  };
  using testing::StartsWith;
  EXPECT_THAT(refusal([](RunConfig& c) { c.task.observation_size = 0; }),
              StartsWith("task.action_low is [-1.0, 0.0], expected its default []"));
  EXPECT_THAT(refusal([](RunConfig& c) { c.task.action_high.pop_back(); }),
              StartsWith("task.action_low has 2 numbers and task.action_high 1"));
  EXPECT_THAT(refusal([](RunConfig& c) { c.task.action_low = c.task.action_high = {}; }),
              StartsWith("task.action_low has 0 numbers"));
  EXPECT_THAT(refusal([](RunConfig& c) { c.task.action_low[1] = 0.5; }),
              StartsWith("task.action_low[1] is 0.5, expected less"));
  EXPECT_THAT(refusal([](RunConfig& c) { c.network.sectors = 72; }), StartsWith("network.sectors"));
  EXPECT_THAT(refusal([](RunConfig& c) { c.method.learner.mirror = true; }),
              StartsWith("learner.mirror"));
  EXPECT_THAT(refusal([](RunConfig& c) { c.method.model.kind = nn::ModelKind::kProbabilistic; }),
              StartsWith("model.kind"));
  EXPECT_THAT(refusal([](RunConfig& c) { c.mpc.enabled = true; }), StartsWith("mpc.enabled"));
}

/// Changes the value of a field to one that its range or choices allow.
void Change(const config::Field& field) {
  struct Changer {
    const config::Field& field;
    void operator()(bool* value) const { *value = !*value; }
    void operator()(int* value) const { *value += *value < field.range->max ? 1 : -1; }
    void operator()(std::int64_t* value) const { ++*value; }
    void operator()(double* value) const { *value = 0.5 * (*value + field.range->max); }
    void operator()(std::string* value) const {
      *value = *value == field.choices[0] ? field.choices[1] : field.choices[0];
    }
    void operator()(std::vector<int>* value) const { value->push_back(1); }
    void operator()(std::vector<double>* value) const { value->push_back(1.0); }
    void operator()(std::vector<std::string>* value) const { value->push_back("x"); }
    void operator()(std::vector<base::TomlValue>* value) const { value->push_back({"1", ""}); }
    void operator()(base::TomlAssignments* value) const { value->push_back({"a.b", {"1", ""}}); }
    void operator()(const config::EnumField& value) const {
      value.set(value.name() == field.choices[0] ? field.choices[1] : field.choices[0]);
    }
  };
  std::visit(Changer{field}, field.value);
}

/// What nothing reads.
std::string Unread(RunConfig config) {
  RunConfig defaults;
  try {
    config::RequireRead(config::ListFields(config), config::ListFields(defaults));
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

std::string Refusal(const RunConfig& config) {
  try {
    (void)Resolve(config);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

// Each key of each algorithm, encoder, constraint and so on, with each choice that does not read
// it.
TEST(RunConfigTest, AKeyThatTheChoiceDoesNotReadIsRefused) {
  RunConfig config;
  const config::FieldList fields = config::ListFields(config);
  int num_refused = 0;
  for (const config::Field& field : fields.fields) {
    for (const config::ReadIf& choice : field.read_if) {
      const auto at = std::ranges::find(fields.fields, choice.key, &config::Field::key);
      ASSERT_NE(at, fields.fields.end()) << field.key << ": there is no " << choice.key;
      for (const std::string_view value : choice.values) {
        EXPECT_THAT(at->choices, testing::Contains(value)) << field.key;
      }
      std::vector<std::string> others;
      for (const std::string_view other : at->choices) {
        if (std::ranges::find(choice.values, other) != choice.values.end()) continue;
        others.push_back(fmt::format("{}={}", choice.key, other));
      }
      if (choice.values.empty()) others = {""};  // With its default alone.
      for (const std::string& other : others) {
        SCOPED_TRACE(fmt::format("{} with {}", field.key, other));
        config = {};
        if (!other.empty()) config::ApplyOverride(other, fields);
        const std::string before = config::ToToml(config);
        Change(field);
        ASSERT_NE(config::ToToml(config), before);
        EXPECT_THAT(Unread(config), testing::HasSubstr(field.key + " is "));
        ++num_refused;
      }
    }
  }
  EXPECT_GT(num_refused, 100);
}

TEST(RunConfigTest, WhatReadsAKeyIsNamedBesideIt) {
  RunConfig config;
  config.method.learner.quantiles = 30;
  EXPECT_EQ(Refusal(config),
            "learner.quantiles is 30, expected its default 25 with learner.algorithm = \"td3\", "
            "as it is read with \"tqc\" alone");
  config.method.learner.algorithm = "tqc";
  EXPECT_EQ(Refusal(config), "");
  config.network.attention_heads = 4;
  EXPECT_THAT(Refusal(config), testing::StartsWith("network.attention_heads is 4, expected its "
                                                   "default 8 with network.encoder = \"mlp\""));
  config.network.encoder = nn::EncoderFamily::kTransformer;
  EXPECT_EQ(Refusal(config), "");
}

TEST(RunConfigTest, RolesWhoseMessagesDoNotFitAreNotServed) {
  RunConfig config;
  EXPECT_NO_THROW((void)Resolve(config, {.serves = true}));
  config.actor_service.chunk_rows = 16384;
  EXPECT_THROW((void)Resolve(config, {.serves = true}), base::Error);
  config.replay_server.max_message_bytes = 64 << 20;
  EXPECT_NO_THROW((void)Resolve(config, {.serves = true}));
}

// The replay server would refuse every request for a batch, for ever.
TEST(RunConfigTest, BatchesThatDoNotFitAreNotServed) {
  RunConfig config;
  config.method.learner.batch_size = 32768;
  try {
    (void)Resolve(config, {.serves = true});
    FAIL() << "it was accepted";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("learner.batch_size is 32768"));
    EXPECT_THAT(error.what(), testing::HasSubstr("replay_server.max_sample_bytes"));
  }
  config.replay_server.max_sample_bytes = 256 << 20;
  EXPECT_NO_THROW((void)Resolve(config, {.serves = true}));
}

}  // namespace
}  // namespace slalom::train
