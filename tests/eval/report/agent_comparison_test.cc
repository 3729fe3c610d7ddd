#include "eval/report/agent_comparison.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"

namespace slalom::eval {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// `outcomes` of the episodes of each course, as "SCT": success, collision, timeout.
Result MakeResult(const std::string& file, const std::vector<std::string>& outcomes) {
  Result result;
  result.agent = "td3";
  result.kind = "policy";
  result.file = file;
  result.course_set = "static-test";
  result.protocol = {{"name", "\"paper\""},
                     {"time_limit_s", "80.0"},
                     {"goal_tolerance_m", "0.4"},
                     {"collision_ends", "true"},
                     {"clock_start_distance_m", "0.0"},
                     {"start_position_jitter_m", "0.05"},
                     {"start_yaw_jitter_rad", "0.05"}};
  result.seed = 1;
  for (std::size_t c = 0; c < outcomes.size(); ++c) {
    sim::Course course;
    course.name = fmt::format("course-{}", c);
    result.course_set_data.courses.push_back(std::make_shared<const sim::Course>(course));
    ResultCourse& of_course = result.courses.emplace_back();
    of_course.name = course.name;
    for (std::size_t e = 0; e < outcomes[c].size(); ++e) {
      const env::Outcome outcome = outcomes[c][e] == 'S'   ? env::Outcome::kSuccess
                                   : outcomes[c][e] == 'C' ? env::Outcome::kCollision
                                                           : env::Outcome::kTimeout;
      of_course.episodes.push_back({outcome, 10.0 + static_cast<double>(c + e), 0});
    }
  }
  return result;
}

/// Two seeds of an agent and one of another on four courses.
struct Study {
  std::vector<Result> results{MakeResult("a-1", {"SS", "SC", "ST", "SS"}),
                              MakeResult("a-2", {"SS", "SS", "CC", "SC"}),
                              MakeResult("b-1", {"SC", "CC", "TT", "SC"})};
  std::vector<AgentResults> agents{{"td3", {0, 1}}, {"a|b, 5 % <dwa>", {2}}};

  AgentComparison Compare() const { return CompareAgents(results, agents); }
};

TEST(CompareAgents, HasTheFiguresOfTheEpisodes) {
  const AgentComparison comparison = Study().Compare();
  EXPECT_EQ(comparison.title, "static-test");
  EXPECT_EQ(comparison.num_courses, 4);
  ASSERT_EQ(comparison.agents.size(), 2u);
  const AgentFigures& td3 = comparison.agents[0];
  EXPECT_EQ(td3.num_seeds, 2);
  EXPECT_EQ(td3.files, (std::vector<std::string>{"a-1", "a-2"}));
  EXPECT_EQ(td3.seed_success, (std::vector<double>{0.75, 0.625}));
  EXPECT_NEAR(td3.success_rate.value, 11.0 / 16.0, 1e-12);
  EXPECT_NEAR(td3.collision_rate.value, 4.0 / 16.0, 1e-12);
  // Success rates 0, 0.5, 0.5, 0.5, 1, 1, 1, 1: the middle four are 0.5, 0.5, 1, 1.
  EXPECT_NEAR(td3.interquartile_success.value, 0.75, 1e-12);
  // Successful episodes took 10 + course + episode: 10, 11, 11, 12, 13, 14 and 10, 11, 11, 12, 13.
  ASSERT_TRUE(td3.traversal_time);
  EXPECT_NEAR(td3.traversal_time->value, 128.0 / 11.0, 1e-12);
  EXPECT_TRUE(td3.success_rate.interval);
  EXPECT_EQ(comparison.thresholds.size(), td3.profile.size());
  EXPECT_NEAR(td3.profile[0].value, 7.0 / 8.0, 1e-12);  // Above 0.
  EXPECT_NEAR(td3.profile[10].value, 0.5, 1e-12);       // Above 0.5.

  ASSERT_EQ(comparison.pairs.size(), 1u);
  const AgentPair& pair = comparison.pairs[0];
  EXPECT_NEAR(pair.test.difference.value, 11.0 / 16.0 - 2.0 / 8.0, 1e-12);
  // Differences of the courses: 0.5, 0.75, 0.25, 0.25, all of one sign.
  EXPECT_DOUBLE_EQ(pair.test.p_value, 2.0 / 16.0);
  EXPECT_DOUBLE_EQ(pair.corrected_p_value, 2.0 / 16.0);
  EXPECT_FALSE(pair.test.training_p_value) << "a single seed has no spread of trainings";
  // td3 against dwa on each course, two seeds: 2, 2, 1.5, 1.5 wins of 2.
  EXPECT_NEAR(pair.improvement.value, 7.0 / 8.0, 1e-12);
}

TEST(CompareAgents, CorrectsForTheNumberOfPairs) {
  Study study;
  study.results.push_back(MakeResult("c-1", {"SS", "SS", "SS", "SS"}));
  study.agents.push_back({"best", {3}});
  const AgentComparison comparison = study.Compare();
  ASSERT_EQ(comparison.pairs.size(), 3u);
  std::vector<double> p_values;
  for (const AgentPair& pair : comparison.pairs) p_values.push_back(pair.test.p_value);
  const std::vector<double> corrected = HolmCorrection(p_values);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(comparison.pairs[k].corrected_p_value, corrected[k]);
  }
  EXPECT_GT(corrected[0], p_values[0]);
}

