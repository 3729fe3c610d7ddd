#include "actor/service/ledger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>

#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::actor {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::int64_t Lost(const StepAccount& account) {
  return account.lost[0] + account.lost[1] + account.lost[2];
}

// A store into a page of a mapped file that the disk has no room for would end the process by
// SIGBUS, without a word. So its blocks are allocated before.
TEST(LedgerTest, AFullDiskIsNamedAtTheStart) {
  const test::ScratchDirectory scratch;
  const test::FailingCalls failing(
      {.function = "posix_fallocate", .path = "*/ledger", .error = ENOSPC},
      scratch.path() / "count");
  try {
    const Ledger ledger(scratch.path() / "ledger");
    FAIL() << "the disk is full";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("/ledger"), HasSubstr("No space left")));
  }
  EXPECT_EQ(failing.num_calls(), 1);
  const Ledger ledger(scratch.path() / "ledger");  // Once there is room.
}

TEST(LedgerTest, WhatIsMadeIsAcceptedPendingOrLostWhateverHappens) {
  const test::ScratchDirectory scratch;
  base::Random random(7);
  std::int64_t made = 0;
  auto ledger = std::make_unique<Ledger>(scratch.path() / "ledger");
  std::uint64_t session = 0;
  std::int64_t unacknowledged = 0;
  for (int i = 0; i < 2000; ++i) {
    switch (random.UniformInt(5)) {
      case 0:
      case 1: {
        const auto steps = static_cast<std::int64_t>(random.UniformInt(100));
        ledger->AddMade(steps);
        made += steps;
        unacknowledged += steps;
        break;
      }
      case 2: {
        unacknowledged -= static_cast<std::int64_t>(random.UniformInt(unacknowledged + 1));
        ledger->AcknowledgeAllBut(unacknowledged);
        // What a spool still holds though it was acknowledged does not count again.
        ledger->AcknowledgeAllBut(unacknowledged +
                                  static_cast<std::int64_t>(random.UniformInt(100)));
        ASSERT_EQ(ledger->account().pending, unacknowledged);
        break;
      }
      case 3:
        ledger.reset();
        ledger = std::make_unique<Ledger>(scratch.path() / "ledger");
        break;
      case 4:
        // The server has what it has, more or less than was acknowledged.
        ledger->BeginSession(++session, static_cast<std::int64_t>(random.UniformInt(3000)),
                             LossReason::kKilled);
        unacknowledged = 0;
        EXPECT_EQ(ledger->account().pending, 0);
        break;
    }
    const StepAccount account = ledger->account();
    ASSERT_EQ(account.made, made);
    ASSERT_EQ(account.made, account.accepted + account.pending + Lost(account)) << "step " << i;
    ASSERT_EQ(ledger->session(), session);
    ASSERT_GE(account.pending, 0);
  }
}

TEST(LedgerTest, LossesGoByTheirReason) {
  const test::ScratchDirectory scratch;
  Ledger ledger(scratch.path() / "ledger");
  ledger.BeginSession(1, 0, LossReason::kKilled);
  ledger.AddMade(100);
  ledger.AcknowledgeAllBut(40);
  // The server has 70: ten acknowledgements were still under way when the actor was killed.
  ledger.BeginSession(2, 70, LossReason::kKilled);
  EXPECT_EQ(ledger.account().accepted, 70);
  EXPECT_THAT(ledger.account().lost, testing::ElementsAre(30, 0, 0));
  ledger.AddMade(50);
  ledger.AcknowledgeAllBut(0);
  // Another server, which knows of nothing.
  ledger.BeginSession(3, 0, LossReason::kReplaced);
  EXPECT_THAT(ledger.account().lost, testing::ElementsAre(30, 0, 50));
  ledger.AddMade(8);
  ledger.BeginSession(4, 0, LossReason::kReplaced);
  EXPECT_THAT(ledger.account().lost, testing::ElementsAre(30, 8, 50));
}

TEST(LedgerTest, AKilledProcessLeavesWhatItCounted) {
  const test::ScratchDirectory scratch;
  int told[2];
  ASSERT_EQ(::pipe(told), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Ledger ledger(scratch.path() / "ledger");
    ledger.BeginSession(1, 0, LossReason::kKilled);
    for (std::int64_t made = 0;; made += 3) {
      // A pipe that is full would keep the counting back: told only now and then.
      if (made % 3000 == 0 && ::write(told[1], &made, sizeof(made)) < 0) ::_exit(1);
      ledger.AddMade(3);
      ledger.AcknowledgeAllBut(0);
    }
  }
  std::int64_t last = 0;
  for (int i = 0; i < 100; ++i) ASSERT_EQ(::read(told[0], &last, sizeof(last)), sizeof(last));
  ASSERT_EQ(::kill(child, SIGKILL), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ::close(told[0]);
  ::close(told[1]);
  const Ledger ledger(scratch.path() / "ledger");
  EXPECT_EQ(ledger.session(), 1u);
  EXPECT_GE(ledger.account().made, last);
  // Killed between the two counts at most.
  EXPECT_LE(ledger.account().pending, 3);
}

TEST(LedgerTest, TwoProcessesDoNotShareOne) {
  const test::ScratchDirectory scratch;
  const Ledger ledger(scratch.path() / "ledger");
  try {
    const Ledger other(scratch.path() / "ledger");
    FAIL() << "opened twice";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("an actor of this name is running"));
  }
}

TEST(LedgerTest, OtherFilesAreRefused) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "ledger";
  base::WriteFileAtomically(path, "something else");
  EXPECT_THROW(Ledger{path}, base::Error);
  { const Ledger made(scratch.path() / "good"); }
  std::string bytes = base::ReadFile(scratch.path() / "good");
  bytes[0] = 'X';
  base::WriteFileAtomically(path, bytes);
  EXPECT_THROW(Ledger{path}, base::Error);
  EXPECT_THROW(Ledger{scratch.path() / "no" / "ledger"}, base::Error);
}

}  // namespace
}  // namespace slalom::actor
