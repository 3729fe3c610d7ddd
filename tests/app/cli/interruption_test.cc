#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "base/file.h"
#include "policy/policy.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_sets.h"
#include "tests/app/cli/program.h"
#include "tests/metrics/http.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/wait_until.h"

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

std::vector<float> Weights(const fs::path& policy) {
  return *policy::LoadPolicy(policy).snapshot.weights;
}

bool HasCheckpoint(const fs::path& checkpoints) {
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(checkpoints, ec)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("step-") && !name.ends_with(".unfinished")) return true;
  }
  return false;
}

TEST(InterruptionTest, ADeterministicRunKilledAndResumedEndsBitIdentical) {
  const ScratchDirectory scratch;
  constexpr int kSteps = 20000;
  WriteTinyConfig(scratch.path(), kSteps, "checkpoint_steps = 2000\n");
  ASSERT_EQ(RunProgram({"train", "tiny.toml", "--name", "whole", "--no-evaluation"}, scratch.path())
                .exit_code,
            0);

  const std::vector<std::string> killed = {"train", "tiny.toml", "--name", "killed",
                                           "--no-evaluation"};
  const fs::path run = scratch.path() / "runs/killed";
  {
    BackgroundProgram program(killed, scratch.path());
    WaitUntil([&] { return HasCheckpoint(run / "checkpoints"); });
    program.Signal(SIGKILL);
    EXPECT_EQ(program.Wait(), 128 + SIGKILL);
  }
  EXPECT_FALSE(fs::exists(run / "policy.safetensors"));
  auto resumed = killed;
  resumed.push_back("--resume");
  const ProgramResult result = RunProgram(resumed, scratch.path());
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, testing::HasSubstr("resumed from"));
  EXPECT_EQ(Weights(run / "policy.safetensors"),
            Weights(scratch.path() / "runs/whole/policy.safetensors"));
}

class SignalTest : public testing::TestWithParam<int> {};

TEST_P(SignalTest, StopsSavesAndGoesOn) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  const fs::path run = scratch.path() / "runs/tiny";
  {
    BackgroundProgram program({"train", "tiny.toml"}, scratch.path());
    WaitUntil([&] { return HasLearned(run); });
    program.Signal(GetParam());
    EXPECT_EQ(program.Wait(), 128 + GetParam());
  }
  EXPECT_TRUE(HasCheckpoint(run / "checkpoints"));
  EXPECT_FALSE(Weights(run / "policy.safetensors").empty());
  EXPECT_THAT(base::ReadFile(scratch.path() / "out"), testing::HasSubstr("--resume"));
  WriteTinyConfig(scratch.path(), 1);
  EXPECT_EQ(
      RunProgram({"train", "tiny.toml", "--resume", "--no-evaluation"}, scratch.path()).exit_code,
      0);
}

INSTANTIATE_TEST_SUITE_P(AllSignals, SignalTest, testing::Values(SIGINT, SIGTERM, SIGHUP));

// A batch system tells every process of a job to end, and then a parent passes it on.
TEST(InterruptionTest, TheSameSignalAtOnceDoesNotKeepARunFromSaving) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  const fs::path run = scratch.path() / "runs/tiny";
  BackgroundProgram program({"train", "tiny.toml"}, scratch.path());
  WaitUntil([&] { return HasLearned(run); });
  for (int i = 0; i < 50; ++i) program.Signal(SIGTERM);
  EXPECT_EQ(program.Wait(), 128 + SIGTERM);
  EXPECT_TRUE(HasCheckpoint(run / "checkpoints"));
  EXPECT_TRUE(fs::exists(run / "policy.safetensors"));
}