TEST(CompareAgents, NotesSayWhatTheNumbersCannot) {
  Study study;
  study.results[2].training_overlap = TrainingOverlap{3, 4, "static-train"};
  study.results.push_back(MakeResult("c-1", {"SS", "SS", "SS", "SS"}));
  study.agents.push_back({"perfect", {3}});
  const std::vector<std::string> notes = study.Compare().notes;
  ASSERT_EQ(notes.size(), 3u);
  EXPECT_THAT(notes[0], AllOf(HasSubstr("One seed: a|b, 5 % <dwa>, perfect."),
                              HasSubstr("do not cover the noise of training")));
  EXPECT_THAT(notes[1], HasSubstr("No interval: perfect (success, IQM, collision)."));
  EXPECT_THAT(notes[2], HasSubstr("trained on 3 of these 4 courses"));

  study.results[2].kind = "planner";
  EXPECT_THAT(study.Compare().notes[0], HasSubstr("One seed: perfect."))
      << "planners learn nothing";

  const std::vector<Result> one_course{MakeResult("a", {"SSC"}), MakeResult("b", {"SCC"})};
  const std::vector<AgentResults> both{{"a", {0}}, {"b", {1}}};
  const AgentComparison comparison = CompareAgents(one_course, both);
  EXPECT_THAT(comparison.notes[0], HasSubstr("one course only"));
  EXPECT_FALSE(comparison.agents[0].success_rate.interval);
  EXPECT_EQ(comparison.pairs[0].test.p_value, 1.0);
  EXPECT_THAT(MarkdownOf(comparison), HasSubstr("one course only"));
}

