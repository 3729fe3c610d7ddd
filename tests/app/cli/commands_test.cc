#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/event_file_reader.h"
#include "tests/support/scratch_directory.h"

namespace slalom::test {
namespace {

using ::testing::HasSubstr;

const std::filesystem::path kSource = SLALOM_SOURCE_DIR;

TEST(CommandsTest, EveryCommandHasHelp) {
  const std::vector<std::vector<std::string>> commands = {{},
                                                          {"train"},
                                                          {"evaluate"},
                                                          {"report"},
                                                          {"courses"},
                                                          {"courses", "list"},
                                                          {"courses", "show"},
                                                          {"courses", "render"},
                                                          {"courses", "generate"},
                                                          {"courses", "import"},
                                                          {"config"},
                                                          {"config", "print"},
                                                          {"config", "docs"},
                                                          {"metrics"},
                                                          {"metrics", "docs"}};
  const ScratchDirectory scratch;
  for (auto command : commands) {
    command.push_back("--help");
    const ProgramResult result = RunProgram(command, scratch.path());
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out, HasSubstr("Usage"));
  }
}

TEST(CommandsTest, TheConfigPageIsFresh) {
  const ScratchDirectory scratch;
  const ProgramResult page = RunProgram({"config", "docs"}, scratch.path());
  EXPECT_EQ(page.out, base::ReadFile(kSource / "docs/config.md"))
      << "docs/config.md is stale: ./slalom config docs > docs/config.md";
}

TEST(CommandsTest, TheMetricsPageIsFresh) {
  const ScratchDirectory scratch;
  const ProgramResult page = RunProgram({"metrics", "docs"}, scratch.path());
  EXPECT_EQ(page.out, base::ReadFile(kSource / "docs/metrics.md"))
      << "docs/metrics.md is stale: ./slalom metrics docs > docs/metrics.md";
}

// Those of training are in tests/app/train/presets_test.cc; one of them for the command itself.
TEST(CommandsTest, EveryPlannersPresetLoadsAndPrintsToItself) {
  const ScratchDirectory scratch;
  std::vector<std::vector<std::string>> commands = {
      {"config", "print", kSource / "configs/fast.toml"}};
  for (const auto& entry : std::filesystem::directory_iterator(kSource / "configs/planners")) {
    commands.push_back({"config", "print", entry.path(), "--agent"});
  }
  for (std::vector<std::string>& command : commands) {
    const ProgramResult first = RunProgram(command, scratch.path());
    ASSERT_EQ(first.exit_code, 0) << first.err;
    base::WriteFileAtomically(scratch.path() / "printed.toml", first.out);
    command[2] = "printed.toml";
    EXPECT_EQ(RunProgram(command, scratch.path()).out, first.out);
  }
  EXPECT_GE(commands.size(), 4u);
}

TEST(CommandsTest, ATrainingLeavesWhatTheManualSaysAndItsPolicyScoresTheSameAgain) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 3000, "snapshot_steps = [1000, 2000]\n");
  const ProgramResult trained = RunProgram({"train", "tiny.toml"}, scratch.path());
  ASSERT_EQ(trained.exit_code, 0) << trained.err;
  const auto run = scratch.path() / "runs/tiny";
  for (const char* name :
       {"config.toml", "policy.safetensors", "metrics.csv", "evaluation.json",
        "evaluation-courses.csv", "evaluation-episodes.csv", "evaluation-tracks.jsonl",
        "courses.png", "courses.svg", "training.html", "curve.csv", "checkpoints", "snapshots"}) {
    EXPECT_TRUE(std::filesystem::exists(run / name)) << name;
  }
  // The page is written again when the scores are there.
  const std::string page = base::ReadFile(run / "training.html");
  EXPECT_THAT(page, HasSubstr("\"name\":\"tiny\""));
  EXPECT_THAT(page, HasSubstr("\"success_high\":["));
  const auto events = ReadRun(run);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().scalars.at("training/steps"), static_cast<float>(events.back().step));
  EXPECT_GE(events.back().step, 3000);
  const ProgramResult scored =
      RunProgram({"evaluate", "--policy", "runs/tiny/policy.safetensors", "--courses",
                  "generated:3:4", "--json", "--threads", "1"},
                 scratch.path());
  ASSERT_EQ(scored.exit_code, 0) << scored.err;
  const auto first = nlohmann::json::parse(base::ReadFile(run / "evaluation.json"));
  const auto again = nlohmann::json::parse(scored.out);
  for (const char* key : {"episodes", "success_rate", "success_rate_interval", "collision_rate",
                          "timeout_rate", "survival_time_s", "traversal_time_s", "barn_score"}) {
    ASSERT_TRUE(again.contains(key)) << key;
    EXPECT_EQ(again.at(key), first.at(key)) << key;
  }
  EXPECT_EQ(again.at("episodes"), 8);
}

