#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "app/train/guarded.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "base/file.h"
#include "base/random.h"
#include "planners/localisation/scan_matching_agent.h"
#include "policy/network_agent.h"
#include "sim/courses/course_sets.h"
#include "sim/environments.h"
#include "tests/app/cli/program.h"
#include "tests/policy/nn/network_cases.h"
#include "tests/support/random_courses.h"
#include "tests/support/scratch_directory.h"

/// `slalom act` and `slalom export`: a policy outside the simulator.

namespace slalom::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kNumBeams = 6;

policy::PolicySnapshot RandomPolicy(const policy::PolicySpec& spec) {
  policy::PolicySnapshot snapshot = policy::ZeroSnapshot(spec);
  std::vector<float> weights(snapshot.weights->size());
  base::Random random(5);
  nn::InitialiseParameters(snapshot.spec.actor_shape(), random, weights);
  snapshot.weights = std::make_shared<const std::vector<float>>(weights);
  snapshot.version = 10;
  return snapshot;
}

/// A policy of random weights that sees two frames.
policy::PolicySnapshot MakeSnapshot(const env::StateOptions& seen = {}) {
  policy::PolicySpec spec;
  spec.observation = {seen, kNumBeams, env::StateSize(seen)};
  spec.network.encoder_layers = spec.network.head_layers = {8};
  spec.network.history = 2;
  spec.actions = {.linear_min = -0.5, .linear_max = 1.0, .angular_max = 2.0};
  return RandomPolicy(spec);
}

/// What a simulated robot senses and does, episode after episode.
struct Drive {
  std::string lines;                 // For `slalom act`, which is told of no action.
  std::vector<env::Action> actions;  // The agent's, from the simulator's own frames.
  std::vector<bool> guarded;
  int num_tracked = 0;               // Frames that show something that moves.
  std::vector<base::Pose2> matched;  // By scan matching, in the map's frame.
};

/// Lets a policy drive two episodes of up to `num_steps` steps in `task`.
Drive DriveEpisodes(const policy::PolicySnapshot& policy, const sim::EnvironmentConfig& task,
                    const planners::GuardConfig& guard = {}, int num_steps = 10) {
  base::Random random(4);
  const auto scenes = task.observation.tracked
                          ? sim::MakeScenes(sim::ResolveCourses("generated-crowds:3:1", {}, 0))
                          : std::vector{sim::MakeScene(RandomCourse(random, {}))};
  sim::CourseEnvironments environments(task, scenes, 1, nullptr);
  const auto agent = train::Guarded(std::make_unique<policy::NetworkAgent>(policy), guard, task);
  const env::ObservationSpec& seen = policy.spec.observation;
  const base::Pose2 X_MO = {{4.5e5, -5.2e6}, 2.0};  // A map that begins elsewhere.
  Drive drive;
  std::vector<env::StepResult> results(1);
  for (const std::uint64_t seed : {1, 2}) {
    environments.Reset(0, {0, seed});
    results = {{}};
    for (int step = 0; step < num_steps && !results[0].ended(); ++step) {
      const env::FrameView frame = environments.observations().frame(0);
      json line = {{"goal", {frame.state[0], frame.state[1]}}};
      for (const std::uint16_t range : frame.ranges_cm) line["ranges"].push_back(range / 100.0);
      if (seen.speeds) {
        const env::Action speeds{frame.state[4], frame.state[5]};
        line["speeds"] = {policy.spec.actions.linear_mps(speeds),
                          policy.spec.actions.angular_radps(speeds)};
      }
      if (guard.enabled() || seen.tracked) {
        const env::Odometry& odometry = environments.observations().odometry[0];
        const base::Vec2 p_M = base::Transform(X_MO, odometry.X_OR.p);
        line["pose"] = {p_M.x, p_M.y, X_MO.yaw + odometry.X_OR.yaw - 20.0 * base::kPi};
        line["speeds"] = {odometry.linear, odometry.angular};
      }
      if (seen.tracked) drive.num_tracked += frame.state[4] != 0.0f;
      if (seen.mounting) line["mounting"] = {task.lidar.offset_x, task.lidar.offset_y};
      if (seed == 2 && step == 0) line["first"] = true;
      drive.lines += line.dump() + "\n";
      env::Action& action = drive.actions.emplace_back();
      agent->Act(environments.observations(), env::NumbersOf(std::span(&action, 1)));
      drive.guarded.push_back(agent->Intervened(0));
      if (const auto* matching = dynamic_cast<planners::ScanMatchingAgent*>(agent.get())) {
        const base::Pose2& X_OR = matching->shown().odometry[0].X_OR;
        drive.matched.push_back({base::Transform(X_MO, X_OR.p), X_MO.yaw + X_OR.yaw});
      }
      environments.Step(env::NumbersOf(std::span(&action, 1)), results);
    }
  }
  return drive;
}