// The kernel sends SIGHUP when a terminal goes, and the shell on it another one.
TEST(InterruptionTest, ASecondHangupDoesNotKeepARunFromSaving) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  const fs::path run = scratch.path() / "runs/tiny";
  BackgroundProgram program({"train", "tiny.toml"}, scratch.path());
  WaitUntil([&] { return fs::exists(run / "metrics.csv"); });
  program.Signal(SIGHUP);
  WaitUntil([&] {
    return base::ReadFile(scratch.path() / "err").find("terminal is gone") != std::string::npos;
  });
  program.Signal(SIGHUP);
  EXPECT_EQ(program.Wait(), 128 + SIGHUP);
  EXPECT_TRUE(fs::exists(run / "policy.safetensors"));
  EXPECT_THAT(base::ReadFile(scratch.path() / "out"), testing::HasSubstr("--resume"));
}

/// The port in "metrics at http://127.0.0.1:PORT/metrics" of a program that runs in `directory`.
int MetricsPort(const fs::path& directory) {
  int port = 0;
  WaitUntil([&] {
    const fs::path log = directory / "err";
    const std::string text = fs::exists(log) ? base::ReadFile(log) : "";
    const std::string before = "metrics at http://127.0.0.1:";
    const auto at = text.find(before);
    if (at != std::string::npos) port = std::atoi(text.c_str() + at + before.size());
    return text.find("/metrics\n") != std::string::npos;
  });
  return port;
}

/// Waits until the metrics show more than ten updates and a value of the critics.
void AwaitMetrics(int port, const std::string& labels) {
  WaitUntil([&] {
    const std::string page = Exchange(port, "GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n");
    const auto at = page.find("slalom_updates_total" + labels);
    return at != std::string::npos && std::atof(page.c_str() + at + 20 + labels.size()) > 10.0 &&
           page.find("slalom_q_mean" + labels) != std::string::npos;
  });
}

TEST(InterruptionTest, ATrainingShowsItsMetricsWhereItIsTold) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  BackgroundProgram program({"train", "tiny.toml", "--metrics", "127.0.0.1:0"}, scratch.path());
  const int port = MetricsPort(scratch.path());
  ASSERT_GT(port, 0);
  AwaitMetrics(port, "{name=\"tiny\",role=\"train\",run=\"tiny\"} ");
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 128 + SIGINT);
  EXPECT_THAT(base::ReadFile(scratch.path() / "out"), testing::HasSubstr("--metrics 127.0.0.1:0"));
}

TEST(InterruptionTest, ARunIsHeldAndShownWhileItsStagesAreTrained) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  std::vector<std::string> train = {"train", "tiny.toml", "--no-evaluation"};
  for (const char* set :
       {"courses.train=", "courses.fresh=static+wall", "learner.algorithm=distillation",
        "distillation.stages.a.courses.fresh=static", "distillation.stages.b.courses.fresh=wall"}) {
    train.insert(train.end(), {"--set", set});
  }
  std::vector<std::string> shown = train, forced = train;
  shown.insert(shown.end(), {"--metrics", "127.0.0.1:0"});
  forced.insert(forced.end(), {"--force", "--seed", "7"});
  BackgroundProgram program(shown, scratch.path());
  AwaitMetrics(MetricsPort(scratch.path()), "{name=\"a\",role=\"train\",run=\"tiny\"} ");
  const ProgramResult second =
      RunShell(fmt::format("\"$SLALOM\" '{}' >forced 2>&1; echo $?", fmt::join(forced, "' '")),
               scratch.path());
  EXPECT_EQ(second.out, "1\n");
  EXPECT_THAT(base::ReadFile(scratch.path() / "forced"),
              testing::HasSubstr("runs/tiny/lock: another process is training in this directory"));
  EXPECT_FALSE(fs::exists(scratch.path() / "runs/tiny.1"));
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 128 + SIGINT);
}

TEST(InterruptionTest, NohupOutlivesAHangup) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 20000);
  const ProgramResult result = RunShell(
      "trap '' HUP; \"$SLALOM\" train tiny.toml --no-evaluation & "
      "until [[ -e runs/tiny/metrics.csv ]]; do :; done; kill -HUP $!; wait $!",
      scratch.path());
  EXPECT_EQ(result.exit_code, 0) << result.err;
}