// The first course starts on its goal; the second cannot be driven within the time limit.
TEST(CommandsTest, ATrainingEndsWithCommandsThatWorkAndTheWorstCourse) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 1500);
  base::WriteFileAtomically(scratch.path() / "two.courses",
                            "slalom-courses 1\nset two\n"
                            "course near\nstart 0 0 0\ngoal 0.2 0\nbounds -2 -2 4 2\nend\n"
                            "course far\nstart 0 0 0\ngoal 10 0\nbounds -2 -2 12 2\nend\n"
                            "checksum none\n");
  const ProgramResult trained = RunProgram(
      {"train", "tiny.toml", "--set", "courses.test=two.courses", "evaluation.time_limit=1"},
      scratch.path());
  ASSERT_EQ(trained.exit_code, 0) << trained.err;
  const auto run = [&](const std::string& label) {
    const std::string start = "\n  " + label + "  ";
    const std::size_t begin = trained.out.find(start);
    if (begin == std::string::npos) return ProgramResult{-1, "", trained.out};
    const std::size_t command = begin + start.size();
    const std::size_t end = trained.out.find('\n', command);
    return RunShell(trained.out.substr(command, end - command), scratch.path());
  };
  const ProgramResult page = run("a page with plots");
  EXPECT_EQ(page.exit_code, 0) << page.err;
  EXPECT_TRUE(std::filesystem::exists(scratch.path() / "runs/tiny/report/report.html"));
  const ProgramResult picture = run("the worst course ");
  EXPECT_EQ(picture.exit_code, 0) << picture.err;
  EXPECT_TRUE(std::filesystem::exists(scratch.path() / "runs/tiny/far.svg")) << trained.out;
}

TEST(CommandsTest, APlannersEvaluationIsTheSameOnAnyThreadsAndMakesAReport) {
  const ScratchDirectory scratch;
  base::WriteFileAtomically(scratch.path() / "heavy.toml", "[environment.robot]\nmass = 40.0\n");
  const auto evaluate = [&](const std::string& output, std::vector<std::string> more) {
    std::vector<std::string> arguments{"evaluate",  "--agent",       "dwa",
                                       "--courses", "generated:3:2", "--episodes",
                                       "2",         "--set",         "evaluation.time_limit=4",
                                       "--output",  output};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = RunProgram(arguments, scratch.path());
    ASSERT_EQ(result.exit_code, 0) << result.err;
  };
  evaluate("one", {"--threads", "1", "--set", "evaluation.num_environments=1"});
  evaluate("many", {"--threads", "3", "--name", "also dwa"});
  evaluate("heavy", {"--profile", "heavy.toml"});
  const auto read = [&](const std::string& file) { return base::ReadFile(scratch.path() / file); };
  for (const char* name :
       {"evaluation-episodes.csv", "evaluation-courses.csv", "evaluation-tracks.jsonl"}) {
    EXPECT_EQ(read(std::string("many/") + name), read(std::string("one/") + name)) << name;
  }
  const auto json = nlohmann::json::parse(read("heavy/evaluation.json"));
  EXPECT_EQ(json.at("agent").at("name"), "dwa");
  EXPECT_EQ(json.at("provenance").at("profiles"), nlohmann::json({"heavy.toml"}));
  EXPECT_THAT(json.at("provenance").at("config").get<std::string>(), HasSubstr("mass = 40.0"));

  const ProgramResult report = RunProgram(
      {"report", "one", "many/evaluation.json", "heavy", "--output", "report"}, scratch.path());
  ASSERT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(report.out, HasSubstr("| dwa | – | 4 |"));
  EXPECT_THAT(report.out, HasSubstr("| also dwa | – | 4 |"));
  EXPECT_THAT(report.out, HasSubstr("| dwa (heavy) | – | 4 |"));
  for (const char* name : {"report.md", "report.csv", "report-pairs.csv", "report.html"}) {
    EXPECT_TRUE(std::filesystem::exists(scratch.path() / "report" / name)) << name;
  }
}

