#include "app/sweep/claim.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/file.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

using Clock = ClaimTaker::Clock;

/// A claim of a process of another machine, of which nothing but its files is seen.
void WriteForeignClaim(const std::filesystem::path& cell, int number, const std::string& beat) {
  base::MakeDirectories(cell);
  base::WriteFileAtomically(cell / ("claim-" + std::to_string(number)),
                            R"({"token": "t", "machine": "elsewhere", "pid": 1, "start": "1"})");
  base::WriteFileAtomically(cell / "beat-t", beat);
}

TEST(ClaimTest, OneAtATimeAndAgainAfterItWasGivenBack) {
  const test::ScratchDirectory scratch;
  ClaimTaker first;
  ClaimTaker second;
  auto claim = first.Try(scratch.path());
  ASSERT_NE(claim, nullptr);
  EXPECT_TRUE(IsClaimed(scratch.path()));
  EXPECT_EQ(second.Try(scratch.path()), nullptr);
  EXPECT_TRUE(claim->Renew());
  claim.reset();
  EXPECT_FALSE(IsClaimed(scratch.path()));
  EXPECT_NE(second.Try(scratch.path()), nullptr);
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path())) << "nothing is left behind";
}

TEST(ClaimTest, OfManyAtOnceOneGetsIt) {
  const test::ScratchDirectory scratch;
  for (int round = 0; round < 20; ++round) {
    const auto cell = scratch.path() / std::to_string(round);
    std::vector<std::unique_ptr<Claim>> claims(8);
    {
      std::vector<std::jthread> threads;
      for (auto& claim : claims) threads.emplace_back([&] { claim = ClaimTaker().Try(cell); });
    }
    EXPECT_EQ(std::ranges::count_if(claims, [](const auto& c) { return c != nullptr; }), 1);
  }
}

// Were it taken for an empty one, a second worker would begin.
TEST(ClaimTest, ACellThatCannotBeListedIsNotFree) {
  const test::ScratchDirectory scratch;
  WriteForeignClaim(scratch.path() / "cell", 2, "1");
  const test::FailingCalls failing(
      {.function = "openat", .path = "*/cell", .error = EIO, .last = 1000},
      scratch.path() / "count");
  EXPECT_TRUE(IsClaimed(scratch.path() / "cell"));
  EXPECT_EQ(ClaimTaker().Try(scratch.path() / "cell"), nullptr);
  EXPECT_GE(failing.num_calls(), 2);
}

TEST(ClaimTest, AClaimIsNotLostWhereItsCellCannotBeListed) {
  const test::ScratchDirectory scratch;
  const auto claim = ClaimTaker().Try(scratch.path() / "cell");
  const test::FailingCalls failing({.function = "openat", .path = "*/cell", .error = EIO},
                                   scratch.path() / "count");
  EXPECT_TRUE(claim->Renew());
  EXPECT_EQ(failing.num_calls(), 1);
}

// On NFS the answer to a link may be lost, and the call that is repeated finds the name taken, by
// this worker itself. The cell would be idle for a minute.
TEST(ClaimTest, ALinkThatWasMadeThoughItSaysOtherwiseIsAClaim) {
  const test::ScratchDirectory scratch;
  const test::FailingCalls failing({.function = "link", .path = "*/claim-*", .error = EEXIST},
                                   scratch.path() / "count");
  const auto claim = ClaimTaker().Try(scratch.path() / "cell");
  EXPECT_EQ(failing.num_calls(), 1);
  ASSERT_NE(claim, nullptr);
  EXPECT_TRUE(claim->Renew());
}