/// The answers of `slalom act`, by line.
std::vector<json> AnswersOf(const ProgramResult& result) {
  std::istringstream lines(result.out);
  std::vector<json> answers;
  for (std::string line; std::getline(lines, line);) answers.push_back(json::parse(line));
  return answers;
}

class PolicyToolsTest : public ::testing::Test {
 protected:
  PolicyToolsTest() { Save({}); }

  void Save(const nn::Metadata& metadata, const char* file = "policy.safetensors") {
    policy::SavePolicy(scratch_.path() / file, MakeSnapshot(), metadata);
  }

  /// The program's answers to `lines`.
  ProgramResult Act(const std::string& lines, const std::string& more = "") {
    base::WriteFileAtomically(scratch_.path() / "lines", lines);
    return RunShell("$SLALOM act --policy policy.safetensors " + more + " < lines",
                    scratch_.path());
  }

  ProgramResult Export(const std::string& more = "") {
    return RunShell("$SLALOM export --policy policy.safetensors --onnx policy.onnx " + more,
                    scratch_.path());
  }

  const ScratchDirectory scratch_;
};

TEST_F(PolicyToolsTest, ActAnswersEachLineAsThePolicyDrives) {
  const ProgramResult result =
      Act("{\"ranges\": [0.5, 1.234, 2, 3, 4.996, null], \"goal\": [3, 0.5]}\n"
          "{\"ranges\": [0.4, 1.2, 2, 3, 9, 1e300], \"goal\": [2.5, 0.25]}\n"
          "{\"ranges\": [1, 1, 1, 1, 1, 1], \"goal\": [2, 0], \"last_action\": [0.5, -0.25]}\n"
          "{\"ranges\": [1, 2, 1, 2, 1, 2], \"goal\": [2, 0], \"first\": true}\n");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::istringstream lines(result.out);

  policy::NetworkAgent agent(MakeSnapshot());
  const env::ActionBounds bounds = MakeSnapshot().spec.actions;
  env::ObservationBatch seen;
  seen.Resize(1, kNumBeams);
  env::Action action;
  const auto expect = [&](std::vector<std::uint16_t> ranges_cm, std::vector<float> state,
                          bool first) {
    seen.ranges_cm = std::move(ranges_cm);
    seen.state = std::move(state);
    seen.first[0] = first;
    agent.Act(seen, env::NumbersOf(std::span(&action, 1)));
    std::string line;
    ASSERT_TRUE(std::getline(lines, line));
    const json answer = json::parse(line);
    EXPECT_EQ(answer["action"][0].get<float>(), action.linear);
    EXPECT_EQ(answer["action"][1].get<float>(), action.angular);
    EXPECT_DOUBLE_EQ(answer["linear"].get<double>(), bounds.linear_mps(action));
    EXPECT_DOUBLE_EQ(answer["angular"].get<double>(), bounds.angular_radps(action));
  };
  const env::Action still{-1.0f / 3.0f, 0.0f};  // 0 m/s between -0.5 and 1 m/s.
  expect({50, 123, 200, 300, 500, 500}, {3, 0.5f, still.linear, still.angular}, true);
  expect({40, 120, 200, 300, 500, 500}, {2.5f, 0.25f, action.linear, action.angular}, false);
  expect({100, 100, 100, 100, 100, 100}, {2, 0, 0.5f, -0.25f}, false);
  expect({100, 200, 100, 200, 100, 200}, {2, 0, still.linear, still.angular}, true);
}

