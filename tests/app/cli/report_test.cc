#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

namespace slalom::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class ReportTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Evaluate("dwa", {});
    Evaluate("slow-1", {"--set", "dwa.max_speed=0.3"});
    Evaluate("slow-2", {"--set", "dwa.max_speed=0.35"});
  }

  void Evaluate(const std::string& output, const std::vector<std::string>& more,
                const std::string& episodes = "2") {
    std::vector<std::string> arguments{
        "evaluate", "--agent",    "dwa",    "--courses", "generated:1:3",           "--output",
        output,     "--episodes", episodes, "--set",     "evaluation.time_limit=30"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = RunProgram(arguments, scratch_.path());
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  ProgramResult Run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "report");
    return RunProgram(arguments, scratch_.path());
  }

  void ExpectError(const std::vector<std::string>& arguments,
                   const ::testing::Matcher<const std::string&>& text) const {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 1) << result.err;
    EXPECT_THAT(result.err, text);
  }

  const ScratchDirectory scratch_;
};

TEST_F(ReportTest, GroupsSeedsAndWritesEveryForm) {
  const ProgramResult result =
      Run({"dwa", "--agent", "slow", "slow-1", "slow-2/evaluation.json", "--output", "compared"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("| dwa | – | 6 |"));
  EXPECT_THAT(result.out, HasSubstr("| slow | 2 | 12 |"));
  EXPECT_THAT(result.out, HasSubstr("| dwa | slow |"));
  EXPECT_THAT(result.out, HasSubstr("In brackets 95 % intervals"));
  EXPECT_THAT(result.out, HasSubstr("page: compared/report.html"));
  const auto text = [&](const char* name) {
    return base::ReadFile(scratch_.path() / "compared" / name);
  };
  EXPECT_THAT(result.out, HasSubstr(text("report.md")));
  EXPECT_THAT(text("report.csv"), HasSubstr(",slow,false,2,2,3,12,"));
  EXPECT_THAT(text("report-pairs.csv"), HasSubstr(",dwa,slow,"));
  EXPECT_THAT(text("report.html"), HasSubstr("\"label\":\"slow\""));
  // Output that exists is replaced only if told so, whoever wrote it.
  ExpectError({"dwa", "--output", "compared"}, HasSubstr("replace files with --force"));
  EXPECT_EQ(Run({"dwa", "--output", "compared", "--force"}).exit_code, 0);
  ExpectError({"dwa", "--output", "slow-1"}, HasSubstr("slow-1: holds"));
  EXPECT_EQ(Run({"dwa", "slow-1"}).exit_code, 0) << "nothing needs to be written";
  const ProgramResult two = Run({"--agent", "a", "dwa", "slow-1", "--agent", "b", "slow-2"});
  EXPECT_THAT(two.out, AllOf(HasSubstr("| a | 2 |"), HasSubstr("| b | – |")));
  // The same numbers every time.
  EXPECT_EQ(Run({"dwa", "slow-1"}).out, Run({"dwa", "slow-1"}).out);
}

TEST_F(ReportTest, WhatCannotBeComparedIsRefused) {
  ExpectError({}, HasSubstr("nothing to report"));
  ExpectError({"dwa", "gone"}, HasSubstr("gone"));
  ExpectError({"dwa", "--agent", "slow"},
              HasSubstr("--agent 'slow': expected a label and at least"));
  ExpectError({"--agent", "slow", "slow-1", "./slow-1/evaluation.json"},
              AllOf(HasSubstr("agent slow"), HasSubstr("are the same evaluation")));
  ExpectError(
      {"--agent", "a", "slow-1", "--agent", "a", "slow-2"},
      AllOf(HasSubstr("two agents are called a"), HasSubstr("slow-1"), HasSubstr("slow-2")));
  Evaluate("more", {}, "3");
  ExpectError({"dwa", "--agent", "more", "more"},
              AllOf(HasSubstr("dwa/evaluation.json"), HasSubstr("more/evaluation.json"),
                    HasSubstr("has 2 episodes in the first and 3")));
  Evaluate("other", {"--seed", "2"});
  ExpectError({"dwa", "--agent", "other", "other", "--output", "compared"},
              HasSubstr("seed of the evaluation is 1"));
  EXPECT_FALSE(std::filesystem::exists(scratch_.path() / "compared"));
  // One by one they are compared all the same, and that is said.
  EXPECT_THAT(Run({"dwa", "other"}).out, HasSubstr("Not all agents drove from the same starts"));
}

}  // namespace
}  // namespace slalom::test
