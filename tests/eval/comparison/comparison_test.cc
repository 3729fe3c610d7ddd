#include "eval/comparison/comparison.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "eval/comparison/printers.h"
#include "tests/eval/report/made_evaluation.h"

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
  result.protocol = testing::PaperProtocol();
  result.seed = 1;
  for (std::size_t c = 0; c < outcomes.size(); ++c) {
    sim::Course course;
    course.name = fmt::format("course-{}", c);
    result.course_set_data.courses.push_back(std::make_shared<const sim::Course>(course));
    ResultCourse& of_course = result.courses.emplace_back();
    of_course.name = course.name;
    of_course.optimal_time = 5.0;
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

  Group Compare() const { return CompareResults(results, agents).groups.front(); }
};

std::size_t Place(std::string_view key) { return FindQuantity(key).value(); }

const QuantityFigures& Of(const AgentFigures& agent, std::string_view key) {
  return agent.quantities[Place(key)];
}

TEST(Quantities, HaveKeysOfTheirOwn) {
  for (std::size_t q = 0; q < Quantities().size(); ++q) {
    EXPECT_EQ(Place(Quantities()[q].key), q);
    EXPECT_NE(Quantities()[q].value, nullptr);
  }
  EXPECT_EQ(Place("success_rate"), 0u);
  EXPECT_FALSE(FindQuantity("success"));
}

TEST(CompareResults, HasTheFiguresOfTheEpisodes) {
  const Group group = Study().Compare();
  EXPECT_EQ(group.title, "static-test");
  EXPECT_EQ(group.num_courses, 4);
  ASSERT_EQ(group.agents.size(), 2u);
  const AgentFigures& td3 = group.agents[0];
  EXPECT_EQ(td3.num_seeds, 2);
  EXPECT_EQ(td3.num_episodes, 16);
  EXPECT_EQ(td3.files, (std::vector<std::string>{"a-1", "a-2"}));
  EXPECT_EQ(td3.success().seeds, (std::vector<double>{0.75, 0.625}));
  EXPECT_NEAR(td3.success().estimate->value, 11.0 / 16.0, 1e-12);
  EXPECT_TRUE(td3.success().estimate->interval);
  EXPECT_NEAR(*td3.success().seed_mean(), 0.6875, 1e-12);
  EXPECT_NEAR(*td3.success().seed_deviation(), 0.125 / std::sqrt(2.0), 1e-12);
  EXPECT_FALSE(group.agents[1].success().seed_deviation());
  EXPECT_NEAR(Of(td3, "collision_rate").estimate->value, 4.0 / 16.0, 1e-12);
  EXPECT_NEAR(Of(td3, "timeout_rate").estimate->value, 1.0 / 16.0, 1e-12);
  // Success rates 0, 0.5, 0.5, 0.5, 1, 1, 1, 1: the middle four are 0.5, 0.5, 1, 1.
  EXPECT_NEAR(Of(td3, "success_rate_iqm").estimate->value, 0.75, 1e-12);
  EXPECT_NEAR(Of(td3, "success_rate_worst").estimate->value, 0.0, 1e-12);
  // Successful episodes took 10 + course + episode: 10, 11, 11, 12, 13, 14 and 10, 11, 11, 12, 13.
  EXPECT_NEAR(Of(td3, "traversal_time_s").estimate->value, 128.0 / 11.0, 1e-12);
  // Failed ones 12, 13 and 12, 13, 14.
  EXPECT_NEAR(Of(td3, "survival_time_s").estimate->value, 64.0 / 5.0, 1e-12);
  ASSERT_EQ(td3.profile.size(), ProfileThresholds().size());
  EXPECT_NEAR(td3.profile[0].value, 7.0 / 8.0, 1e-12);  // Above 0.
  EXPECT_NEAR(td3.profile[10].value, 0.5, 1e-12);       // Above 0.5.

  ASSERT_EQ(group.pairs.size(), 1u);
  const AgentPair& pair = group.pairs[0];
  EXPECT_NEAR(pair.difference().value, 11.0 / 16.0 - 2.0 / 8.0, 1e-12);
  EXPECT_NEAR(pair.differences[Place("collision_rate")]->value, 4.0 / 16.0 - 4.0 / 8.0, 1e-12);
  EXPECT_NEAR(pair.differences[Place("traversal_time_s")]->value, 128.0 / 11.0 - 23.0 / 2.0, 1e-12);
  // Differences of the courses: 0.5, 0.75, 0.25, 0.25, all of one sign.
  EXPECT_DOUBLE_EQ(pair.test.p_value, 2.0 / 16.0);
  EXPECT_DOUBLE_EQ(pair.corrected_p_value, 2.0 / 16.0);
  EXPECT_FALSE(pair.test.training_p_value) << "a single seed has no spread of trainings";
  EXPECT_EQ(pair.verdict, Verdict::kTooFewSeeds);
  EXPECT_TRUE(pair.same_starts);
  // td3 against dwa on each course, two seeds: 2, 2, 1.5, 1.5 wins of 2.
  EXPECT_NEAR(pair.improvement.value, 7.0 / 8.0, 1e-12);
}