// Whatever is observed, with any network, a policy sees outside the simulator what it saw inside.
TEST_F(PolicyToolsTest, ActDrivesSimulatedEpisodesAsTheAgentDoes) {
  using enum nn::EncoderFamily;
  const std::vector<sim::ObservationConfig> options = {
      {{.commands = 3}},
      {{.speeds = true}},
      {},
      {{.speeds = true, .mounting = true, .commands = 4}, 8.0},
      {{.mounting = true}},
      {{.speeds = true, .commands = 2}}};
  const std::vector<nn::Case> networks = {{"Mlp1", nn::Make(kMlp, {8}, 1)},
                                          {"Mlp3", nn::Make(kMlp, {8}, 3)},
                                          {"BeamCnn", nn::OverBeams(nn::Make(kCnn, {4, 3, 5}, 4))},
                                          {"Gru", nn::Make(kGru, {4, 4}, 4)},
                                          {"TimeCnn", nn::Make(kCnn, {5, 4}, 2)},
                                          {"Transformer", nn::Make(kTransformer, {8, 8}, 3)}};
  for (std::size_t i = 0; i < networks.size(); ++i) {
    const nn::NetworkConfig& network = networks[i].config;
    sim::EnvironmentConfig task;
    task.lidar.num_beams = 24;
    task.observation = options[i];
    if (i % 2 == 0) task.action = {.linear_min = -0.3, .linear_max = 1.2, .angular_max = 2.0};
    if (i % 3 == 0) task.action.linear_min = 0.0;
    policy::PolicySpec spec;
    spec.observation = sim::MakeObservationSpec(task);
    spec.network = network;
    spec.actions = task.action;
    const policy::PolicySnapshot policy = RandomPolicy(spec);
    policy::SavePolicy(scratch_.path() / "policy.safetensors", policy, {});
    const Drive drive = DriveEpisodes(policy, task);
    const ProgramResult result = Act(drive.lines);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const std::vector<json> answers = AnswersOf(result);
    ASSERT_GE(answers.size(), drive.actions.size());
    for (std::size_t k = 0; k < drive.actions.size(); ++k) {
      const json& action = answers[k]["action"];
      EXPECT_NEAR(action[0].get<float>(), drive.actions[k].linear, 1e-5)
          << networks[i].name << ", case " << i << ", step " << k;
      EXPECT_NEAR(action[1].get<float>(), drive.actions[k].angular, 1e-5)
          << networks[i].name << ", case " << i << ", step " << k;
    }
  }
}

/// A policy of random weights for `task`.
policy::PolicySnapshot RandomPolicyOf(const sim::EnvironmentConfig& task) {
  policy::PolicySpec spec;
  spec.observation = sim::MakeObservationSpec(task);
  spec.network.encoder_layers = spec.network.head_layers = {8};
  spec.actions = task.action;
  return RandomPolicy(spec);
}

// What moves is told from the lines as it is told in the simulator, in a second episode, too, and
// from another place of the range finder than by default.
TEST_F(PolicyToolsTest, ActTracksWhatMovesAsTheSimulatorDoes) {
  train::RunConfig trained;
  sim::EnvironmentConfig& task = trained.environment;
  task.lidar.num_beams = 360;
  task.lidar.offset_x = -0.05;
  task.observation.tracked = true;
  const policy::PolicySnapshot policy = RandomPolicyOf(task);
  policy::SavePolicy(scratch_.path() / "policy.safetensors", policy,
                     {{"config", config::ToToml(trained)}});
  const Drive drive = DriveEpisodes(policy, task, {}, 40);
  ASSERT_GT(drive.num_tracked, 10);
  const ProgramResult result = Act(drive.lines);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::vector<json> answers = AnswersOf(result);
  ASSERT_EQ(answers.size(), drive.actions.size());
  for (std::size_t k = 0; k < answers.size(); ++k) {
    EXPECT_NEAR(answers[k]["action"][0].get<float>(), drive.actions[k].linear, 1e-3) << k;
    EXPECT_NEAR(answers[k]["action"][1].get<float>(), drive.actions[k].angular, 1e-3) << k;
    EXPECT_FALSE(answers[k].contains("guarded"));
  }
  EXPECT_THAT(Act("{\"ranges\": [1], \"goal\": [2, 0]}\n").err,
              HasSubstr("line 1: ranges: found 1 numbers, expected 360"));
  json line = json::parse(drive.lines.substr(0, drive.lines.find('\n')));
  line.erase("pose");
  EXPECT_THAT(Act(line.dump() + "\n").err, HasSubstr("line 1: pose: is missing"));
}

