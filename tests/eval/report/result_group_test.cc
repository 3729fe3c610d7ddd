#include "eval/report/result_group.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/eval/report/made_evaluation.h"

namespace slalom::eval {
namespace {

using ::testing::HasSubstr;

Result MakeResult(const std::string& agent, const std::string& course_set = "static-test") {
  Result result;
  result.agent = agent;
  result.kind = "planner";
  result.file = "out/" + agent + "/evaluation.json";
  result.course_set = course_set;
  result.protocol = testing::PaperProtocol();
  sim::Course course;
  course.name = "one";
  result.course_set_data = {course_set, {std::make_shared<const sim::Course>(course)}};
  result.courses.resize(1);
  return result;
}

TEST(ResultGroup, GroupsByCourses) {
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

TEST(ResultGroup, LabelsTellResultsOfOneGroupApart) {
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

TEST(ResultGroup, AgentsAreInTheGroupsOfTheirResults) {
  const std::vector<Result> results{MakeResult("dwa"), MakeResult("dwa", "dynamic-box"),
                                    MakeResult("teb")};
  const std::vector<AgentResults> alone = AgentsOf(results);
  ASSERT_EQ(alone.size(), 3u);
  EXPECT_EQ(alone[2].label, "teb");
  EXPECT_EQ(alone[2].results, std::vector<std::size_t>{2});
  const std::vector<AgentResults> named{{"ours", {0, 1}}, {"theirs", {2}}};
  const std::vector<ResultGroup> groups = GroupByCourses(results);
  EXPECT_EQ(AgentsIn(groups[0], named).size(), 2u);
  ASSERT_EQ(AgentsIn(groups[1], named).size(), 1u);
  EXPECT_EQ(AgentsIn(groups[1], named)[0].label, "ours");
  EXPECT_EQ(AgentsIn(groups[1], named)[0].results, std::vector<std::size_t>{1});
}

TEST(ResultGroup, TellsTheRulesAndWhatWasTrainedOn) {
  Result result = MakeResult("td3");
  EXPECT_THAT(ProtocolSentence(result),
              HasSubstr("Protocol paper: 80 s, goal within 0.4 m, a collision ends"));
  EXPECT_EQ(OverlapSentence(result, "td3"), "");
  result.training_overlap = TrainingOverlap{0, 50, "static-train"};
  EXPECT_EQ(OverlapSentence(result, "td3"), "");
  result.training_overlap = TrainingOverlap{40, 50, "static-train"};
  EXPECT_EQ(OverlapSentence(result, "td3"),
            "td3 was trained on 40 of these 50 courses (static-train).");
}

}  // namespace
}  // namespace slalom::eval
