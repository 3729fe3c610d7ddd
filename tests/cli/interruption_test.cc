#include <gmock/gmock.h>
#include <signal.h>

#include <thread>

#include "base/file.h"
#include "policy/policy.h"
#include "tests/cli/program.h"
#include "tests/support/scratch_directory.h"

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

std::vector<float> Weights(const fs::path& policy) {
  return *policy::LoadPolicy(policy).snapshot.weights;
}

/// Waits until `condition` holds; the test's time limit ends it otherwise.
template <class Condition>
void WaitUntil(Condition condition) {
  while (!condition()) std::this_thread::yield();
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
    WaitUntil([&] {
      return fs::exists(run / "metrics.csv") && base::ReadFile(run / "metrics.csv").size() > 500;
    });
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

INSTANTIATE_TEST_SUITE_P(BothSignals, SignalTest, testing::Values(SIGINT, SIGTERM));

}  // namespace
}  // namespace slalom::test