// Outside the simulator, too, a guard changes the actions that it would change inside.
TEST_F(PolicyToolsTest, ActIsGuardedAsEvaluationsAre) {
  struct Case {
    planners::GuardConfig guard;
    std::string options;
  };
  const std::vector<Case> cases = {
      {{.shield = true}, "--set guard.shield=true --set environment.robot.command_delay=0.08"},
      {{.shield = true, .margin = 0.1}, "--profile shield.toml --set guard.margin=0.1"},
      {{.shield = true, .waypoints = true, .waypoint_after = 0.0},
       "--profile shield.toml --set guard.waypoints=true --set guard.waypoint_after=0"}};
  base::WriteFileAtomically(scratch_.path() / "shield.toml",
                            "[guard]\nshield = true\n[environment.robot]\ncommand_delay = 0.08\n");
  for (const Case& each : cases) {
    sim::EnvironmentConfig task;
    task.lidar.num_beams = 90;
    task.lidar.offset_x = -0.05;
    task.observation.commands = 2;
    const policy::PolicySnapshot policy = RandomPolicyOf(task);
    // The robot of the training is another one: it has no delay, and its friction is drawn.
    train::RunConfig trained;
    trained.environment = task;
    config::SetField("environment.randomize", "{\"robot.wheel_friction\" = [0.2, 0.9]}", "test",
                     config::ListFields(trained));
    policy::SavePolicy(scratch_.path() / "policy.safetensors", policy,
                       {{"config", config::ToToml(trained)}});
    task.robot.command_delay = 0.08;
    const Drive drive = DriveEpisodes(policy, task, each.guard, 60);
    const auto num_guarded = std::ranges::count(drive.guarded, true);
    ASSERT_GT(num_guarded, 0) << each.options;
    ASSERT_LT(num_guarded, std::ssize(drive.guarded)) << each.options;
    const ProgramResult result = Act(drive.lines, each.options);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const std::vector<json> answers = AnswersOf(result);
    ASSERT_GE(answers.size(), drive.actions.size());
    for (std::size_t k = 0; k < drive.actions.size(); ++k) {
      const json& answer = answers[k];
      EXPECT_EQ(answer["guarded"].get<bool>(), drive.guarded[k]) << each.options << ", step " << k;
      EXPECT_NEAR(answer["action"][0].get<float>(), drive.actions[k].linear, 1e-5)
          << each.options << ", step " << k;
      EXPECT_NEAR(answer["action"][1].get<float>(), drive.actions[k].angular, 1e-5)
          << each.options << ", step " << k;
    }
  }
}