TEST(CompareResults, CorrectsForTheNumberOfPairs) {
  Study study;
  study.results.push_back(MakeResult("c-1", {"SS", "SS", "SS", "SS"}));
  study.agents.push_back({"best", {3}});
  const Group group = study.Compare();
  ASSERT_EQ(group.pairs.size(), 3u);
  std::vector<double> p_values;
  for (const AgentPair& pair : group.pairs) p_values.push_back(pair.test.p_value);
  const std::vector<double> corrected = HolmCorrection(p_values);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(group.pairs[k].corrected_p_value, corrected[k]);
  EXPECT_GT(corrected[0], p_values[0]);
}

TEST(CompareResults, JudgesPoliciesByTheirTrainingsUnlessTheyAreTheSame) {
  const std::vector<std::string> good(8, "SS");
  const std::vector<std::string> bad(8, "CC");
  std::vector<Result> results{MakeResult("a", good), MakeResult("b", bad)};
  const std::vector<AgentResults> agents{{"a", {0}}, {"b", {1}}};
  const auto verdict = [&] { return CompareResults(results, agents).groups[0].pairs[0].verdict; };
  results[0].source = "runs/a/policy.safetensors";
  results[1].source = "runs/b/policy.safetensors";
  EXPECT_EQ(verdict(), Verdict::kTooFewSeeds);
  results[1].source = results[0].source;
  EXPECT_EQ(verdict(), Verdict::kDiffers) << "one policy, driven in two ways";
  results[1].source = "teb";
  for (Result& result : results) result.kind = "planner";
  EXPECT_EQ(verdict(), Verdict::kDiffers);
}

TEST(CompareResults, ComparesEachListOfCoursesByItself) {
  Study study;
  study.results.push_back(MakeResult("a-3", {"SS", "SS"}));
  study.results.push_back(MakeResult("b-2", {"SC", "SS"}));
  study.results[3].course_set = study.results[4].course_set = "other";
  study.agents[0].results.push_back(3);
  study.agents[1].results.push_back(4);
  const Comparison comparison = CompareResults(study.results, study.agents);
  ASSERT_EQ(comparison.groups.size(), 2u);
  EXPECT_EQ(comparison.groups[0].agents[0].num_seeds, 2);
  EXPECT_EQ(comparison.groups[1].title, "other");
  EXPECT_EQ(comparison.groups[1].agents[0].files, std::vector<std::string>{"a-3"});
  EXPECT_EQ(comparison.groups[1].pairs.size(), 1u);
}

