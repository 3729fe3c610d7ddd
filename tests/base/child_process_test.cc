#include "base/child_process.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>

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