TEST_F(PolicyToolsTest, ActMatchesScansAsEvaluationsDo) {
  sim::EnvironmentConfig task;
  task.lidar.num_beams = 90;
  task.localisation = {.position_drift = 0.1, .heading_drift = 0.05};
  const policy::PolicySnapshot policy = RandomPolicyOf(task);
  train::RunConfig trained;
  trained.environment = task;
  policy::SavePolicy(scratch_.path() / "policy.safetensors", policy,
                     {{"config", config::ToToml(trained)}});
  const Drive drive = DriveEpisodes(policy, task, {.scan_matching = true}, 40);
  const ProgramResult result = Act(drive.lines, "--set guard.scan_matching=true");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::vector<json> answers = AnswersOf(result);
  ASSERT_GE(answers.size(), drive.actions.size());
  for (std::size_t k = 0; k < drive.actions.size(); ++k) {
    const json& answer = answers[k];
    EXPECT_FALSE(answer.contains("guarded")) << k;
    const base::Pose2& pose = drive.matched[k];
    EXPECT_NEAR(answer["pose"][0].get<double>(), pose.p.x, 1e-4) << k;
    EXPECT_NEAR(answer["pose"][1].get<double>(), pose.p.y, 1e-4) << k;
    EXPECT_NEAR(base::WrapAngle(answer["pose"][2].get<double>() - pose.yaw), 0.0, 1e-4) << k;
    EXPECT_NEAR(answer["action"][0].get<float>(), drive.actions[k].linear, 1e-4) << k;
    EXPECT_NEAR(answer["action"][1].get<float>(), drive.actions[k].angular, 1e-4) << k;
  }
}

TEST_F(PolicyToolsTest, AGuardNeedsTheOdometryAndWithoutOneItIsPassedOver) {
  sim::EnvironmentConfig task;
  task.lidar.num_beams = kNumBeams;
  train::RunConfig trained;
  trained.environment = task;
  policy::SavePolicy(scratch_.path() / "policy.safetensors", RandomPolicyOf(task),
                     {{"config", config::ToToml(trained)}});
  const std::string ranges = R"({"ranges": [1, 1, 1, 1, 1, 1], )";
  const std::string on = "--set guard.shield=true";
  const std::string good = ranges + R"("goal": [2, 0], "pose": [7, -8, 9], "speeds": [0, 0]})"
                                    "\n";
  EXPECT_THAT(Act(good, on).out, HasSubstr("\"guarded\":"));
  const ProgramResult alone = Act(good);
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
  EXPECT_THAT(alone.out, ::testing::Not(HasSubstr("guarded")));
  EXPECT_THAT(Act(good, on + " --set guard.shield=false").out, ::testing::StrEq(alone.out));

  const auto refuses = [&](const std::string& line, const std::string& options,
                           const std::string& expected) {
    const ProgramResult result = Act(ranges + line + "\n", options);
    EXPECT_EQ(result.exit_code, 1) << line << options;
    EXPECT_THAT(result.err, HasSubstr(expected));
    EXPECT_THAT(result.out, IsEmpty());
  };
  refuses(R"("goal": [2, 0], "speeds": [0, 0]})", on, "pose: is missing, expected 3 numbers");
  refuses(R"("goal": [2, 0], "pose": [0, 0, 0]})", on, "speeds: is missing, expected 2 numbers");
  refuses(R"("goal": [2, 0], "pose": [0, 0], "speeds": [0, 0]})", on,
          "pose: found 2 numbers, expected 3");
  refuses(R"("goal": [900, 0], "pose": [0, 0, 0], "speeds": [0, 0]})", "--set guard.waypoints=true",
          "goal: found 900 m, expected at most 100 m from the robot");
  const std::string any = R"("goal": [2, 0]})";
  refuses(any, "--set guard.margin=0.1", "guard.margin is 0.1, expected its default 0.05");
  refuses(any, "--set environment.robot.length=0.6",
          "--set environment.robot.length=0.6: expected --set guard.shield=true");
  refuses(any, "--set run.seed=3", "--set run.seed=3: expected a key of [guard]");
  refuses(any, on + " --set environment.lidar.num_beams=12", "policy.safetensors: ");
  refuses(any, on + " --set environment.lidar.field_of_view=3",
          "environment.lidar.field_of_view is 3 rad");
  const std::string jump = ranges + R"("goal": [2, 0], "pose": [2e5, 0, 1e30], "speeds": [0, 0]})";
  EXPECT_THAT(Act(good + jump + "\n", on).err, HasSubstr("line 2: pose: found 199993 m, expected"));
  EXPECT_EQ(Act(jump + "\n", on).exit_code, 0) << "any frame";
}