TEST(CompareAgents, LeavesOutPairsThatCannotBeComparedAndAgentsWithoutResults) {
  const Result here = MakeResult("a", {"SS", "SC"});
  Result elsewhere = MakeResult("b", {"SS", "SC"});
  elsewhere.course_set = "other";
  Result later = here;
  later.seed = 2;
  std::vector<Agent> agents{
      {"a", true, {&here}, 3}, {"none", true, {}, 3}, {"b", true, {&elsewhere}, 1}};
  Group group = CompareAgents(agents);
  EXPECT_TRUE(group.pairs.empty());
  ASSERT_EQ(group.agents.size(), 3u);
  EXPECT_EQ(group.agents[0].num_planned, 3);
  EXPECT_FALSE(group.agents[1].success().estimate);
  EXPECT_TRUE(group.agents[1].profile.empty());
  EXPECT_THAT(group.notes[0], HasSubstr("1 pair of agents is left out"));
  EXPECT_EQ(SeedsText(group.agents[1]), "**0 of 3**");
  EXPECT_THAT(FiguresTable(group.agents, group.columns).Print(),
              HasSubstr("| none | **0 of 3** | 0 | – |"));
  // Other starts are compared, and that is said.
  agents[2].seeds = {&later};
  group = CompareAgents(agents);
  ASSERT_EQ(group.pairs.size(), 1u);
  EXPECT_EQ(group.pairs[0].second, 2u);
  EXPECT_FALSE(group.pairs[0].same_starts);
  EXPECT_THAT(group.notes[0], HasSubstr("same starts"));
  agents.assign(kMaxPairedAgents + 1, agents[0]);
  group = CompareAgents(agents);
  EXPECT_TRUE(group.pairs.empty());
  EXPECT_THAT(group.notes[0], HasSubstr("13 agents make too many pairs"));
}

TEST(CompareAgents, ARateWithoutSpreadHasWilsonsInterval) {
  const Result perfect = MakeResult("a", {"SS", "SS", "SS"});
  const Agent agent{"a", true, {&perfect, &perfect}, 2};
  const AgentFigures figures = FiguresOf(agent);
  const std::vector<CourseTotal> courses(3, {2.0, 2.0});
  EXPECT_EQ(figures.success().estimate->interval, EstimateRate(courses).interval)
      << "seeds drive the same starts, and count once";
  EXPECT_FALSE(Of(figures, "success_rate_iqm").estimate->interval);
  EXPECT_FALSE(Of(figures, "survival_time_s").estimate);
  // One course: further episodes on it.
  const Result one = MakeResult("b", {"SSC"});
  const std::vector<CourseTotal> alone{{2.0, 3.0}};
  EXPECT_EQ(FiguresOf({"b", true, {&one}, 1}).success().estimate->interval,
            EstimateRate(alone).interval);
  const std::vector<CourseTotal> seeds(2, {2.0, 3.0});
  EXPECT_EQ(FiguresOf({"b", true, {&one, &one}, 2}).success().estimate->interval,
            EstimateRate(seeds).interval);
}

TEST(CompareAgents, ADifferenceIsTurnedRoundWithItsAgents) {
  const Study study;
  const Agent first{"a", true, {&study.results[0], &study.results[1]}, 2};
  const Agent second{"b", true, {&study.results[2]}, 1};
  for (const Quantity& quantity : Quantities()) {
    if (quantity.aggregate != Aggregate::kMean) continue;
    const auto there = DifferenceOf(first, second, quantity);
    const auto back = DifferenceOf(second, first, quantity);
    ASSERT_TRUE(there && back) << quantity.key;
    EXPECT_NEAR(there->value, -back->value, 1e-12) << quantity.key;
  }
  EXPECT_FALSE(DifferenceOf(first, {"none", true, {}, 1}, Quantities()[0]));
  const Result perfect = MakeResult("p", {"SS", "SS", "SS", "SS"});
  const Quantity& survival = Quantities()[Place("survival_time_s")];
  EXPECT_FALSE(DifferenceOf(first, {"p", true, {&perfect}, 1}, survival)) << "it never failed";
  EXPECT_FALSE(ValueOf(perfect, survival));
}

