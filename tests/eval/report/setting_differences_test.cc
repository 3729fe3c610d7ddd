#include "eval/report/setting_differences.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace slalom::eval {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

Result MakeResult(const std::string& kind, std::map<std::string, std::string> settings) {
  Result result;
  result.kind = kind;
  result.settings = std::move(settings);
  return result;
}

std::vector<SettingDifferences> Among(const std::vector<Result>& results,
                                      const std::vector<AgentResults>& agents) {
  return FindSettingDifferences(results, agents);
}

const std::map<std::string, std::string> kShort = {
    {"learner.gamma", "0.99"},   {"network.layers", "[64, 64]"},
    {"run.max_seconds", "20.0"}, {"run.name", "\"short\""},
    {"run.seed", "1"},           {"service.state", "\"a\""}};

/// `kShort` with other values.
std::map<std::string, std::string> With(const std::map<std::string, std::string>& changes) {
  std::map<std::string, std::string> settings = kShort;
  for (const auto& [key, value] : changes) settings[key] = value;
  return settings;
}

TEST(SettingDifferences, AreTheKeysWhoseValuesDiffer) {
  const std::vector<Result> results{MakeResult("policy", kShort),
                                    MakeResult("policy", With({{"run.max_seconds", "90.0"},
                                                               {"network.layers", "[256, 256]"},
                                                               {"run.name", "\"long\""},
                                                               {"service.state", "\"b\""}})),
                                    MakeResult("policy", With({{"run.max_seconds", "90.0"}}))};
  const auto found = Among(results, {{"short", {0}}, {"long", {1}}, {"third", {2}}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_THAT(found[0].labels, ElementsAre("short", "long", "third"));
  ASSERT_EQ(found[0].rows.size(), 2u);
  EXPECT_EQ(found[0].rows[0].key, "network.layers");
  EXPECT_THAT(found[0].rows[0].values, ElementsAre("[64, 64]", "[256, 256]", "[64, 64]"));
  EXPECT_EQ(found[0].rows[1].key, "run.max_seconds");
  EXPECT_THAT(found[0].rows[1].values, ElementsAre("20.0", "90.0", "90.0"));
}

TEST(SettingDifferences, AreNoneIfNothingDiffersOrThereIsOneAgent) {
  const std::vector<Result> results{MakeResult("policy", kShort),
                                    MakeResult("policy", With({{"run.name", "\"again\""}})),
                                    MakeResult("policy", With({{"learner.gamma", "0.5"}}))};
  EXPECT_THAT(Among(results, {{"a", {0}}, {"b", {1}}}), IsEmpty());
  EXPECT_THAT(Among(results, {{"a", {2}}}), IsEmpty());
  EXPECT_THAT(Among(results, {{"seeds", {0, 1, 2}}}), IsEmpty());
  EXPECT_EQ(MarkdownOf(Among(results, {{"a", {0}}}), 2), "");
}

TEST(SettingDifferences, ComparePoliciesWithPoliciesAndPlannersWithPlanners) {
  const std::vector<Result> results{MakeResult("policy", kShort),
                                    MakeResult("planner", {{"dwa.speed", "0.5"}}),
                                    MakeResult("policy", With({{"learner.gamma", "0.5"}})),
                                    MakeResult("planner", {{"dwa.speed", "2.0"}}),
                                    MakeResult("python", {{"learner.gamma", "0.1"}})};
  const auto found =
      Among(results, {{"a", {0}}, {"dwa", {1}}, {"b", {2}}, {"fast", {3}}, {"mine", {4}}});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].kind, "policy");
  EXPECT_THAT(found[0].labels, ElementsAre("a", "b"));
  EXPECT_THAT(found[0].rows[0].values, ElementsAre("0.99", "0.5"));
  EXPECT_EQ(found[1].kind, "planner");
  EXPECT_THAT(found[1].labels, ElementsAre("dwa", "fast"));
  EXPECT_EQ(found[1].rows[0].key, "dwa.speed");
}

TEST(SettingDifferences, OfSeveralSeedsAreThoseOfAllTogether) {
  std::vector<Result> results;
  for (const char* seed : {"1", "2"}) {
    results.push_back(MakeResult("policy", With({{"run.seed", seed}})));
  }
  for (const char* seed : {"2", "1"}) {
    results.push_back(MakeResult("policy", With({{"run.seed", seed}, {"learner.gamma", "0.9"}})));
  }
  const auto same_seeds = Among(results, {{"a", {0, 1}}, {"b", {2, 3}}});
  ASSERT_EQ(same_seeds.size(), 1u);
  ASSERT_EQ(same_seeds[0].rows.size(), 1u);
  EXPECT_EQ(same_seeds[0].rows[0].key, "learner.gamma");
  const auto other_seeds = Among(results, {{"a", {0, 1}}, {"b", {2}}});
  ASSERT_EQ(other_seeds[0].rows.size(), 2u);
  EXPECT_EQ(other_seeds[0].rows[1].key, "run.seed");
  EXPECT_THAT(other_seeds[0].rows[1].values, ElementsAre("1, 2", "2"));
}

TEST(SettingDifferences, LeaveOutWhatIsNotKnownOfAllAgents) {
  auto newer = With({{"learner.gamma", "0.5"}});
  newer["learner.new_key"] = "7";
  const std::vector<Result> results{MakeResult("policy", kShort), MakeResult("policy", newer),
                                    MakeResult("policy", {})};
  const auto found = Among(results, {{"old", {0}}, {"archived", {2}}, {"new", {1}}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_THAT(found[0].labels, ElementsAre("old", "new"));
  ASSERT_EQ(found[0].rows.size(), 1u);
  EXPECT_EQ(found[0].rows[0].key, "learner.gamma");
}

TEST(SettingDifferences, StandInATableForEachKind) {
  const std::vector<Result> results{MakeResult("policy", {{"a.b_c", "\"x|`y`\""}, {"d", "1"}}),
                                    MakeResult("policy", {{"a.b_c", "[1, 2]"}, {"d", "1"}})};
  const auto found = Among(results, {{"first_1", {0}}, {"second", {1}}});
  EXPECT_EQ(MarkdownOf(found, 3),
            "\n### Settings in which the policies differ\n\n"
            "| key | first\\_1 | second |\n|---|---|---|\n"
            "| `a.b_c` | \"x\\|\\`y\\`\" | `[1, 2]` |\n");
  EXPECT_EQ(JsonOf(found), nlohmann::json::parse(R"([{
      "kind": "policy", "title": "Settings in which the policies differ",
      "labels": ["first_1", "second"], "rows": [["a.b_c", "\"x|`y`\"", "[1, 2]"]]}])"));
}

}  // namespace
}  // namespace slalom::eval
