#include "eval/report/comparison.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "eval/report/table_text.h"

namespace slalom::eval {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Result MakeResult(const std::string& agent, const std::string& course_set = "static-test") {
  Result result;
  result.agent = agent;
  result.kind = "planner";
  result.file = "out/" + agent + "/evaluation.json";
  result.course_set = course_set;
  result.protocol = {{"name", "\"paper\""},
                     {"time_limit_s", "80.0"},
                     {"goal_tolerance_m", "0.4"},
                     {"collision_ends", "true"},
                     {"clock_start_distance_m", "0.0"},
                     {"start_position_jitter_m", "0.05"},
                     {"start_yaw_jitter_rad", "0.05"}};
  result.set.num_episodes = 500;
  result.set.num_successes = 467;
  result.set.success_rate = {0.934, Interval{0.837, 0.975}};
  result.set.collision_rate = {0.066, Interval{0.025, 0.163}};
  result.set.timeout_rate = {0.0, Interval{0.0, 0.008}};
  result.set.contact_rate = {0.1, Interval{0.05, 0.2}};
  result.set.traversal_time = Estimate{6.13, Interval{5.74, 6.52}};
  result.set.survival_time = std::nullopt;
  result.set.barn_score = {0.4644, Interval{0.4318, 0.4971}};
  sim::Course course;
  course.name = "one";
  result.course_set_data = {course_set, {std::make_shared<const sim::Course>(course)}};
  result.courses.resize(1);
  return result;
}

TEST(Comparison, MarkdownHasValuesAndIntervals) {
  const std::vector<Result> results{MakeResult("dwa"), MakeResult("mppi")};
  const std::string text = MarkdownComparison(results);
  EXPECT_THAT(text, HasSubstr("| dwa | 500 | 93.4 (83.7–97.5) | 6.6 (2.5–16.3) | 0.0 (0.0–0.8) | "
                              "6.1 (5.7–6.5) | – | 0.464 (0.432–0.497) |\n"));
  EXPECT_THAT(text, HasSubstr("## static-test\n"));
  EXPECT_THAT(text, HasSubstr("Protocol paper: 80 s, goal within 0.4 m, a collision ends"));
  EXPECT_THAT(text, Not(HasSubstr("touched")));
}

TEST(Comparison, MarkdownNotesATestThatWasTrainedOn) {
  std::vector<Result> results{MakeResult("td3"), MakeResult("mppi")};
  EXPECT_THAT(MarkdownComparison(results), Not(HasSubstr("Trained")));
  results[0].training_overlap = TrainingOverlap{40, 50, "static-train*"};
  results[1].training_overlap = TrainingOverlap{0, 50, "static-train"};
  const std::string text = MarkdownComparison(results);
  EXPECT_THAT(text,
              HasSubstr("\n\n**Trained on its test:** td3 was trained on 40 of these 50 courses "
                        "(static-train\\*).\n"));
  EXPECT_THAT(text, Not(HasSubstr("mppi was trained")));
}

TEST(Comparison, MarkdownShowsTheSettingsInWhichTheAgentsOfAGroupDiffer) {
  std::vector<Result> results{MakeResult("dwa"), MakeResult("fast"),
                              MakeResult("dwa", "dynamic-box")};
  for (Result& result : results) result.settings = {{"dwa.speed", "0.5"}, {"run.seed", "1"}};
  EXPECT_THAT(MarkdownComparison(results), Not(HasSubstr("Settings")));
  results[1].settings["dwa.speed"] = "2.0";
  EXPECT_THAT(MarkdownComparison(results),
              HasSubstr("|\n\n### Settings in which the planners differ\n\n| key | dwa | fast |\n"
                        "|---|---|---|\n| `dwa.speed` | `0.5` | `2.0` |\n\n## dynamic-box"));
}

TEST(Comparison, ShowsContactsWhereCollisionsEndNothing) {
  std::vector<Result> results{MakeResult("dwa")};
  results[0].protocol["collision_ends"] = "false";
  EXPECT_THAT(MarkdownComparison(results), HasSubstr("10.0 (5.0–20.0)"));
  EXPECT_THAT(MarkdownComparison(results), HasSubstr("| touched [%] |"));
}

TEST(Comparison, GroupsByCourses) {
  std::vector<Result> results{MakeResult("dwa"), MakeResult("dwa", "dynamic-box"),
                              MakeResult("teb"), MakeResult("teb"), MakeResult("mppi")};
  results[3].collection = "data/barn/";
  sim::Course other;
  other.name = "two";
  results[4].course_set_data.courses = {std::make_shared<const sim::Course>(other)};
  const std::vector<ResultGroup> groups = GroupByCourses(results);
  ASSERT_EQ(groups.size(), 4u);
  EXPECT_EQ(groups[0].results, (std::vector<std::size_t>{0, 2}));
  EXPECT_EQ(groups[0].title, "static-test");
  EXPECT_EQ(groups[1].title, "dynamic-box");
  EXPECT_THAT(groups[2].title, HasSubstr("static-test of data/barn"));
  EXPECT_THAT(groups[3].title, HasSubstr("other courses"));
}

TEST(Comparison, LabelsTellResultsOfOneGroupApart) {
  std::vector<Result> results{MakeResult("dwa"), MakeResult("dwa"), MakeResult("dwa"),
                              MakeResult("dwa", "dynamic-box"), MakeResult("teb")};
  results[1].profiles = {"configs/real-robot.toml"};
  results[2].file = "again/evaluation.json";
  EXPECT_EQ(Labels(results), (std::vector<std::string>{"dwa [dwa]", "dwa (real-robot)",
                                                       "dwa [again]", "dwa", "teb"}));
  results[2].file = results[0].file;
  EXPECT_EQ(Labels(results)[2], "dwa [dwa] 2");
  results[2].physics = "ode";
  EXPECT_EQ(Labels(results)[2], "dwa in ode");
}

TEST(Comparison, NamesCannotBreakTheTables) {
  const std::string name = "a|b_c \"x\", 100 % & <i>#1\\";
  const std::vector<Result> results{MakeResult(name)};
  EXPECT_THAT(MarkdownComparison(results),
              HasSubstr("| a\\|b\\_c \"x\", 100 % & \\<i\\>\\#1\\\\ | 500 |"));
  EXPECT_THAT(CsvComparison(results),
              HasSubstr("static-test,\"a|b_c \"\"x\"\", 100 % & <i>#1\\\","));
}

TEST(Comparison, CsvHasAllFiguresInAsManyColumnsAsTheHeader) {
  const std::vector<Result> results{MakeResult("dwa"), MakeResult("teb", "dynamic-box")};
  const std::string text = CsvComparison(results);
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  ASSERT_EQ(lines.size(), 3u);
  const auto num_commas = std::ranges::count(lines[0], ',');
  for (const std::string& line : lines)
    EXPECT_EQ(std::ranges::count(line, ','), num_commas) << line;
  EXPECT_THAT(lines[1], HasSubstr(",0.934000,0.837000,0.975000,"));
  EXPECT_THAT(lines[1], HasSubstr(",6.130000,5.740000,6.520000,,,,"));  // No survival time.
}

TEST(TableText, RoundsHalvesAwayFromZero) {
  EXPECT_EQ(FixedText(36.25, 1), "36.3");
  EXPECT_EQ(FixedText(-36.25, 1), "-36.3");
  EXPECT_EQ(FixedText(36.75, 1), "36.8");
  EXPECT_EQ(FixedText(0.5, 0), "1");
  EXPECT_EQ(FixedText(99.95, 1), "100.0");  // 99.9500000000000028 in binary.
  EXPECT_EQ(FixedText(-0.04, 1), "0.0");
  // Just below and above a half, and 36.35, which is 36.35000000000000142 in binary.
  EXPECT_EQ(FixedText(std::nextafter(36.25, 0.0), 1), "36.2");
  EXPECT_EQ(FixedText(std::nextafter(36.25, 99.0), 1), "36.3");
  EXPECT_EQ(FixedText(36.35, 1), "36.4");
  // 1.45 is 1.4499999999999999556 in binary, though ten times that is 14.5.
  EXPECT_EQ(FixedText(1.45, 1), "1.4");
  // Multiples of 1/16, rounded in integers.
  for (int k = 0; k < 5000; ++k) {
    const int tenths = (2 * 10 * k + 16) / 32;
    EXPECT_EQ(FixedText(k / 16.0, 1), fmt::format("{}.{}", tenths / 10, tenths % 10)) << k;
  }
}

TEST(TableText, ShowsDifferencesWithASignAndZeroWithout) {
  const auto text = [](double value, double low, double high) {
    return EstimateText(Estimate{value, Interval{low, high}}, 100.0, 1, true);
  };
  EXPECT_EQ(text(0.05, -0.0004, 0.1), "+5.0 (0.0 to +10.0)");
  EXPECT_EQ(text(-0.05, -0.1, 0.0006), "-5.0 (-10.0 to +0.1)");
  EXPECT_EQ(EstimateText(Estimate{-1.5, std::nullopt}, 2.0, 2, false), "-3.00");
  EXPECT_EQ(EstimateText(std::nullopt, 1.0, 1, true), "–");
  EXPECT_EQ(PValueText(0.0009), "\\< 0.001");
  EXPECT_EQ(PValueText(0.001), "0.001");
  const MarkdownTable table{.titles = {"a", "b", "c"}, .num_names = 2, .rows = {{"x", "y", "1"}}};
  EXPECT_EQ(table.Print(), "| a | b | c |\n|---|---|---:|\n| x | y | 1 |\n");
}

}  // namespace
}  // namespace slalom::eval