TEST(CompareResults, NotesSayWhatTheNumbersCannot) {
  Study study;
  study.results[2].training_overlap = TrainingOverlap{3, 4, "static-train"};
  study.results.push_back(MakeResult("c-1", {"SS", "SS", "SS", "SS"}));
  study.agents.push_back({"perfect", {3}});
  const std::vector<std::string> notes = study.Compare().notes;
  ASSERT_EQ(notes.size(), 3u);
  EXPECT_THAT(notes[0], AllOf(HasSubstr("One seed: a|b, 5 % <dwa>, perfect."),
                              HasSubstr("do not cover the noise of training")));
  EXPECT_THAT(notes[1], HasSubstr("perfect (IQM, worst 5 %)"));
  EXPECT_THAT(notes[2], HasSubstr("trained on 3 of these 4 courses"));

  study.results[2].kind = "planner";
  EXPECT_THAT(study.Compare().notes[0], HasSubstr("One seed: perfect."))
      << "planners learn nothing";

  const std::vector<Result> one_course{MakeResult("a", {"SSC"}), MakeResult("b", {"SCC"})};
  const std::vector<AgentResults> both{{"a", {0}}, {"b", {1}}};
  const Comparison comparison = CompareResults(one_course, both);
  EXPECT_THAT(comparison.groups[0].notes[0], HasSubstr("one course only"));
  EXPECT_EQ(comparison.groups[0].pairs[0].test.p_value, 1.0);
  EXPECT_THAT(MarkdownOf(comparison.groups), HasSubstr("one course only"));
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

TEST(MarkdownOf, HasTablesOfAgentsAndOfPairs) {
  const Study study;
  const std::string text = MarkdownOf(CompareResults(study.results, study.agents).groups);
  EXPECT_THAT(text, HasSubstr("# Evaluations\n\nProtocol paper: 80 s"));
  EXPECT_THAT(text, HasSubstr("\n## static-test\n\n4 courses.\n\n| agent | seeds | episodes | "
                              "success [%] | IQM [%] | worst 5 % [%] | collision [%] | "));
  EXPECT_THAT(text, HasSubstr("| td3 | 2 | 16 | 68.8 ("));
  EXPECT_THAT(text, HasSubstr("| a\\|b, 5 % \\<dwa\\> | 1 | 8 | 25.0 ("));
  EXPECT_THAT(text, HasSubstr("| td3 | a\\|b, 5 % \\<dwa\\> | +43.8 (-"));
  EXPECT_THAT(text, HasSubstr("| 0.125 | – | too few seeds to tell | 87.5 ("));
  EXPECT_THAT(text, HasSubstr("| first | second | collision [points] | timeout [points] | "));
  EXPECT_THAT(text, HasSubstr("One seed: a\\|b"));
  EXPECT_THAT(text, Not(HasSubstr("touched")));
}

TEST(MarkdownOf, ShowsContactsWhereCollisionsEndNothingAndNoSeedsOfPlanners) {
  std::vector<Result> results{MakeResult("a", {"SS", "SC"})};
  results[0].kind = "planner";
  results[0].protocol["collision_ends"] = "false";
  results[0].courses[0].episodes[1].num_collisions = 3;
  const std::string text = MarkdownOf(CompareResults(results, AgentsOf(results)).groups);
  EXPECT_THAT(text, HasSubstr("| touched [%] |"));
  EXPECT_THAT(text, HasSubstr("| td3 | – | 4 | 75.0 ("));
  EXPECT_THAT(text, Not(HasSubstr("verdict")));
}

/// The lines of a CSV with as many fields as the head, by their heads.
std::vector<std::map<std::string, std::string>> ReadCsv(const std::string& text) {
  const auto split = [](const std::string& line) {
    std::vector<std::string> fields(1);
    bool is_quoted = false;
    for (const char c : line) {
      if (c == '"') {
        is_quoted = !is_quoted;
      } else if (c == ',' && !is_quoted) {
        fields.emplace_back();
      } else {
        fields.back() += c;
      }
    }
    return fields;
  };
  std::istringstream stream(text);
  std::string line;
  std::getline(stream, line);
  const std::vector<std::string> head = split(line);
  std::vector<std::map<std::string, std::string>> lines;
  while (std::getline(stream, line)) {
    const std::vector<std::string> fields = split(line);
    EXPECT_EQ(fields.size(), head.size()) << line;
    auto& by_head = lines.emplace_back();
    for (std::size_t i = 0; i < fields.size(); ++i) by_head[head[i]] = fields[i];
  }
  return lines;
}

TEST(FiguresCsv, HasALineForEachAgent) {
  const Study study;
  const Comparison comparison = CompareResults(study.results, study.agents);
  const auto lines = ReadCsv(FiguresCsv(comparison.groups));
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[1].at("agent"), "a|b, 5 % <dwa>");
  const auto& td3 = lines[0];
  EXPECT_EQ(td3.at("course_set"), "static-test");
  EXPECT_EQ(td3.at("seeds"), "2");
  EXPECT_EQ(td3.at("success_rate"), "0.687500");
  EXPECT_NE(td3.at("success_rate_low"), "");
  EXPECT_EQ(td3.at("success_rate_seed_mean"), "0.687500");
  EXPECT_EQ(td3.at("success_rate_iqm"), "0.750000");
  EXPECT_EQ(td3.at("files"), "a-1 a-2");
  EXPECT_EQ(lines[1].at("success_rate_deviation"), "") << "one seed";
}

