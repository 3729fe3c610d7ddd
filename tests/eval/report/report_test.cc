#include "eval/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "base/file.h"
#include "sim/courses/course_file.h"
#include "tests/eval/report/made_evaluation.h"

namespace slalom::eval {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::MakeEvaluation;

const Provenance kProvenance{"x",           "policy",      "runs/x/policy.safetensors",
                             {"real.toml"}, "static-test", "",
                             "abc123",      "[a]\n"};

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

TEST(JsonReport, HoldsTheSetsFigures) {
  const Evaluation evaluation = MakeEvaluation({0.2, 0.5, 0.8});
  const Figures& set = evaluation.summary.set;
  const json report = json::parse(JsonReport(evaluation, kProvenance));
  EXPECT_EQ(report["episodes"], 15);
  EXPECT_EQ(report["success_rate"], set.success_rate.value);
  EXPECT_EQ(report["success_rate_interval"][0], set.success_rate.interval->low);
  EXPECT_EQ(report["success_rate_interval"][1], set.success_rate.interval->high);
  EXPECT_EQ(report["collision_rate"], set.collision_rate.value);
  EXPECT_EQ(report["collision_rate_interval"][1], set.collision_rate.interval->high);
  EXPECT_EQ(report["timeout_rate"], set.timeout_rate.value);
  EXPECT_EQ(report["timeout_rate_interval"][0], set.timeout_rate.interval->low);
  EXPECT_EQ(report["survival_time_s"], set.survival_time->value);
  EXPECT_EQ(report["traversal_time_s"], set.traversal_time->value);
  EXPECT_EQ(report["barn_score"], set.barn_score.value);
  EXPECT_EQ(report["barn_score_interval"].size(), 2u);
  EXPECT_EQ(report["format"], "slalom-evaluation");
  EXPECT_EQ(report["version"], kResultVersion);
  EXPECT_EQ(report["contact_rate"], set.contact_rate.value);
  EXPECT_EQ(report["agent"], json({{"name", "x"}, {"kind", "policy"}}));
  EXPECT_EQ(report["protocol"]["name"], "paper");
  EXPECT_EQ(report["protocol"]["time_limit_s"], 80.0);
  EXPECT_EQ(report["run"]["seed"], 1);
  EXPECT_EQ(report["run"]["step_s"], 0.2);
  EXPECT_EQ(report["provenance"]["source"], "runs/x/policy.safetensors");
  EXPECT_EQ(report["provenance"]["commit"], "abc123");
  ASSERT_EQ(report["courses"].size(), 3u);
  EXPECT_EQ(report["courses"][2]["course"], "course-2");
  EXPECT_EQ(report["courses"][2]["episodes"], 5);
  for (std::size_t k = 0; k < 15; ++k) {
    const EpisodeRecord& record = evaluation.episodes.records[k];
    const json& course = report["courses"][k / 5];
    EXPECT_EQ(course["outcomes"][k % 5], env::ToString(record.outcome));
    EXPECT_EQ(course["times_s"][k % 5], record.time(0.2));
    EXPECT_EQ(course["collisions_per_episode"][k % 5], record.num_collisions);
  }
}

TEST(JsonReport, HasNullWhereThereIsNoFigure) {
  const json won = json::parse(JsonReport(MakeEvaluation({1.0, 1.0}), kProvenance));
  EXPECT_TRUE(won["survival_time_s"].is_null());
  EXPECT_TRUE(won["survival_time_s_interval"].is_null());
  EXPECT_TRUE(won["traversal_time_s"].is_number());
  const json lost = json::parse(JsonReport(MakeEvaluation({0.0}), kProvenance));
  EXPECT_TRUE(lost["traversal_time_s"].is_null());
  EXPECT_TRUE(lost["survival_time_s"].is_number());
  EXPECT_TRUE(lost["survival_time_s_interval"].is_null());  // One course has no spread.
}

TEST(JsonReport, SurvivesAPathThatIsNotUtf8) {
  const std::string text =
      JsonReport(MakeEvaluation({1.0}), {"\xff\xfe", "", "\xff", {}, "", "", "", ""});
  EXPECT_TRUE(json::accept(text));
}

// The bytes of evaluation.json under each protocol, so that a change of what a protocol means, or
// of how it is resolved, is seen.
TEST(JsonReport, HasTheSameBytesForAFixedSeed) {
  const std::map<std::string, std::uint64_t> golden = {
      {"paper", 11970961238905224629ull},
      {"dwa-runs", 17161921331100488898ull},
      {"barn-challenge", 17597559885116862385ull},
      {"paper, 20 s, 0.9 m", 5689971812547055817ull}};
  for (const auto& [name, checksum] : golden) {
    EvaluationConfig config;
    config.protocol = name.substr(0, name.find(','));
    if (config.protocol != name) {
      config.time_limit = 20.0;
      config.goal_tolerance = 0.9;
    }
    EXPECT_EQ(base::Checksum(std::string_view(
                  JsonReport(MakeEvaluation({0.0, 0.5, 1.0}, config), kProvenance))),
              checksum)
        << name;
  }
}

TEST(CourseCsv, HasOneFullLinePerCourse) {
  const auto lines = Split(CourseCsv(MakeEvaluation({0.0, 0.5, 1.0})), '\n');
  ASSERT_EQ(lines.size(), 4u);
  for (const std::string& line : lines) EXPECT_EQ(Split(line, ',').size(), 21u) << line;
  EXPECT_THAT(lines[3], ::testing::StartsWith("course-2,5,5,0,0,1.000000,"));
}

TEST(EpisodeCsv, HasOneFullLinePerEpisode) {
  const Evaluation evaluation = MakeEvaluation({0.0, 0.5, 1.0});
  const auto lines = Split(EpisodeCsv(evaluation), '\n');
  ASSERT_EQ(lines.size(), 16u);
  for (const std::string& line : lines) EXPECT_EQ(Split(line, ',').size(), 14u) << line;
  const EpisodeRecord& last = evaluation.episodes.records.back();
  EXPECT_THAT(lines.back(), ::testing::StartsWith("course-2,4," + std::to_string(last.seed) +
                                                  ",success," + std::to_string(last.num_steps)));
}

TEST(TextReport, NamesTheWorstCoursesFirst) {
  const std::string text = TextReport(MakeEvaluation({1.0, 0.5, 0.0, 1.0}), 1);
  EXPECT_THAT(text, HasSubstr("made: 4 courses x 5 episodes, seed 1"));
  EXPECT_THAT(text, HasSubstr("of 20 episodes"));
  EXPECT_THAT(text, HasSubstr("the worst:\n    course-2 "));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("course-1")));
  EXPECT_THAT(TextReport(MakeEvaluation({1.0, 1.0})), HasSubstr("every course succeeded"));
}

