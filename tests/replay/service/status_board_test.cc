#include "replay/service/status_board.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace slalom::replay {
namespace {

using std::chrono::seconds;

/// A report of about `kilobytes` of facts.
proto::Report ReportOf(const std::string& name, int kilobytes) {
  proto::Report report{.role = "actor", .name = name, .figures = {}, .facts = {}};
  for (int i = 0; i < kilobytes; ++i) {
    report.facts[fmt::format("fact-{}", i)] = std::string(proto::kMaxTextBytes, 'x');
  }
  return report;
}

TEST(StatusBoardTest, TheLastReportOfEachNameIsTold) {
  StatusBoard board(seconds(10));
  StatusBoard::Time now{};
  for (int i = 0; i < 3; ++i) {
    now += seconds(20);
    board.Put(ReportOf("old", i), now);
  }
  board.Put(ReportOf("new", 0), now + seconds(15));
  const proto::StatusReply reply = board.Reply(now + seconds(16));
  ASSERT_EQ(reply.roles.size(), 2u);
  EXPECT_EQ(reply.roles[0].report.name, "new");
  EXPECT_TRUE(reply.roles[0].connected);
  EXPECT_EQ(reply.roles[1].report.facts.size(), 2u);
  EXPECT_FALSE(reply.roles[1].connected);
  EXPECT_EQ(reply.roles[1].age_s, 16.0);
  EXPECT_EQ(reply.omitted, 0);
}

// The largest reports, of as many names as there may be: the board keeps the newest few, not a
// gigabyte of them, and tells how many a message does not hold.
TEST(StatusBoardTest, KeepsNoMoreThanItsBoundAndTheNewest) {
  StatusBoard board(seconds(10));
  StatusBoard::Time now{};
  for (int i = 0; i < proto::kMaxRoles; ++i) {
    now += seconds(1);
    board.Put(ReportOf(fmt::format("actor-{:04}", i), proto::kMaxFigures), now);
  }
  const proto::StatusReply reply = board.Reply(now);
  const std::size_t kept = reply.roles.size() + static_cast<std::size_t>(reply.omitted);
  EXPECT_GT(reply.omitted, 0);
  EXPECT_LE(kept, StatusBoard::kMaxBytes / (proto::kMaxFigures * proto::kMaxTextBytes));
  ASSERT_FALSE(reply.roles.empty());
  EXPECT_EQ(reply.roles[0].report.name,
            fmt::format("actor-{:04}", proto::kMaxRoles - static_cast<int>(kept)));
  // Many small ones still fit, in the place of the large ones.
  for (int i = 0; i < proto::kMaxRoles; ++i) {
    now += seconds(1);
    board.Put(ReportOf(fmt::format("small-{:04}", i), 0), now);
  }
  const proto::StatusReply small = board.Reply(now);
  EXPECT_EQ(small.roles.size() + static_cast<std::size_t>(small.omitted),
            static_cast<std::size_t>(proto::kMaxRoles));
  EXPECT_EQ(small.roles[0].report.name, "small-0000");
}

TEST(StatusBoardTest, AReportTakesThePlaceOfTheOneBeforeAndNoMore) {
  StatusBoard board(seconds(10));
  const StatusBoard::Time now{};
  board.Put(ReportOf("other", 0), now);
  const proto::Report large = ReportOf("large", proto::kMaxFigures);
  const std::size_t most = StatusBoard::kMaxBytes / (proto::kMaxFigures * proto::kMaxTextBytes);
  for (std::size_t i = 0; i < most + 2; ++i) board.Put(large, now + seconds(1));
  const proto::StatusReply reply = board.Reply(now);
  EXPECT_EQ(static_cast<int>(reply.roles.size()) + reply.omitted, 2);
}

// Of a thousand actors and more a message holds a part, but all the others.
TEST(StatusBoardTest, LeavesOutActorsOnly) {
  StatusBoard board(seconds(10));
  const StatusBoard::Time now{};
  for (int i = 0; i < 3000; ++i) {
    proto::Report report = ReportOf(fmt::format("actor-{:04}", i), 0);
    for (int k = 0; k < 12; ++k) report.figures[fmt::format("figure_{}", k)] = k;
    board.Put(report, now);
  }
  for (const char* role : {"evaluator", "learner", "replay"}) {
    board.Put({.role = role, .name = role, .figures = {}, .facts = {}}, now);
  }
  const proto::StatusReply reply = board.Reply(now);
  EXPECT_GT(reply.omitted, 0);
  for (const char* role : {"evaluator", "learner", "replay"}) {
    EXPECT_EQ(
        std::ranges::count(reply.roles, role, [](const auto& entry) { return entry.report.role; }),
        1)
        << role;
  }
}

}  // namespace
}  // namespace slalom::replay