TEST(InterruptionTest, ATrainingOutlivesTheReaderOfItsLog) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 20000);
  const ProgramResult result = RunShell(
      "{ \"$SLALOM\" train tiny.toml --no-evaluation 2>&1; echo $? > code; } | head -n 1; "
      "cat code",
      scratch.path());
  EXPECT_THAT(result.out, testing::EndsWith("1\n")) << "what it said at the end is lost";
  EXPECT_TRUE(fs::exists(scratch.path() / "runs/tiny/policy.safetensors"));
}

/// The last line of `text` after `label`: a command to paste.
std::string CommandAfter(const std::string& text, const std::string& label) {
  const auto at = text.rfind(label);
  if (at == std::string::npos) return "echo no command after: " + label + "; false";
  const auto begin = at + label.size();
  return text.substr(begin, text.find('\n', begin) - begin);
}

TEST(ResumeTest, PrintedCommandsWorkWhenPastedWhereverTheRunLies) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 2000);
  // The script `slalom` says how it was called in this variable.
  const std::string program = scratch.path() / "a program";
  fs::create_symlink(SLALOM_PROGRAM, program);
  const std::string train = fmt::format(
      "SLALOM_COMMAND='{}' ./'a program' train tiny.toml --no-evaluation --output \"it's $HOME\" "
      "--name 'a name'",
      program);
  ASSERT_EQ(RunShell(train, scratch.path()).exit_code, 0);
  const ProgramResult finished = RunShell(train + " --resume", scratch.path());
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_THAT(finished.out, testing::HasSubstr("is finished"));
  const ProgramResult longer = RunShell(CommandAfter(finished.out, "to go on: "), scratch.path());
  ASSERT_EQ(longer.exit_code, 0) << longer.err;
  EXPECT_THAT(longer.err, testing::HasSubstr("4k steps"));

  // Another name, another place: the directory holds all that belongs to the run.
  RunShell("mv \"it's $HOME/a name\" elsewhere", scratch.path());
  for (const char* source : {"elsewhere", "elsewhere/", "elsewhere/config.toml"}) {
    const ProgramResult moved =
        RunProgram({"train", source, "--resume", "--set", "run.max_steps=4500", "--no-evaluation"},
                   scratch.path());
    ASSERT_EQ(moved.exit_code, 0) << moved.err;
    EXPECT_THAT(moved.err, testing::HasSubstr("4.5k steps"));
    EXPECT_FALSE(fs::exists(scratch.path() / "runs"));
  }
}

TEST(ResumeTest, ARunGoesOnWithoutTheFilesThatItsConfigNames) {
  const ScratchDirectory scratch;
  const fs::path first = scratch.path() / "first", second = scratch.path() / "second";
  for (const fs::path& folder : {first, second}) fs::create_directories(folder);
  WriteTinyConfig(first, 1000);
  const auto write = [](const fs::path& folder, const std::string& courses) {
    sim::CourseSet set = sim::ResolveCourses(courses, {}, 1);
    set.name = "own";
    sim::WriteCourseSet(folder / "own.courses", set);
  };
  write(first, "generated:3:2");
  const ProgramResult begun =
      RunProgram({"train", "tiny.toml", "--set", "courses.train=own.courses", "--set",
                  "courses.test=own.courses+generated:9:1"},
                 first);
  ASSERT_EQ(begun.exit_code, 0) << begun.err;
  fs::rename(first / "runs/tiny", second / "moved");
  fs::remove_all(first);
  // As a version wrote it that had another default for what nothing reads here.
  std::string recorded = base::ReadFile(second / "moved/config.toml");
  const std::size_t margin = recorded.find("margin = 0.05");
  ASSERT_NE(margin, std::string::npos);
  base::WriteFileAtomically(second / "moved/config.toml",
                            recorded.replace(margin, 13, "margin = 0.04"));

  const ProgramResult moved =
      RunProgram({"train", "moved", "--resume", "--set", "run.max_steps=2000"}, second);
  ASSERT_EQ(moved.exit_code, 0) << moved.err;
  EXPECT_THAT(moved.err, testing::HasSubstr("2k steps"));
  EXPECT_THAT(base::ReadFile(second / "moved/evaluation.json"),
              testing::HasSubstr("own.courses+generated:9:1"));
  const ProgramResult drawn = RunShell(CommandAfter(moved.out, "the worst course "), second);
  EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
  const ProgramResult scored = RunProgram(
      {"evaluate", "--policy", "moved/policy.safetensors", "--courses", "generated:3:2"}, second);
  EXPECT_THAT(scored.err, testing::HasSubstr("2 of the 2 courses are among those"));

  write(second, "generated:4:2");
  const ProgramResult changed =
      RunProgram({"train", "moved", "--resume", "--no-evaluation"}, second);
  EXPECT_EQ(changed.exit_code, 0) << changed.err;
  EXPECT_THAT(changed.err, testing::HasSubstr("own.courses is no longer as it was"));
}