TEST(WriteReports, WritesEveryFile) {
  const std::filesystem::path directory =
      std::filesystem::path(::testing::TempDir()) / "slalom-write-reports";
  const Evaluation evaluation = MakeEvaluation({0.5});
  WriteReports(evaluation, kProvenance, directory);
  EXPECT_EQ(base::ReadFile(directory / "evaluation.json"), JsonReport(evaluation, kProvenance));
  EXPECT_EQ(base::ReadFile(directory / "evaluation-courses.csv"), CourseCsv(evaluation));
  EXPECT_EQ(base::ReadFile(directory / "evaluation-episodes.csv"), EpisodeCsv(evaluation));
  EXPECT_EQ(sim::ReadEpisodes(directory / "evaluation-tracks.jsonl"), evaluation.episodes.tracks);
  const sim::CourseSet courses = sim::ReadCourseSet(directory / "evaluation.courses");
  EXPECT_EQ(courses.name, "made");
  ASSERT_EQ(courses.courses.size(), 1u);
  EXPECT_EQ(*courses.courses.front(), *evaluation.task.courses.courses.front());
  EXPECT_THROW(WriteReports(evaluation, kProvenance, directory / "evaluation.json"), base::Error);
  std::filesystem::remove_all(directory);
}

TEST(TextReport, CountsCollisionsThatEndNothing) {
  Evaluation evaluation = MakeEvaluation({0.5});
  EXPECT_THAT(TextReport(evaluation), ::testing::Not(HasSubstr("touched")));
  EvaluationConfig config;
  config.protocol = "dwa-runs";
  evaluation.task.protocol = ResolveProtocol(config);
  EXPECT_THAT(TextReport(evaluation), HasSubstr("touched"));
  EXPECT_THAT(
      TextReport(evaluation),
      HasSubstr("protocol dwa-runs: 113 s, goal within 0.4 m or 6.925 m ahead of the start"));
}

TEST(TextReport, NamesThePhysicsOfOthersOnly) {
  Evaluation evaluation = MakeEvaluation({1.0});
  EXPECT_THAT(TextReport(evaluation), ::testing::Not(HasSubstr("physics")));
  evaluation.task.physics = {"ode", "1.2.3", [](const auto&, auto, int) {
                               return std::vector<std::unique_ptr<sim::RobotBody>>();
                             }};
  EXPECT_THAT(TextReport(evaluation), HasSubstr("physics ode 1.2.3\n"));
  const Result result = ResultOf(evaluation, kProvenance);
  EXPECT_EQ(result.physics, "ode");
  EXPECT_EQ(result.course_set_data.courses, evaluation.task.courses.courses);
  EXPECT_EQ(result.set.success_rate.value, evaluation.summary.set.success_rate.value);
}

}  // namespace
}  // namespace slalom::eval