/// The error's text; "" without an error.
std::string Refusal(const std::vector<Result>& results) {
  try {
    RequireComparable(results);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

TEST(RequireComparable, NamesTwoFilesAndWhatDiffers) {
  const Result first = MakeResult("one/evaluation.json", {"SS", "SC"});
  EXPECT_EQ(Refusal({first, MakeResult("two/evaluation.json", {"CC", "CC"})}), "");
  const auto expect = [&](Result other, const std::string& what) {
    other.file = "two/evaluation.json";
    EXPECT_THAT(Refusal({first, other}), AllOf(HasSubstr("one/evaluation.json"),
                                               HasSubstr("two/evaluation.json"), HasSubstr(what)));
  };
  expect(MakeResult("", {"SS", "SC", "SS"}),
         "the first was driven on the 2 courses of static-test and the second on the 3 courses");
  expect(MakeResult("", {"SS", "SCS"}),
         "course course-1 has 2 episodes in the first and 3 in the second");
  Result other = first;
  other.seed = 2;
  expect(other, "the seed of the evaluation is 1 in the first and 2 in the second");
  other = first;
  other.protocol["time_limit_s"] = "100.0";
  expect(other, "time_limit_s of the protocol is 80.0 in the first and 100.0");
  other = first;
  sim::Course moved = *first.course_set_data.courses[1];
  moved.goal_W = {3.0, 1.0};
  other.course_set_data.courses[1] = std::make_shared<const sim::Course>(moved);
  expect(other,
         "both were driven on the 2 courses of static-test, but some of these courses differ");
  EXPECT_THAT(Refusal({MakeResult("one/evaluation.json", {"SS", ""})}),
              HasSubstr("one/evaluation.json: course course-1 has no episodes"));
}

TEST(MarkdownOf, IsATableOfAgentsAndOneOfPairs) {
  const std::string text = MarkdownOf(Study().Compare());
  EXPECT_THAT(text, HasSubstr("# Agents on static-test\n\n4 courses. Protocol paper"));
  EXPECT_THAT(text, HasSubstr("| agent | seeds | success [%] | success, IQM [%] | collision [%] | "
                              "traversal [s] |\n"));
  EXPECT_THAT(text, HasSubstr("| td3 | 2 | 68.8 ("));
  EXPECT_THAT(text, HasSubstr("| a\\|b, 5 % \\<dwa\\> | 1 | 25.0 ("));
  EXPECT_THAT(text, HasSubstr("| td3 | a\\|b, 5 % \\<dwa\\> | +43.8 (-"));
  EXPECT_THAT(text, HasSubstr("| 0.125 | 0.125 | – | – |\n"));
  EXPECT_THAT(text, HasSubstr("One seed: a\\|b"));
}

TEST(CsvOf, HasALineForEveryNumber) {
  const std::string text = CsvOf(Study().Compare());
  std::istringstream lines(text);
  int num_lines = 0;
  for (std::string line; std::getline(lines, line); ++num_lines) {
    if (line.find('"') != std::string::npos) continue;  // The agent with a comma in its name.
    EXPECT_EQ(std::ranges::count(line, ','), 6) << line;
  }
  // A head; for each of two agents 5 figures and 20 shares; 6 of the pair.
  EXPECT_EQ(num_lines, 1 + 2 * (5 + 20) + 6);
  EXPECT_THAT(text, HasSubstr("agent,against,quantity,threshold,value,low,high\n"));
  EXPECT_THAT(text, HasSubstr("td3,,success_rate,,0.687500,0."));
  EXPECT_THAT(text, HasSubstr("td3,,share_of_success_rates_above,0.500000,0.500000,"));
  EXPECT_THAT(text, HasSubstr("td3,\"a|b, 5 % <dwa>\",p_value,,0.125000,,\n"));
  EXPECT_THAT(text, HasSubstr("td3,\"a|b, 5 % <dwa>\",training_p_value,,,,\n"));
}

TEST(CompareAgents, ShowsTheSettingsInWhichAgentsDiffer) {
  Study study;
  for (Result& result : study.results) result.settings = {{"run.max_seconds", "20.0"}};
  EXPECT_THAT(MarkdownOf(study.Compare()), Not(HasSubstr("Settings")));
  study.results[2].settings = {{"run.max_seconds", "90.0"}};
  const AgentComparison comparison = study.Compare();
  EXPECT_THAT(MarkdownOf(comparison),
              HasSubstr("\n\n## Settings in which the policies differ\n\n"
                        "| key | td3 | a\\|b, 5 % \\<dwa\\> |\n|---|---|---|\n"
                        "| `run.max_seconds` | `20.0` | `90.0` |\n"));
  const auto data = nlohmann::json::parse(ComparisonPageData(comparison));
  EXPECT_EQ(data["settings"][0]["rows"][0], nlohmann::json({"run.max_seconds", "20.0", "90.0"}));
}

TEST(ComparisonPage, HoldsTheNumbersAndNoEndOfItsData) {
  const AgentComparison comparison = Study().Compare();
  const auto data = nlohmann::json::parse(ComparisonPageData(comparison));
  ASSERT_EQ(data["agents"].size(), 2u);
  EXPECT_EQ(data["agents"][0]["success_rate"][0], comparison.agents[0].success_rate.value);
  EXPECT_EQ(data["agents"][0]["success_rate"][1], comparison.agents[0].success_rate.interval->low);
  EXPECT_EQ(data["agents"][1]["label"], "a|b, 5 % <dwa>");
  EXPECT_EQ(data["agents"][0]["profile"].size(), data["thresholds"].size());
  EXPECT_EQ(data["pairs"][0]["p"], 0.125);
  EXPECT_TRUE(data["pairs"][0]["training_p"].is_null());
  const std::string page = ComparisonPage(comparison);
  EXPECT_THAT(page, Not(HasSubstr("<dwa>")));
  for (const char* mark : {"/*STYLE*/", "/*SCRIPT*/", "/*DATA*/", "https://"}) {
    EXPECT_THAT(page, Not(HasSubstr(mark)));
  }
}

}  // namespace
}  // namespace slalom::eval