TEST_F(PolicyToolsTest, ActDrivesByAPlannerAndChecksCommandsOfOthers) {
  const auto answers = [&](const std::string& line, const std::string& options) {
    base::WriteFileAtomically(scratch_.path() / "lines", line + "\n");
    return RunShell("$SLALOM act " + options + " < lines", scratch_.path());
  };
  const std::string beams = " --set environment.lidar.num_beams=5";
  const std::string seen = R"({"ranges": [9, 9, 9, 9, 9], "pose": [1, 2, 3], "speeds": [0, 0], )";
  const ProgramResult planned = answers(seen + R"("goal": [3, 0]})", "--agent dwa" + beams);
  ASSERT_EQ(planned.exit_code, 0) << planned.err;
  EXPECT_TRUE(json::parse(planned.out)["linear"].is_number());
  EXPECT_FALSE(json::parse(planned.out).contains("guarded"));

  const ProgramResult passes = answers(seen + R"("command": [0.5, 0.25]})", "--check" + beams);
  ASSERT_EQ(passes.exit_code, 0) << passes.err;
  EXPECT_NEAR(json::parse(passes.out)["linear"].get<double>(), 0.5, 1e-6);
  EXPECT_NEAR(json::parse(passes.out)["angular"].get<double>(), 0.25, 1e-6);
  EXPECT_FALSE(json::parse(passes.out)["guarded"].get<bool>());
  const std::string wall = R"({"ranges": [9, 0.9, 0.3, 0.9, 9], "pose": [1, 2, 3], )";
  const ProgramResult slower =
      answers(wall + R"("speeds": [0, 0], "command": [1.5, 0]})", "--check" + beams);
  EXPECT_LT(json::parse(slower.out)["linear"].get<double>(), 1.0);
  EXPECT_TRUE(json::parse(slower.out)["guarded"].get<bool>());

  const auto refuses = [&](const std::string& line, const std::string& options,
                           const std::string& expected) {
    const ProgramResult result = answers(line, options + beams);
    EXPECT_EQ(result.exit_code, 1) << line << options;
    EXPECT_THAT(result.err, HasSubstr(expected));
  };
  refuses(seen + R"("goal": [3, 0]})", "--check", "no key 'goal', expected ranges, command");
  refuses(seen + R"("first": true})", "--check", "command: is missing, expected 2 numbers");
  refuses(seen + R"("command": [3, 0]})", "--agent dwa", "no key 'command', expected ranges, goal");
  refuses(seen + R"("goal": [3, 0]})", "--agent rrt", "rrt");
  refuses(seen + R"("goal": [3, 0]})", "--agent dwa --set teb.robot.max_linear=1",
          "--set teb.robot.max_linear=1: expected a key of [guard], [environment]");
  refuses(seen + R"("command": [3, 0]})", "--check --set guard.shield=false",
          "guard.shield: found false, expected true");
}

TEST_F(PolicyToolsTest, ActReadsWhatMeansNoEcho) {
  const auto line = [](const std::string& ranges, const std::string& more = "") {
    return fmt::format("{{\"ranges\": [{}], \"goal\": [3, 0.5], \"first\": true{}}}\n", ranges,
                       more);
  };
  const auto is_same = [](const ProgramResult& result, int lines) {
    const std::string first = result.out.substr(0, result.out.find('\n') + 1);
    std::string all;
    for (int i = 0; i < lines; ++i) all += first;
    return result.exit_code == 0 && result.out == all;
  };
  const ProgramResult none = Act(
      line("1, 2, null, 3, null, null") + line("1, 2, NaN, 3, Infinity, 7") +
      line(R"(1, 2, "NaN", 3, "Infinity", 7)") + line("1, 2, 0, 3, 0.0, null", ", \"no_echo\": 0") +
      line("1, 2, -1, 3, -1.0, NaN", ", \"no_echo\": -1"));
  EXPECT_TRUE(is_same(none, 5)) << none.out << none.err;
  EXPECT_THAT(none.err, IsEmpty());
  const ProgramResult near =
      Act(line("1, 2, 0, 3, 0, 5") + line("1, 2, -Infinity, 3, -Infinity, 5"));
  EXPECT_TRUE(is_same(near, 2)) << near.out << near.err;
  EXPECT_NE(near.out.substr(0, 60), none.out.substr(0, 60)) << "0 is an obstacle";
  EXPECT_THAT(near.err, HasSubstr("ranges[2] is 0, which counts as an obstacle at the sensor"));
  EXPECT_THAT(near.err, ::testing::Not(HasSubstr("ranges[4]"))) << "one warning is enough";
}