TEST(ClaimTest, TheClaimOfADeadProcessOfThisMachineIsTakenAtOnce) {
  const test::ScratchDirectory scratch;
  const pid_t child = fork();
  if (child == 0) {
    auto claim = ClaimTaker().Try(scratch.path());
    [[maybe_unused]] const auto* kept = claim.release();  // As after kill -9.
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  EXPECT_FALSE(IsClaimed(scratch.path()));
  EXPECT_NE(ClaimTaker().Try(scratch.path()), nullptr);
}

TEST(ClaimTest, AForeignClaimLastsAsLongAsItsCountGoesUpByTheWatchersClock) {
  const test::ScratchDirectory scratch;
  WriteForeignClaim(scratch.path(), 1, "1");
  EXPECT_TRUE(IsClaimed(scratch.path()));
  ClaimTaker taker;
  Clock::time_point now{};
  EXPECT_EQ(taker.Try(scratch.path(), now), nullptr);
  now += Claim::kExpiry - std::chrono::seconds(1);
  EXPECT_EQ(taker.Try(scratch.path(), now), nullptr);
  base::WriteFileAtomically(scratch.path() / "beat-t", "2");
  now += std::chrono::seconds(2);
  EXPECT_EQ(taker.Try(scratch.path(), now), nullptr) << "it has beaten meanwhile";
  now += Claim::kExpiry;
  EXPECT_NE(taker.Try(scratch.path(), now), nullptr);
}

TEST(ClaimTest, AClaimThatIsDamagedLastsUntilItExpires) {
  for (const char* text : {"", "{", "[]", R"({"token": 5})", R"({"token": null})",
                           R"({"token": "../t"})", R"({"machine": {}})", R"({"pid": "1"})",
                           R"({"token": "t", "machine": "m", "pid": 1e72, "start": "s"})"}) {
    SCOPED_TRACE(text);
    const test::ScratchDirectory scratch;
    const auto file = scratch.path() / "claim-1";
    base::WriteFileAtomically(file, text);
    EXPECT_TRUE(IsClaimed(scratch.path()));
    ClaimTaker taker;
    const Clock::time_point begin = Clock::now();
    EXPECT_EQ(taker.Try(scratch.path(), begin), nullptr);
    const auto claim = taker.Try(scratch.path(), begin + Claim::kExpiry);
    ASSERT_NE(claim, nullptr);
    EXPECT_FALSE(std::filesystem::exists(file));
    base::WriteFileAtomically(scratch.path() / "claim-2", text);  // In place of its own.
    EXPECT_FALSE(claim->Renew());
  }
}

TEST(ClaimTest, AFileOfANumberThatNoWorkerReachesIsNoClaim) {
  const test::ScratchDirectory scratch;
  base::WriteFileAtomically(scratch.path() / "claim-2147483647", "");
  EXPECT_FALSE(IsClaimed(scratch.path()));
  EXPECT_NE(ClaimTaker().Try(scratch.path()), nullptr);
}

TEST(ClaimTest, WhoStoodStillForTooLongLearnsThatItsClaimIsLost) {
  const test::ScratchDirectory scratch;
  auto slow = ClaimTaker().Try(scratch.path());
  ASSERT_NE(slow, nullptr);
  WriteForeignClaim(scratch.path(), 2, "1");  // Another machine took it over.
  EXPECT_FALSE(slow->Renew());
  slow.reset();
  EXPECT_TRUE(IsClaimed(scratch.path())) << "the other's claim stays";
}

// Others take a claim whose count stands still for that of a dead worker.
TEST(ClaimTest, EachRenewalCountsOn) {
  const test::ScratchDirectory scratch;
  const auto claim = ClaimTaker().Try(scratch.path());
  const auto count = [&] {
    for (const auto& file : base::ListDirectory(scratch.path())) {
      if (file.filename().string().starts_with("beat-")) return base::ReadFile(file);
    }
    return std::string();
  };
  std::set<std::string> counts;
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(claim->Renew());
    EXPECT_TRUE(counts.insert(count()).second) << count();
  }
}

// A third worker may hold a claim of the same number by now: the second has ended, and taken all
// claims with it.
TEST(ClaimTest, AClaimThatEndsLeavesTheFileOfAnother) {
  const test::ScratchDirectory scratch;
  auto slow = ClaimTaker().Try(scratch.path());
  ASSERT_NE(slow, nullptr);
  WriteForeignClaim(scratch.path(), 1, "1");
  slow.reset();
  EXPECT_TRUE(std::filesystem::exists(scratch.path() / "claim-1"));
  EXPECT_TRUE(std::filesystem::exists(scratch.path() / "beat-t"));
}

TEST(ClaimTest, WhoBeatsIsToldFromWhoDied) {
  const test::ScratchDirectory scratch;
  const std::vector<std::filesystem::path> cells = {scratch.path() / "a", scratch.path() / "b"};
  EXPECT_FALSE(AreWorkedOn(cells, Claim::kExpiry)) << "nobody claims them";
  WriteForeignClaim(cells[1], 1, "1");
  EXPECT_FALSE(AreWorkedOn(cells, std::chrono::seconds(1))) << "its machine is gone";
  {
    std::jthread beats([&](const std::stop_token& stop) {
      for (int i = 2; !stop.stop_requested(); ++i) {
        base::WriteFileAtomically(cells[1] / "beat-t", std::to_string(i));
      }
    });
    EXPECT_TRUE(AreWorkedOn(cells, Claim::kExpiry));
  }
  const auto own = ClaimTaker().Try(cells[0]);
  EXPECT_TRUE(AreWorkedOn(cells, std::chrono::seconds(0))) << "a process of this machine";
}

TEST(ClaimTest, AnOrdinaryDirectoryCanBeShared) {
  const test::ScratchDirectory scratch;
  EXPECT_NO_THROW(RequireSharable(scratch.path()));
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

}  // namespace
}  // namespace slalom::sweep