TEST(CommandsTest, AProfileOfATrainingIsRecordedAndARunKeepsIt) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 1500);
  base::WriteFileAtomically(scratch.path() / "worn.toml",
                            "[environment.robot]\nspeed_gain = 0.9\nyaw_gain = 0.8\n");
  base::WriteFileAtomically(scratch.path() / "new.toml", "[environment.robot]\nspeed_gain = 1.0\n");
  const ProgramResult trained = RunProgram({"train", "tiny.toml", "--no-evaluation", "--profile",
                                            "worn.toml", "--set", "environment.robot.yaw_gain=0.7"},
                                           scratch.path());
  EXPECT_EQ(trained.exit_code, 0) << trained.err;
  EXPECT_THAT(base::ReadFile(scratch.path() / "runs/tiny/config.toml"),
              AllOf(HasSubstr("speed_gain = 0.9"), HasSubstr("yaw_gain = 0.7")));
  const std::vector<std::string> resume = {"train", "runs/tiny", "--resume", "--no-evaluation"};
  EXPECT_EQ(RunProgram(resume, scratch.path()).exit_code, 0);
  std::vector<std::string> with_another = resume;
  with_another.insert(with_another.end(), {"--profile", "new.toml"});
  const ProgramResult refused = RunProgram(with_another, scratch.path());
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.err, HasSubstr("environment.robot.speed_gain was 0.9"));
}

TEST(CommandsTest, APlannerHasTheRobotOfItsProtocolUnlessToldOtherwise) {
  const ScratchDirectory scratch;
  base::WriteFileAtomically(scratch.path() / "runs.toml",
                            "[evaluation]\nprotocol = \"dwa-runs\"\n");
  const auto robot_of = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments{"evaluate",   "--agent",
                                       "dwa",        "--json",
                                       "--episodes", "1",
                                       "--set",      "evaluation.time_limit=2",
                                       "--courses",  "generated:3:1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = RunProgram(arguments, scratch.path());
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out).at("provenance").at("config").get<std::string>();
  };
  const auto published = AllOf(HasSubstr("friction = \"gazebo\""), HasSubstr("sensor_mass = 1.1"));
  EXPECT_THAT(robot_of({}), HasSubstr("friction = \"cone\""));
  EXPECT_THAT(robot_of({"--protocol", "dwa-runs"}), published);
  EXPECT_THAT(robot_of({"--protocol", "barn-challenge"}), published);
  EXPECT_THAT(robot_of({"--config", "runs.toml"}), published);
  EXPECT_THAT(RunProgram({"config", "print", "runs.toml", "--agent"}, scratch.path()).out,
              published);
  EXPECT_THAT(robot_of({"--protocol", "dwa-runs", "--set", "environment.robot.friction=pyramid"}),
              AllOf(HasSubstr("friction = \"pyramid\""), HasSubstr("sensor_mass = 1.1")));
}

TEST(CommandsTest, VersionNamesTheCommit) {
  const ScratchDirectory scratch;
  EXPECT_THAT(RunProgram({"--version"}, scratch.path()).out, HasSubstr("0.1.0 ("));
}

}  // namespace
}  // namespace slalom::test