TEST(ResumeTest, AFinishedRunIsScoredAgainWhereOtherScoresAreAskedFor) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 1000);
  ASSERT_EQ(RunProgram({"train", "tiny.toml"}, scratch.path()).exit_code, 0);
  std::vector<std::string> resume = {"train", "runs/tiny", "--resume"};
  EXPECT_THAT(RunProgram(resume, scratch.path()).out, testing::HasSubstr("nothing was changed"));
  resume.insert(resume.end(), {"--set", "courses.test=generated:5:2"});
  const ProgramResult scored = RunProgram(resume, scratch.path());
  EXPECT_EQ(scored.exit_code, 0) << scored.err;
  EXPECT_THAT(base::ReadFile(scratch.path() / "runs/tiny/evaluation.json"),
              testing::HasSubstr("generated:5:2"));
}

TEST(ResumeTest, ADirectoryIsResumedAndNotBegun) {
  const ScratchDirectory scratch;
  fs::create_directories(scratch.path() / "empty");
  const ProgramResult fresh = RunProgram({"train", "empty"}, scratch.path());
  EXPECT_EQ(fresh.exit_code, 1);
  EXPECT_THAT(fresh.err, testing::HasSubstr("train empty --resume"));
  const ProgramResult resumed = RunProgram({"train", "empty", "--resume"}, scratch.path());
  EXPECT_EQ(resumed.exit_code, 1);
  EXPECT_THAT(resumed.err, testing::HasSubstr("empty: there is no run to resume here"));
}

TEST(TrainingEndTest, ARunThatLearnedNothingSaysWhatToChangeAndHowToGoOn) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 100000000);
  const ProgramResult result =
      RunProgram({"train", "tiny.toml", "--set", "run.deterministic=false", "--set",
                  "run.max_seconds=0.001", "--set", "run.learning_starts=5000"},
                 scratch.path());
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_EQ(result.out, "") << "it was scored";
  EXPECT_THAT(result.err, testing::AllOf(testing::HasSubstr("nothing was learned"),
                                         testing::HasSubstr("run.max_seconds = 0.001"),
                                         testing::HasSubstr("run.learning_starts = 5000")));
  EXPECT_THAT(CommandAfter(result.err, "To go on: "),
              testing::HasSubstr("train runs/tiny --resume --set run.max_seconds="));
}

TEST(TrainingEndTest, ADeterministicRunNamesAllThatItNeeds) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 2000);
  const std::string command =
      "$SLALOM train tiny.toml --deterministic --no-evaluation --set run.max_seconds=90 ";
  const ProgramResult refused = RunShell(command, scratch.path());
  EXPECT_EQ(refused.exit_code, 1);
  const std::size_t options = refused.err.find("--set ");
  ASSERT_NE(options, std::string::npos) << refused.err;
  const ProgramResult result = RunShell(command + refused.err.substr(options), scratch.path());
  EXPECT_EQ(result.exit_code, 0) << refused.err << result.err;
}

}  // namespace
}  // namespace slalom::test
