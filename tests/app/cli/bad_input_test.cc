#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"
#include "policy/policy.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

/// Bad input gets one clear line that names the file, the key or line and what was expected, and a
/// non-zero exit code.

namespace slalom::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class BadInputTest : public ::testing::Test {
 protected:
  BadInputTest() { WriteTinyConfig(scratch_.path(), 1500); }

  void ExpectError(const std::vector<std::string>& arguments,
                   const ::testing::Matcher<std::string>& message, int exit_code = 1) {
    const ProgramResult result = RunProgram(arguments, scratch_.path());
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_THAT(result.err, message);
    EXPECT_THAT(result.err, ::testing::Not(HasSubstr("terminate called")));
  }

  void Write(const std::string& name, const std::string& content) {
    base::WriteFileAtomically(scratch_.path() / name, content);
  }

  /// A trained policy, policy.safetensors below runs/tiny.
  void Train() {
    const ProgramResult result = RunProgram({"train", "tiny.toml"}, scratch_.path());
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  ScratchDirectory scratch_;
};

TEST_F(BadInputTest, AMistypedKeyIsNamedWithItsLineAndTheLikelyRightOne) {
  Write("c.toml", "[run]\nseed = 1\n[learner]\ngama = 0.9\n");
  ExpectError({"train", "c.toml"}, AllOf(HasSubstr("c.toml:4"), HasSubstr("'learner.gama'"),
                                         HasSubstr("did you mean 'learner.gamma'?")));
}

TEST_F(BadInputTest, APlanAndAConfigAreToldApart) {
  Write("plan.toml", "[sweep]\npreset = \"tiny.toml\"\n");
  ExpectError({"train", "plan.toml"}, AllOf(HasSubstr("plan.toml: is the plan of a sweep"),
                                            HasSubstr("slalom sweep run plan.toml")));
  ExpectError({"sweep", "run", "tiny.toml"}, AllOf(HasSubstr("tiny.toml: has no section [sweep]"),
                                                   HasSubstr("slalom train tiny.toml")));
  ExpectError({"evaluate", "--policy", "tiny.toml", "--courses", "static-test"},
              HasSubstr("tiny.toml: is no safetensors file"));
}

TEST_F(BadInputTest, AValueOutOfRangeSaysTheRange) {
  Write("c.toml", "[learner]\ngamma = 1.5\n");
  ExpectError({"train", "c.toml"}, AllOf(HasSubstr("c.toml:2: learner.gamma is 1.5"),
                                         HasSubstr("expected a number in [0, 1]")));
  ExpectError({"train", "tiny.toml", "--set", "learner.batch_size=many"},
              HasSubstr("expected an integer"));
}

TEST_F(BadInputTest, BrokenTomlIsNamedWithItsLine) {
  Write("c.toml", "[run]\nseed = = 1\n");
  ExpectError({"train", "c.toml"}, AllOf(HasSubstr("c.toml:2"), HasSubstr("not valid TOML")));
}

TEST_F(BadInputTest, SettingsThatContradictEachOtherAreRefused) {
  ExpectError({"train", "tiny.toml", "--set", "network.sectors=7"}, HasSubstr("sectors"));
  ExpectError({"train", "tiny.toml", "--set", "actor.noise_min=0.5"}, HasSubstr("noise_min"));
  ExpectError({"train", "tiny.toml", "--set", "environment.robot.control_rate=33"},
              HasSubstr("control_rate"));
}

TEST_F(BadInputTest, FieldsThatCannotBeDrawnAreNamedWithTheReason) {
  Write("c.toml", "base = \"tiny.toml\"\n[environment.randomize]\n\"robot.command_delay\" = 0.1\n");
  ExpectError({"train", "c.toml"},
              AllOf(HasSubstr("c.toml:3: environment.randomize.\"robot.command_delay\": found 0.1"),
                    HasSubstr("two numbers in [0, 1] s")));
  ExpectError({"train", "tiny.toml", "--set", "environment.randomize.\"lidar.num_beams\"=[1,2]"},
              AllOf(HasSubstr("--set environment.randomize.\"lidar.num_beams\"=[1,2]"),
                    HasSubstr("it is the shape of an observation")));
  ExpectError({"evaluate", "--agent", "dwa", "--courses", "static-train-5", "--set",
               "environment.randomize.episode.max_steps=[1,2]"},
              HasSubstr("in evaluations the protocol's"));
}

TEST_F(BadInputTest, MethodsThatMakeNoSenseAreRefusedWithTheReason) {
  const auto refuse = [&](std::vector<std::string> settings,
                          const ::testing::Matcher<std::string>& message) {
    std::vector<std::string> arguments{"train", "tiny.toml"};
    for (std::string& setting : settings) {
      arguments.insert(arguments.end(), {"--set", std::move(setting)});
    }
    ExpectError(arguments, message);
  };
  refuse({"learner.algorithm=ppo"}, AllOf(HasSubstr("learner.algorithm"), HasSubstr("td3")));
  refuse({"network.encoder=lstm"}, AllOf(HasSubstr("network.encoder"), HasSubstr("gru")));
  refuse({"constraint.limit=0.05"},
         AllOf(HasSubstr("constraint.limit is 0.05"), HasSubstr("constraint.kind = \"none\"")));
  refuse({"learner.quantiles=30"}, AllOf(HasSubstr("learner.quantiles is 30, expected its default"),
                                         HasSubstr("it is read with \"tqc\" alone")));
  refuse({"constraint.proportional_gain=1"}, HasSubstr("constraint.proportional_gain is 1"));
  refuse({"constraint.kind=fixed"}, HasSubstr("constraint.multiplier is 0"));
  refuse({"constraint.kind=lagrangian", "constraint.learning_rate=0"},
         HasSubstr("the multiplier would never move"));
  refuse({"constraint.kind=lagrangian", "constraint.limit=1"},
         HasSubstr("constraint.limit is 1, expected less than 1"));
  refuse({"constraint.kind=lagrangian", "constraint.multiplier_max=0"},
         HasSubstr("constraint.multiplier_max is 0"));
  refuse({"imagination.as_published=true"}, HasSubstr("imagination.as_published is true"));
  refuse({"imagination.kind=dyna"}, HasSubstr("expected model.kind = \"deterministic\""));
  const std::string model = "model.kind=probabilistic";
  refuse({model, "imagination.kind=mbpo", "imagination.imagined_batches=0"},
         HasSubstr("imagination.imagined_batches is 0"));
  refuse({model, "imagination.kind=dyna", "imagination.imagined_batches=0"},
         HasSubstr("imagination.imagined_batches is 0"));
  refuse({model, "imagination.kind=dyna", "imagination.final_rollout_steps=4"},
         HasSubstr("imagination.final_rollout_steps is 4"));
  refuse({model, "imagination.kind=mbpo", "imagination.real_ratio=1"},
         HasSubstr("imagination.real_ratio is 1"));
  refuse({model, "imagination.kind=mbpo", "imagination.real_ratio=0.999"},
         HasSubstr("imagination.real_ratio is 0.999"));
  refuse({model, "imagination.kind=mbpo", "imagination.buffer_capacity=1000000000"},
         AllOf(HasSubstr("imagination.buffer_capacity is 1000000000: cannot reserve"),
               testing::Not(HasSubstr("frame #"))));
  refuse({model, "imagination.kind=dyna", "imagination.rollout_steps=0"},
         AllOf(HasSubstr("imagination.rollout_steps is 0"), HasSubstr("[1, 100]")));
  refuse({model, "imagination.kind=mbpo", "imagination.real_ratio=1.5"},
         AllOf(HasSubstr("imagination.real_ratio is 1.5"), HasSubstr("[0, 1]")));
  refuse({model, "imagination.kind=dyna", "learner.prioritized=true", "run.deterministic=false"},
         HasSubstr("no priority"));
  refuse({model, "mpc.enabled=true", "constraint.kind=lagrangian"}, HasSubstr("predicts no cost"));
  refuse({model, "mpc.enabled=true", "mpc.horizon=0"}, HasSubstr("mpc.horizon is 0"));
  refuse({"mpc.enabled=true"}, HasSubstr("mpc.enabled"));
  refuse({model, "network.encoder=gru", "network.encoder_layers=[16]", "model.encoder_layers=[]"},
         HasSubstr("model.encoder_layers: found []"));
}

TEST_F(BadInputTest, AKeyOfAnotherPlannerIsRefused) {
  const auto refuse = [&](const char* agent, const char* set, const char* message) {
    ExpectError({"evaluate", "--agent", agent, "--courses", "static-train-5", "--set", set},
                HasSubstr(message));
  };
  refuse("dwa", "teb.robot.max_linear=1", "dwa does not read teb.robot.max_linear");
  refuse("oracle", "navigation.footprint.length=1", "those of [navigation] are a planner's");
}

TEST_F(BadInputTest, AServiceWhoseMessagesWouldNotFitIsRefused) {
  ExpectError({"actor", "--config", "tiny.toml", "--set", "actor_service.chunk_rows=16384", "--set",
               "environment.lidar.num_beams=720"},
              AllOf(HasSubstr("actor_service.chunk_rows is 16384"),
                    HasSubstr("replay_server.max_message_bytes")));
}

TEST_F(BadInputTest, ReplayDataOfAnotherRunAreRefused) {
  const ProgramResult begun =
      RunProgram({"config", "print", "tiny.toml", "--set", "run.seed=8"}, scratch_.path());
  base::MakeDirectories(scratch_.path() / "state/replay");
  base::WriteFileAtomically(scratch_.path() / "state/replay/config.toml", begun.out);
  ExpectError({"replay", "--config", "tiny.toml", "--set", "service.state=state"},
              AllOf(HasSubstr("state/replay"), HasSubstr("of another run"),
                    HasSubstr("run.seed is"), HasSubstr("expected 8")));
}

TEST_F(BadInputTest, APolicyThatCannotPlanIsRefused) {
  Train();
  const std::string path = "runs/tiny/policy.safetensors";
  ExpectError({"evaluate", "--policy", path, "--courses", "generated:1:1", "--set",
               "mpc.enabled=true", "--set", "mpc.learning_starts=0"},
              AllOf(HasSubstr(path), HasSubstr("carries no transition model")));
  const ProgramResult result =
      RunProgram({"train", "tiny.toml", "--name", "planner", "--set", "model.kind=deterministic",
                  "--set", "model.encoder_layers=[]", "--set", "model.head_layers=[8]"},
                 scratch_.path());
  ASSERT_EQ(result.exit_code, 0) << result.err;
  ExpectError(
      {"evaluate", "--policy", "runs/planner/policy.safetensors", "--courses", "generated:1:1",
       "--set", "mpc.enabled=true"},
      AllOf(HasSubstr("runs/planner/policy.safetensors"), HasSubstr("mpc.learning_starts = 1000")));
  Write("constrained.toml", "base = \"tiny.toml\"\n[constraint]\nkind = \"lagrangian\"\n");
  ExpectError({"evaluate", "--policy", path, "--courses", "generated:1:1", "--config",
               "constrained.toml", "--set", "mpc.enabled=true"},
              AllOf(HasSubstr("constraint"), HasSubstr("mpc")));
}

TEST_F(BadInputTest, WhatAPolicyWasTrainedWithCannotBeSetAnew) {
  Train();
  const auto refuse = [&](const char* assignment, const auto& matcher) {
    ExpectError({"evaluate", "--policy", "runs/tiny/policy.safetensors", "--courses",
                 "generated:1:1", "--set", assignment},
                matcher);
  };
  for (const char* assignment : {"network.history=4", "network.sectors=6", "learner.gamma=0.5"}) {
    refuse(assignment, AllOf(HasSubstr(assignment), HasSubstr("when it was trained")));
  }
  refuse("network.wings=2", HasSubstr("network.wings"));
  refuse("mpc.horizon=9", AllOf(HasSubstr("mpc.horizon=9"), HasSubstr("mpc.enabled=true")));
  refuse("environment.lidar.num_beams=48", AllOf(HasSubstr("720 beams"), HasSubstr("48 beams")));
}

TEST_F(BadInputTest, ANameThatNoRoleCanHaveIsRefused) {
  ExpectError({"actor", "--config", "tiny.toml", "--name", "two words"},
              AllOf(HasSubstr("service.name is 'two words'"), HasSubstr("letters, digits")));
}

TEST_F(BadInputTest, MissingFilesAreNamed) {
  ExpectError({"train", "none.toml"}, HasSubstr("none.toml"));
  ExpectError({"evaluate", "--policy", "none.safetensors", "--courses", "static-test"},
              HasSubstr("none.safetensors"));
  ExpectError({"train", "tiny.toml", "--set", "courses.train=no-such-set"},
              AllOf(HasSubstr("no-such-set"), HasSubstr("static-train-50")));
  ExpectError({"train", "tiny.toml", "--resume"}, HasSubstr("no run to resume"));
}

TEST_F(BadInputTest, CourseFilesCutOrChangedAreRefused) {
  ASSERT_EQ(
      RunProgram({"courses", "generate", "--courses", "generated:1:2", "--output", "made.courses"},
                 scratch_.path())
          .exit_code,
      0);
  const std::string content = base::ReadFile(scratch_.path() / "made.courses");
  Write("cut.courses", content.substr(0, content.size() / 2));
  ExpectError({"train", "tiny.toml", "--set", "courses.train=cut.courses"},
              HasSubstr("cut.courses:"));
  std::string changed = content;
  const auto digit = changed.find_first_of("123456789", changed.size() / 2);
  changed[digit] = changed[digit] == '9' ? '1' : static_cast<char>(changed[digit] + 1);
  Write("changed.courses", changed);
  ExpectError({"courses", "show", "changed.courses"}, HasSubstr("changed.courses"));
}

TEST_F(BadInputTest, PoliciesCutChangedOrOfAnotherKindAreRefused) {
  Train();
  const auto path = scratch_.path() / "runs/tiny/policy.safetensors";
  const std::string content = base::ReadFile(path);
  Write("cut.safetensors", content.substr(0, content.size() - 100));
  ExpectError({"evaluate", "--policy", "cut.safetensors", "--courses", "generated:1:1"},
              HasSubstr("cut.safetensors"));
  std::string changed = content;
  changed[changed.size() - 50] ^= 1;
  Write("changed.safetensors", changed);
  ExpectError({"evaluate", "--policy", "changed.safetensors", "--courses", "generated:1:1"},
              AllOf(HasSubstr("changed.safetensors"), HasSubstr("checksum")));
  Write("text.safetensors", "this is no policy at all");
  ExpectError({"evaluate", "--policy", "text.safetensors", "--courses", "generated:1:1"},
              HasSubstr("text.safetensors"));
  ExpectError({"evaluate", "--policy", path.string(), "--courses", "generated:1:1", "--set",
               "environment.lidar.num_beams=360"},
              AllOf(HasSubstr("policy.safetensors"), HasSubstr("360")));
}

TEST_F(BadInputTest, WhatAnEvaluationDoesNotKnowIsNamedWithWhatThereIs) {
  const auto evaluate = [&](std::vector<std::string> more,
                            const ::testing::Matcher<std::string>& message) {
    std::vector<std::string> arguments{"evaluate", "--agent", "dwa", "--courses", "generated:1:1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ExpectError(arguments, message);
  };
  ExpectError({"evaluate", "--agent", "flying", "--courses", "generated:1:1"},
              AllOf(HasSubstr("'flying'"), HasSubstr("dwa")));
  ExpectError({"evaluate", "--agent", "dwa", "--courses", "no-such-set"},
              AllOf(HasSubstr("no-such-set"), HasSubstr("static-test")));
  evaluate({"--protocol", "none"},
           AllOf(HasSubstr("'none'"), HasSubstr("'paper', 'dwa-runs', 'barn-challenge'")));
  evaluate({"--set", "environment.episode.max_steps=5"}, HasSubstr("evaluation.time_limit"));
  evaluate({"--set", "navigation.wings=2"}, HasSubstr("navigation.wings"));
  evaluate({"--profile", "none.toml"}, HasSubstr("none.toml"));
  Write("profile.toml", "[environment.robot]\nmass = 3.0\n[dwa]\nwings = 2\n");
  evaluate({"--profile", "profile.toml"},
           AllOf(HasSubstr("profile.toml:4"), HasSubstr("'dwa.wings'"),
                 HasSubstr("only [environment] and [guard]")));
}

TEST_F(BadInputTest, ResultsThatCannotBeComparedAreRefused) {
  const auto evaluate = [&](const std::string& output, const std::string& protocol) {
    const ProgramResult result =
        RunProgram({"evaluate", "--agent", "dwa", "--courses", "generated:1:1", "--episodes", "1",
                    "--set", "evaluation.time_limit=2", "--protocol", protocol, "--output", output},
                   scratch_.path());
    ASSERT_EQ(result.exit_code, 0) << result.err;
  };
  evaluate("a", "paper");
  evaluate("b", "dwa-runs");
  ExpectError({"report", "a", "b", "--output", "report"},
              AllOf(HasSubstr("a/evaluation.json"), HasSubstr("b/evaluation.json"),
                    HasSubstr("collision_ends of the protocol is true in the first and false")));
  const std::string text = base::ReadFile(scratch_.path() / "b/evaluation.json");
  Write("b/evaluation.json", text.substr(0, text.size() / 2));
  ExpectError({"report", "a", "b", "--output", "report"},
              AllOf(HasSubstr("b/evaluation.json"), HasSubstr("cut short")));
  std::string newer = text;
  newer.replace(newer.find("\"version\": 2"), 12, "\"version\": 7");
  Write("b/evaluation.json", newer);
  ExpectError({"report", "b", "a", "--output", "report"},
              AllOf(HasSubstr("b/evaluation.json"), HasSubstr("version is 7, expected 2")));
  EXPECT_FALSE(std::filesystem::exists(scratch_.path() / "report"));
}

TEST_F(BadInputTest, ATimeLimitInWhichSuccessIsNeverLookedForIsRefused) {
  ExpectError({"evaluate", "--agent", "dwa", "--courses", "generated:1:1", "--protocol", "dwa-runs",
               "--set", "evaluation.time_limit=1"},
              HasSubstr("evaluation.time_limit is 1 s, expected at least 1.13"));
}

TEST_F(BadInputTest, AResumedRunRefusesOtherSettings) {
  Train();
  ExpectError({"train", "tiny.toml", "--resume", "--set", "learner.gamma=0.9"},
              HasSubstr("learner.gamma was 0.99 when the run began and is 0.9 now"));
}

TEST_F(BadInputTest, NoPermissionIsSaid) {
  // Root may write anywhere but into what is no directory.
  Write("runs", "a file");
  ExpectError({"train", "tiny.toml"}, HasSubstr("runs"));
}

TEST_F(BadInputTest, TheCommandLineIsChecked) {
  ExpectError({}, HasSubstr("subcommand"), 2);
  ExpectError({"fly"}, HasSubstr("fly"), 2);
  ExpectError({"evaluate", "--policy", "p"}, HasSubstr("--courses"), 2);
  ExpectError({"evaluate", "--policy", "p", "--courses", "c", "--episodes", "-3"},
              HasSubstr("--episodes"), 2);
  ExpectError({"evaluate", "--courses", "c"}, AllOf(HasSubstr("--policy"), HasSubstr("--agent")),
              2);
  ExpectError({"evaluate", "--courses", "c", "--policy", "p", "--agent", "dwa"},
              AllOf(HasSubstr("--policy"), HasSubstr("--agent")), 2);
  ExpectError({"report", "--output", "a"}, HasSubstr("nothing to report"));
}

// As from a variable that is not set.
TEST_F(BadInputTest, AnEmptyValueIsRefused) {
  ExpectError({"train", "tiny.toml", "--name=", "--no-evaluation"}, HasSubstr("--name="), 2);
  ExpectError({"evaluate", "--agent", "dwa", "--courses=", "--episodes", "1"},
              HasSubstr("--courses="), 2);
  ExpectError({"courses", "generate", "--courses", "", "--output", "a"}, HasSubstr("--courses"), 2);
  ExpectError({"train", "tiny.toml", "--no-evaluation="}, HasSubstr("--no-evaluation="), 2);
  ExpectError({"backup", "state", ""}, HasSubstr("argument 3 is empty"), 2);
  EXPECT_FALSE(std::filesystem::exists(scratch_.path() / "runs"));
}

TEST_F(BadInputTest, AFullDiskKeepsTheLastGoodCheckpointAndTheNewestPolicy) {
  // A file-size limit stands for the full disk: the replay buffer of the longer run does not fit.
  Train();
  WriteTinyConfig(scratch_.path(), 4000);
  const ProgramResult full = RunShell(
      "trap '' XFSZ; ulimit -f 1000; exec $SLALOM train tiny.toml --resume", scratch_.path());
  EXPECT_EQ(full.exit_code, 1) << full.err;
  EXPECT_THAT(full.err, AllOf(HasSubstr("checkpoints/replay"), HasSubstr("File too large")));
  const auto policy = scratch_.path() / "runs/tiny/policy.safetensors";
  EXPECT_EQ(policy::LoadPolicy(policy).metadata.at("steps"), "4000");
  const ProgramResult again = RunProgram({"train", "tiny.toml", "--resume"}, scratch_.path());
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

TEST_F(BadInputTest, AMistakeInTheLastPlanOfAListShowsBeforeTheFirstRuns) {
  const std::string plan = "[sweep]\npreset = \"tiny.toml\"\nseeds = [1]\n";
  Write("first.toml", plan + "[[score]]\nname = \"test\"\ncourses = \"generated:4:2\"\n");
  Write("last.toml", plan + "[[score]]\nname = \"test\"\ncourses = \"statc-test\"\n");
  Write("list.toml", "[sweep]\nplans = [\"first.toml\", \"last.toml\"]\n");
  ExpectError({"sweep", "run", "list.toml"},
              AllOf(HasSubstr("last.toml"), HasSubstr("statc-test")));
  EXPECT_FALSE(base::Exists(scratch_.path() / "runs/sweeps/cells"));
}

}  // namespace
}  // namespace slalom::test
