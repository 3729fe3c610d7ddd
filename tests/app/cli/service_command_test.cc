#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/wait_until.h"

namespace slalom::test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

TEST(ServiceCommandTest, ATrainingIsStoppedGoesOnAndIsScored) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  const std::vector<std::string> command = {
      "service",          "tiny.toml", "--actors", "2",
      "--replay-servers", "2",         "--set",    "run.deterministic=false"};
  const fs::path state = scratch.path() / "state";
  {
    BackgroundProgram program(command, scratch.path());
    WaitUntil([&] { return HasLearned(state / "learner"); });
    const ProgramResult second = RunProgram(command, scratch.path());
    EXPECT_EQ(second.exit_code, 1);
    EXPECT_THAT(second.err, HasSubstr("state/service.lock: another `slalom service` works"));
    const ProgramResult status =
        RunProgram({"status", "--config", "state/service.toml"}, scratch.path());
    EXPECT_THAT(status.out, AllOf(HasSubstr("learner"), HasSubstr("actor-1"), HasSubstr("actor-2"),
                                  HasSubstr("replay-1"), HasSubstr("all is well")));
    program.Signal(SIGINT);
    EXPECT_EQ(program.Wait(), 128 + SIGINT);
  }
  EXPECT_THAT(
      base::ReadFile(scratch.path() / "out"),
      HasSubstr("service tiny.toml --actors 2 --replay-servers 2 --set run.deterministic=false\n"));
  EXPECT_FALSE(fs::exists(state / "learner/evaluation.json"));
  for (const char* name : {"learner", "replay", "replay-1", "actor-1", "actor-2"}) {
    EXPECT_THAT(base::ReadFile(state / "logs" / (std::string(name) + ".log")), HasSubstr("info"));
  }

  // Each actor's steps are in the table of its own server.
  EXPECT_TRUE(fs::exists(state / "actors/actor-1/replay-1/ledger"));
  EXPECT_TRUE(fs::exists(state / "actors/actor-2/ledger"));
  for (const char* name : {"replay", "replay-1", "learner"}) {
    EXPECT_THAT(base::ReadFile(state / (std::string(name) + ".endpoint")), HasSubstr("ipc://"));
  }

  WriteTinyConfig(scratch.path(), 1);  // So that it is finished.
  const ProgramResult finished = RunProgram(command, scratch.path());
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_THAT(finished.out, HasSubstr("state/learner/policy.safetensors"));
  EXPECT_TRUE(fs::exists(state / "learner/evaluation.json"));
}

TEST(ServiceCommandTest, AProcessThatFailsIsNamedWithItsLog) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  const ProgramResult result =
      RunProgram({"service", "tiny.toml", "--set", "run.deterministic=false", "--evaluator",
                  "--set", "evaluator_service.courses=none-such"},
                 scratch.path());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("`slalom evaluator` ended with exit code 1; "
                                    "state/logs/evaluator.log says why"));
  EXPECT_THAT(base::ReadFile(scratch.path() / "state/logs/evaluator.log"), HasSubstr("none-such"));
}

}  // namespace
}  // namespace slalom::test