TEST(PairsCsv, HasALineForEachPair) {
  const Study study;
  const auto lines = ReadCsv(PairsCsv(CompareResults(study.results, study.agents).groups));
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].at("first"), "td3");
  EXPECT_EQ(lines[0].at("success_rate_difference"), "0.437500");
  EXPECT_EQ(lines[0].at("collision_rate_difference"), "-0.250000");
  EXPECT_EQ(lines[0].at("probability_of_improvement"), "0.875000");
  EXPECT_EQ(lines[0].at("p_value_holm"), "0.125000");
  EXPECT_EQ(lines[0].at("training_p_value"), "");
  EXPECT_EQ(lines[0].at("verdict"), "too few seeds to tell");
}

TEST(JsonOf, HasTheFiguresAndThePairsOfAGroup) {
  const Group group = Study().Compare();
  const nlohmann::json data = JsonOf(group);
  EXPECT_EQ(data["columns"][0], "success_rate");
  EXPECT_EQ(data["agents"][1]["label"], "a|b, 5 % <dwa>");
  const nlohmann::json& success = data["agents"][0]["figures"]["success_rate"];
  EXPECT_EQ(success["estimate"][0], group.agents[0].success().estimate->value);
  EXPECT_EQ(success["estimate"][1], group.agents[0].success().estimate->interval->low);
  EXPECT_EQ(success["seeds"], nlohmann::json({0.75, 0.625}));
  EXPECT_EQ(data["agents"][0]["profile"].size(), ProfileThresholds().size());
  EXPECT_EQ(data["pairs"][0]["p_corrected"], 0.125);
  EXPECT_TRUE(data["pairs"][0]["training_p"].is_null());
  EXPECT_EQ(data["pairs"][0]["verdict"], "too few seeds to tell");
  EXPECT_EQ(data["pairs"][0]["differences"]["success_rate"][0], group.pairs[0].difference().value);
  EXPECT_EQ(QuantitiesJson().size(), Quantities().size());
  EXPECT_TRUE(QuantitiesJson()[Place("traversal_time_s")]["limit"].is_null());
}

TEST(CompareResults, ShowsTheSettingsInWhichAgentsDiffer) {
  Study study;
  for (Result& result : study.results) result.settings = {{"run.max_seconds", "20.0"}};
  const auto text = [&] { return MarkdownOf(CompareResults(study.results, study.agents).groups); };
  EXPECT_THAT(text(), Not(HasSubstr("Settings")));
  study.results[2].settings = {{"run.max_seconds", "90.0"}};
  EXPECT_THAT(text(), HasSubstr("\n\n### Settings in which the policies differ\n\n"
                                "| key | td3 | a\\|b, 5 % \\<dwa\\> |\n|---|---|---|\n"
                                "| `run.max_seconds` | `20.0` | `90.0` |\n"));
  EXPECT_EQ(JsonOf(study.Compare())["settings"][0]["rows"][0],
            nlohmann::json({"run.max_seconds", "20.0", "90.0"}));
}

}  // namespace
}  // namespace slalom::eval
