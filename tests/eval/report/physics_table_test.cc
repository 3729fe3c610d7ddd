#include "eval/report/physics_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/eval/report/made_evaluation.h"

namespace slalom::eval {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

Evaluation In(const std::string& physics, std::vector<double> success_probability) {
  Evaluation evaluation = testing::MakeEvaluation(std::move(success_probability));
  if (physics == "slalom") return evaluation;
  evaluation.task.physics = {physics, "1.2.3", [](const auto&, auto, int) {
                               return std::vector<std::unique_ptr<sim::RobotBody>>();
                             }};
  return evaluation;
}

TEST(PhysicsTable, HasALineForEachPhysicsAndForEachDifference) {
  const Provenance provenance = testing::MakeProvenance("fast");
  const std::vector<Result> results = {ResultOf(In("slalom", {1.0, 1.0, 1.0, 1.0}), provenance),
                                       ResultOf(In("ode", {1.0, 0.0, 0.0, 1.0}), provenance)};
  const std::string table = PhysicsTable(results);
  EXPECT_THAT(table, HasSubstr("| fast | 20 | 100.0"));
  EXPECT_THAT(table, HasSubstr("| fast in ode | 20 | 50.0"));
  EXPECT_THAT(table, HasSubstr("Physics: slalom, ode 1.2.3."));
  // Courses differ by 0, -1, -1 and 0: mean -0.5, standard error sqrt(1 / 3 / 4) = 0.288675, and
  // Student's quantile for three degrees of freedom is 3.182446; cut to -100 points.
  EXPECT_THAT(table, HasSubstr("| ode minus slalom | -50.0 (-100.0 to +41.9) |"));

  EXPECT_THAT(PhysicsTable(std::span(results).first(1)), Not(HasSubstr("minus")));
}

TEST(PhysicsTable, SaysTheSameAsJson) {
  const Provenance provenance = testing::MakeProvenance("fast");
  const std::vector<Evaluation> evaluations = {In("slalom", {0.5, 1.0, 0.8}),
                                               In("ode", {0.5, 0.2, 0.8})};
  std::vector<Result> results;
  std::vector<std::string> reports;
  for (const Evaluation& evaluation : evaluations) {
    results.push_back(ResultOf(evaluation, provenance));
    reports.push_back(JsonReport(evaluation, provenance));
  }
  const json object = json::parse(PhysicsJson(results, reports));
  ASSERT_EQ(object["evaluations"].size(), 2u);
  EXPECT_EQ(object["evaluations"][0], json::parse(reports[0]));
  EXPECT_EQ(object["evaluations"][1]["physics"], (json{{"name", "ode"}, {"version", "1.2.3"}}));
  ASSERT_EQ(object["differences"].size(), 1u);
  const json& difference = object["differences"][0];
  EXPECT_EQ(difference["physics"], "ode");
  EXPECT_EQ(difference["minus"], "slalom");
  const double expected = results[1].set.success_rate.value - results[0].set.success_rate.value;
  EXPECT_NEAR(difference["success_rate"].get<double>(), expected, 1e-12);
  ASSERT_EQ(difference["success_rate_interval"].size(), 2u);
  EXPECT_LT(difference["success_rate_interval"][0], difference["success_rate_interval"][1]);
  EXPECT_TRUE(difference.contains("collision_rate"));
  EXPECT_TRUE(difference.contains("timeout_rate_interval"));
  EXPECT_TRUE(difference.contains("traversal_time_s"));
}

TEST(PhysicsTable, TheTextOfOneEvaluationNamesPhysicsOfOthersOnly) {
  EXPECT_THAT(TextReport(In("ode", {1.0})), HasSubstr("physics ode 1.2.3\n"));
  EXPECT_THAT(TextReport(In("slalom", {1.0})), Not(HasSubstr("physics")));
}

}  // namespace
}  // namespace slalom::eval
