#include "base/child_process.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/scratch_directory.h"

namespace slalom::base {
namespace {

constexpr std::chrono::minutes kLong{1};

TEST(ChildProcessTest, GivesTheExitCodeAndAppendsToTheLog) {
  const test::ScratchDirectory scratch;
  const auto log = scratch.path() / "log";
  WriteFileAtomically(log, "before\n");
  ChildProcess child({.arguments = {"sh", "-c", "echo $GREETING; echo error >&2; exit 7"},
                      .log = log,
                      .environment = {"GREETING=hello"}});
  EXPECT_EQ(child.Wait(kLong), 7);
  EXPECT_EQ(child.Wait(kLong), 7) << "again";
  EXPECT_EQ(ReadFile(log), "before\nhello\nerror\n");
}

TEST(ChildProcessTest, ASignalEndsIt) {
  ChildProcess child({.arguments = {"sleep", "1000"}});
  EXPECT_EQ(child.Wait(std::chrono::milliseconds(0)), std::nullopt);
  child.Signal(SIGTERM);
  EXPECT_EQ(child.Wait(kLong), 128 + SIGTERM);
}

TEST(ChildProcessTest, KeepsToItsCores) {
  const test::ScratchDirectory scratch;
  const int core = AvailableCores().back();
  ChildProcess child({.arguments = {"sh", "-c", "grep Cpus_allowed_list /proc/self/status"},
                      .log = scratch.path() / "log",
                      .cores = {core}});
  EXPECT_EQ(child.Wait(kLong), 0);
  EXPECT_EQ(ReadFile(scratch.path() / "log"), "Cpus_allowed_list:\t" + std::to_string(core) + "\n");
}

TEST(ChildProcessTest, AProgramThatIsNotThereIsAnError) {
  EXPECT_THROW(ChildProcess({.arguments = {"no-such-program-anywhere"}}), ProgramMissing);
  EXPECT_THROW(ChildProcess({.arguments = {"true"}, .log = "/no/such/directory/log"}), Error);
}

// A variable takes the place of that of its name, and of no other whose name begins or goes on so.
TEST(ChildProcessTest, OtherVariablesOfTheEnvironmentStay) {
  for (const char* name : {"SLALOM_A", "SLALOM_AB", "SLALOM_ABC"}) ::setenv(name, "ours", 1);
  const test::ScratchDirectory scratch;
  const auto log = scratch.path() / "log";
  ChildProcess child({.arguments = {"sh", "-c", "echo $SLALOM_A $SLALOM_AB $SLALOM_ABC"},
                      .log = log,
                      .environment = {"SLALOM_AB=new"}});
  EXPECT_EQ(child.Wait(), 0);
  EXPECT_EQ(ReadFile(log), "ours new ours\n");
  for (const char* name : {"SLALOM_A", "SLALOM_AB", "SLALOM_ABC"}) ::unsetenv(name);
}

// A role must not take the input of the console, nor be deaf to signals that this thread blocks.
TEST(ChildProcessTest, OneWithALogReadsNothingAndBlocksNoSignal) {
  const test::ScratchDirectory scratch;
  const auto log = scratch.path() / "log";
  const MemoryFile input;
  const int before = ::dup(STDIN_FILENO);
  ::dup2(input.descriptor(), STDIN_FILENO);
  sigset_t term, mask;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &term, &mask);
  // No shell, which would unblock them by itself.
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"readlink", "/proc/self/fd/0"},
        std::vector<std::string>{"grep", "SigBlk", "/proc/self/status"}}) {
    EXPECT_EQ(ChildProcess({.arguments = arguments, .log = log}).Wait(), 0);
  }
  pthread_sigmask(SIG_SETMASK, &mask, nullptr);
  ::dup2(before, STDIN_FILENO);
  ::close(before);
  EXPECT_EQ(ReadFile(log), "/dev/null\nSigBlk:\t0000000000000000\n");
}

TEST(ChildProcessTest, GetsFilesUnderItsOwnNumbers) {
  // Each has the number that the child has for the other one.
  const MemoryFile a, b;
  ChildProcess child(
      {.arguments = {"sh", "-c",
                     "echo a >/proc/self/fd/" + std::to_string(b.descriptor()) +
                         "; echo b >/proc/self/fd/" + std::to_string(a.descriptor())},
       .files = {{a.descriptor(), b.descriptor()}, {b.descriptor(), a.descriptor()}}});
  EXPECT_EQ(child.Wait(), 0);
  EXPECT_EQ(a.Content(), "a\n");
  EXPECT_EQ(b.Content(), "b\n");
}

TEST(ChildProcessTest, AFileThatIsNotOpenIsAnError) {
  EXPECT_THROW(ChildProcess({.arguments = {"true"}, .files = {{-1, 3}}}), Error);
}

TEST(RunProgramTest, GivesWhatItWroteAndHowItEnded) {
  const ProgramResult result = RunProgram({"sh", "-c", "cat; echo out; echo error >&2; exit 3"});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_EQ(result.output, "out\n");
  EXPECT_EQ(result.errors, "error\n");
  EXPECT_EQ(RunProgram({"sh", "-c", "kill -9 $$"}).exit_code, 128 + SIGKILL);
  EXPECT_THROW(RunProgram({"no-such-program-anywhere"}), ProgramMissing);
}

TEST(RunProgramTest, GivesLongOutputsWhole) {
  const ProgramResult result = RunProgram({"sh", "-c", "seq 40000; seq 30000 >&2"});
  const auto expect_numbers = [](const std::string& text, int last) {
    std::istringstream numbers(text);
    int expected = 0;
    for (int number = 0; numbers >> number;) ASSERT_EQ(number, ++expected);
    EXPECT_EQ(expected, last);
  };
  expect_numbers(result.output, 40000);
  expect_numbers(result.errors, 30000);
}

TEST(ChildProcessTest, DiesWithThisProgramHoweverThatEnds) {
  int pipe[2];
  ASSERT_EQ(::pipe(pipe), 0);
  const pid_t parent = ::fork();
  if (parent == 0) {
    ::close(pipe[0]);
    // Holds the pipe open as long as it lives.
    ChildProcess child({.arguments = {"sleep", "1000"}});
    ::raise(SIGKILL);
  }
  ::close(pipe[1]);
  ::waitpid(parent, nullptr, 0);
  char byte = 0;
  EXPECT_EQ(::read(pipe[0], &byte, 1), 0) << "the end of the pipe: nobody holds it open";
  ::close(pipe[0]);
}

}  // namespace
}  // namespace slalom::base