TEST_F(PolicyToolsTest, ActPassesOverBlankLines) {
  const std::string line = "{\"ranges\": [1, 1, 1, 1, 1, 1], \"goal\": [2, 0]}";
  const ProgramResult result = Act(line + "\r\n\n \t\r\n" + line + "\n\n");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(std::ranges::count(result.out, '\n'), 2);
  EXPECT_THAT(Act(line + "\n\nno\n").err, HasSubstr("line 3: found no JSON, expected"));
}

TEST_F(PolicyToolsTest, ActKeepsOlderCommandsAndReadsSpeeds) {
  const policy::PolicySnapshot snapshot = MakeSnapshot({.speeds = true, .commands = 3});
  policy::SavePolicy(scratch_.path() / "policy.safetensors", snapshot, {});
  std::string lines;
  for (int i = 0; i < 5; ++i) {
    lines += fmt::format(
        "{{\"ranges\": [1, 2, 3, 4, 5, {}], \"goal\": [3, {}], \"speeds\": "
        "[0.{}, -0.5]{}}}\n",
        i, i, i, i == 3 ? ", \"first\": true" : "");
  }
  const ProgramResult result = Act(lines);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::istringstream answers(result.out);
  policy::NetworkAgent agent(snapshot);
  env::ObservationBatch seen;
  seen.Resize(1, kNumBeams, 10);
  const env::Action still{-1.0f / 3.0f, 0.0f};
  env::Action one = still, two = still, three = still;  // The newest first.
  for (int i = 0; i < 5; ++i) {
    const auto number = static_cast<float>(i);
    if (i == 3) one = two = three = still;
    seen.first[0] = i == 0 || i == 3;
    seen.ranges_cm = {100, 200, 300, 400, 500, static_cast<std::uint16_t>(100 * i)};
    // 0.25 m/s is in the middle of the bounds, and each 0.75 m/s from there are 1.
    seen.state = {
        3.0f,         number,     one.linear,  one.angular,  (0.1f * number - 0.25f) / 0.75f,
        -0.5f / 2.0f, two.linear, two.angular, three.linear, three.angular};
    three = two;
    two = one;
    agent.Act(seen, env::NumbersOf(std::span(&one, 1)));
    std::string line;
    ASSERT_TRUE(std::getline(answers, line));
    const json answer = json::parse(line);
    EXPECT_NEAR(answer["action"][0].get<float>(), one.linear, 1e-6) << i;
    EXPECT_NEAR(answer["action"][1].get<float>(), one.angular, 1e-6) << i;
    one = {answer["action"][0].get<float>(), answer["action"][1].get<float>()};
  }
  EXPECT_THAT(Act("{\"ranges\": [1, 1, 1, 1, 1, 1], \"goal\": [2, 0]}\n").err,
              HasSubstr("line 1: speeds: is missing, expected 2 numbers"));
}

TEST_F(PolicyToolsTest, ActRefusesAPolicyThatNeedsASimulator) {
  policy::SavePolicy(scratch_.path() / "policy.safetensors", MakeSnapshot({.privileged = true}),
                     {});
  const ProgramResult result = Act("{\"ranges\": [1, 2, 3, 4, 5, 5], \"goal\": [3, 1]}\n");
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("policy.safetensors: the policy sees what no sensor tells"));
}

