#include "app/cli/status_table.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace slalom::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

proto::StatusReply Actors(int count) {
  proto::StatusReply status;
  for (int i = 0; i < count; ++i) {
    proto::RoleStatus actor{.report = {}, .age_s = 1.0, .connected = i != 7};
    actor.report.role = "actor";
    actor.report.name = fmt::format("actor-{}", i);
    actor.report.figures = {{"steps_made", 1000.0 * i}, {"policy_version", 50.0 + i}};
    if (i % 2 == 0) actor.report.figures["success_rate"] = 0.01 * (i % 4);
    status.roles.push_back(actor);
  }
  proto::RoleStatus learner{.report = {}, .age_s = 1.0, .connected = true};
  learner.report.role = "learner";
  learner.report.name = "the-learner";
  status.roles.push_back(learner);
  return status;
}

TEST(StatusTableTest, AHundredActorsHaveALineEach) {
  const std::string text = FormatStatus(Actors(100));
  EXPECT_THAT(text, HasSubstr("actor-99"));
  EXPECT_THAT(text, HasSubstr("the-learner"));
  EXPECT_THAT(text, HasSubstr("GONE, 1 s ago"));
  EXPECT_THAT(text, Not(HasSubstr("all 100")));
  EXPECT_THAT(text, Not(HasSubstr("do not fit")));
}

TEST(StatusTableTest, MoreActorsHaveALineForAllAndThoseThatAreGoneTheirOwn) {
  proto::StatusReply status = Actors(300);
  status.omitted = 12;
  const std::string text = FormatStatus(status);
  const std::size_t all = text.find("all 300");
  ASSERT_NE(all, std::string::npos) << text;
  const std::string line = text.substr(all, text.find('\n', all) - all);
  EXPECT_THAT(line, HasSubstr("44.9M"));  // 1000 (0 + 1 + ... + 299)
  EXPECT_THAT(line, HasSubstr(" 50 "));   // The oldest policy.
  EXPECT_THAT(line, HasSubstr("0.01"));   // 150 of them have 0 or 0.02.
  EXPECT_THAT(line, HasSubstr("299 of them, 1 are GONE"));
  EXPECT_THAT(text, HasSubstr("actor-7 "));
  EXPECT_THAT(text, Not(HasSubstr("actor-8 ")));
  EXPECT_THAT(text, HasSubstr("the-learner"));
  EXPECT_THAT(text, HasSubstr("12 more actors do not fit"));
  EXPECT_LT(std::ranges::count(text, '\n'), 12);
}

TEST(StatusTableTest, EndsWithWhetherAllIsWell) {
  proto::StatusReply status = Actors(8);
  EXPECT_THAT(FormatStatus(status), HasSubstr("not well: 1 actor is gone"));
  status.roles[7].connected = true;
  status.roles.back().report.figures["seconds_left"] = 125.0;
  const std::string text = FormatStatus(status);
  EXPECT_THAT(text, HasSubstr(" 2:05 "));
  EXPECT_THAT(text, testing::EndsWith("\nall is well\n"));
  status.roles[2].report.figures["steps_lost"] = 256.0;
  EXPECT_THAT(FormatStatus(status), HasSubstr("not well: 256 steps were lost in all"));
  status.roles.resize(8);
  EXPECT_THAT(FormatStatus(status), HasSubstr("not well: no learner is connected"));
}

}  // namespace
}  // namespace slalom::cli