TEST_F(PolicyToolsTest, ActReadsTheMounting) {
  const policy::PolicySnapshot snapshot = MakeSnapshot({.mounting = true});
  policy::SavePolicy(scratch_.path() / "policy.safetensors", snapshot, {});
  const ProgramResult result =
      Act("{\"ranges\": [1, 2, 3, 4, 5, 5], \"goal\": [3, 1], \"mounting\": [0.12, -0.03]}\n");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  policy::NetworkAgent agent(snapshot);
  env::ObservationBatch seen;
  seen.Resize(1, kNumBeams, 6);
  seen.ranges_cm = {100, 200, 300, 400, 500, 500};
  seen.state = {3.0f, 1.0f, -1.0f / 3.0f, 0.0f, 1.2f, -0.3f};
  env::Action action;
  agent.Act(seen, env::NumbersOf(std::span(&action, 1)));
  const json answer = json::parse(result.out);
  EXPECT_NEAR(answer["action"][0].get<float>(), action.linear, 1e-6);
  EXPECT_NEAR(answer["action"][1].get<float>(), action.angular, 1e-6);
  EXPECT_THAT(Act("{\"ranges\": [1, 1, 1, 1, 1, 1], \"goal\": [2, 0]}\n").err,
              HasSubstr("line 1: mounting: is missing, expected 2 numbers"));
}

TEST_F(PolicyToolsTest, ActNamesTheLineAndWhatWasExpectedOfIt) {
  const std::string good = "{\"ranges\": [1, 1, 1, 1, 1, 1], \"goal\": [2, 0]}\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {R"({"ranges": [1, 1, 1], "goal": [2, 0]})", "ranges: found 3 numbers, expected 6"},
      {R"({"ranges": [1, 1, 1, 1, 1, -1], "goal": [2, 0]})", "ranges[5]: found -1, expected"},
      {R"({"ranges": [1, 1, "a", 1, 1, 1], "goal": [2, 0]})", "ranges[2]: found \"a\", expected"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1], "goal": [2]})", "goal: found 1 numbers, expected 2"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1], "goal": [2, null]})", "goal[1]: found null"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1], "goal": [2, 1e39]})", "goal[1]: found 1e+39"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1], "goal": [NaN, 0]})", "goal[0]: found NaN, expected a n"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1], "goal": [2, 0], "no_echo": NaN})", "no_echo: found NaN"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1]})", "goal: is missing, expected 2 numbers"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1], "gaol": [2, 0]})", "no key 'gaol', expected ranges, goal"},
      {R"({"ranges": [1, 1, 1, 1, 1, 1], "goal": [2, 0], "first": 1})", "first: expected true"},
      {R"([1, 2])", "found array, expected a JSON object"},
      {R"({"ranges": [1, nan]})", "found no JSON, expected a JSON object"},
      {std::string(100'000, '['), "expected a JSON object"},
      {R"({"goal": )" + std::string(100'000, '['), "expected a JSON object"},
  };
  for (const auto& [line, expected] : cases) {
    const ProgramResult result = Act(good + line + "\n" + good);
    EXPECT_EQ(result.exit_code, 1) << line.substr(0, 80);
    EXPECT_THAT(result.err, HasSubstr("slalom: standard input: line 2: "));
    EXPECT_THAT(result.err, HasSubstr(expected));
    EXPECT_EQ(std::ranges::count(result.out, '\n'), 1) << "the line before was answered";
  }
}

TEST_F(PolicyToolsTest, ExportWritesAModelAndReplacesNoFileUnasked) {
  ASSERT_EQ(Export().exit_code, 0);
  const std::string model = base::ReadFile(scratch_.path() / "policy.onnx");
  EXPECT_THAT(model, HasSubstr("counter-clockwise"));
  const ProgramResult again = Export();
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("policy.onnx"));
  EXPECT_EQ(Export("--force").exit_code, 0);
  EXPECT_EQ(base::ReadFile(scratch_.path() / "policy.onnx"), model) << "the same bytes each time";
}

TEST_F(PolicyToolsTest, ExportRefusesAPolicyThatPlans) {
  Save({{"config", "[model]\nkind = \"deterministic\"\n[mpc]\nenabled = true\n"}});
  const ProgramResult result = Export();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("policy.safetensors: mpc.enabled is true, expected false"));
  EXPECT_FALSE(std::filesystem::exists(scratch_.path() / "policy.onnx"));
  EXPECT_THAT(result.out, IsEmpty());
}

}  // namespace
}  // namespace slalom::test
