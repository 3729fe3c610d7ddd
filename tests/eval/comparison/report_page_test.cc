#include "eval/comparison/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/random.h"
#include "eval/comparison/printers.h"
#include "sim/courses/motion.h"
#include "tests/eval/report/made_evaluation.h"
#include "tests/support/scratch_directory.h"

namespace slalom::eval {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<Result> Read(const std::vector<std::pair<std::string, Evaluation>>& evaluations) {
  const test::ScratchDirectory scratch;
  std::vector<Result> results;
  for (const auto& [agent, evaluation] : evaluations) {
    const auto directory = scratch.path() / std::to_string(results.size());
    WriteReports(evaluation, testing::MakeProvenance(agent), directory);
    results.push_back(ReadResult(directory));
  }
  return results;
}

Comparison Compare(std::span<const Result> results) {
  return CompareResults(results, AgentsOf(results));
}

/// The 16-bit integers of packed numbers, times their scale.
std::vector<double> Unpack(const json& packed) {
  static constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<double> numbers;
  std::string bytes;
  unsigned bits = 0;
  int num_bits = 0;
  for (const char c : packed[1].get<std::string>()) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<unsigned>(kDigits.find(c));
    num_bits += 6;
    if (num_bits >= 8) bytes += static_cast<char>(bits >> (num_bits -= 8) & 255u);
  }
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    const auto low = static_cast<unsigned char>(bytes[i]);
    const auto high = static_cast<unsigned char>(bytes[i + 1]);
    numbers.push_back(packed[0].get<double>() * static_cast<std::int16_t>(low | high << 8));
  }
  return numbers;
}

TEST(ReportPageData, HasTheResultsFigures) {
  const std::vector<Result> results = Read({{"dwa", testing::MakeEvaluation({0.2, 0.5, 0.8})},
                                            {"teb", testing::MakeEvaluation({0.9, 0.9, 0.1})}});
  const json data = json::parse(ReportPageData(Compare(results)));
  ASSERT_EQ(data["results"].size(), 2u);
  ASSERT_EQ(data["groups"].size(), 1u);
  EXPECT_EQ(data["groups"][0]["courses"].size(), 3u);
  for (std::size_t r = 0; r < 2; ++r) {
    const json& figures = data["groups"][0]["agents"][r]["figures"];
    EXPECT_NEAR(figures["success_rate"]["estimate"][0].get<double>(),
                results[r].set.success_rate.value, 1e-12);
    EXPECT_NEAR(figures["survival_time_s"]["estimate"][0].get<double>(),
                results[r].set.survival_time->value, 1e-12);
    EXPECT_NEAR(figures["barn_score"]["estimate"][0].get<double>(), results[r].set.barn_score.value,
                1e-12);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto outcomes = data["results"][r]["outcomes"][c].get<std::string>();
      ASSERT_EQ(outcomes.size(), 5u);
      for (std::size_t k = 0; k < 5; ++k) {
        const ResultEpisode& episode = results[r].courses[c].episodes[k];
        EXPECT_EQ(outcomes[k] == 'S', episode.outcome == env::Outcome::kSuccess);
        EXPECT_NEAR(data["results"][r]["times_cs"][c][k].get<double>(), 100.0 * episode.time, 0.5);
      }
    }
  }
}

TEST(ReportPageData, HasTheGroupsOfTheComparisonAndWhatWasTrainedOnItsTest) {
  std::vector<Result> results = Read({{"dwa", testing::MakeEvaluation({0.2, 0.5, 0.8})},
                                      {"alone", testing::MakeEvaluation({0.5}, {}, "other-")},
                                      {"teb", testing::MakeEvaluation({0.9, 0.9, 0.1})},
                                      {"mppi", testing::MakeEvaluation({0.9, 0.1, 0.1})}});
  results[2].training_overlap = TrainingOverlap{2, 3, "static-train"};
  results[3].training_overlap = TrainingOverlap{0, 3, "static-train"};
  const Comparison comparison = Compare(results);
  const json data = json::parse(ReportPageData(comparison));
  ASSERT_EQ(data["groups"].size(), 2u);
  for (std::size_t g = 0; g < 2; ++g) {
    const json of_group = JsonOf(comparison.groups[g]);
    for (const auto& [key, value] : of_group.items()) EXPECT_EQ(data["groups"][g][key], value);
  }
  EXPECT_EQ(data["groups"][0]["pairs"].size(), 3u);
  EXPECT_EQ(data["groups"][0]["results"], json({0, 1, 2}));
  EXPECT_EQ(data["groups"][1]["results"], json({3}));
  EXPECT_EQ(data["results"][1]["training_overlap"],
            json({{"courses", 2}, {"of", 3}, {"trained_on", "static-train"}}));
  for (const int r : {0, 2, 3}) EXPECT_FALSE(data["results"][r].contains("training_overlap")) << r;
}

TEST(ReportPageData, HasTheEpisodesOfTheSeedsOneAfterTheOther) {
  const std::vector<Result> results = Read(
      {{"a", testing::MakeEvaluation({0.5, 0.5})}, {"a", testing::MakeEvaluation({0.1, 0.9})}});
  const std::vector<AgentResults> agents{{"both", {0, 1}}};
  const json data = json::parse(ReportPageData(CompareResults(results, agents)));
  ASSERT_EQ(data["results"].size(), 1u);
  const json& both = data["results"][0];
  const auto outcomes = both["outcomes"][1].get<std::string>();
  ASSERT_EQ(outcomes.size(), 10u);
  for (std::size_t k = 0; k < 10; ++k) {
    const ResultEpisode& episode = results[k / 5].courses[1].episodes[k % 5];
    EXPECT_EQ(outcomes[k] == 'S', episode.outcome == env::Outcome::kSuccess) << k;
  }
  ASSERT_EQ(both["tracks"].size(), results[0].tracks.size() + results[1].tracks.size());
  for (const json& track : both["tracks"]) {
    const auto of_course = both["outcomes"][track["course"].get<std::size_t>()].get<std::string>();
    EXPECT_EQ(of_course.substr(track["episode"].get<std::size_t>(), 1), track["outcome"]);
  }
}

TEST(ReportPageData, TracksCoursesAndMotionsAreTheResultsWithinTheirResolution) {
  const std::vector<Result> results = Read({{"reactive", testing::DriveCourses(2)}});
  const json data = json::parse(ReportPageData(Compare(results)));
  const sim::Course& course = *results[0].course_set_data.courses[1];
  const json& course_json = data["groups"][0]["courses"][1];
  const std::vector<double> circles = Unpack(course_json["circles"]);
  ASSERT_EQ(circles.size(), 45u);
  EXPECT_NEAR(circles[3], course.circles[1].p_W.x, 0.00051);
  EXPECT_NEAR(circles[5], course.circles[1].radius, 0.00051);
  ASSERT_EQ(Unpack(course_json["boxes"]).size(), 15u);

  ASSERT_EQ(course_json["moving"].size(), 2u);
  const sim::Motion motion(course.moving[0]);
  const json& moving = course_json["moving"][0];
  EXPECT_EQ(moving["period"], 12.0);
  const std::vector<double> motion_points = Unpack(moving["points"]);
  ASSERT_EQ(motion_points.size(), 2u * 121u);
  for (int k = 0; k < 120; ++k) {
    EXPECT_NEAR(motion_points[2 * k + 1], motion.At(0.1 * k).X_WB.p.y, 0.00051) << k;
  }

  ASSERT_EQ(results[0].tracks.size(), 2u);
  const sim::EpisodeTrack& track = results[0].tracks[1];
  const json& track_json = data["results"][0]["tracks"][1];
  EXPECT_EQ(track_json["course"], 1);
  EXPECT_EQ(track_json["frame_time"], 0.2);
  EXPECT_EQ(track_json["motion_start"], track.motion_start);
  const std::vector<double> points = Unpack(track_json["points"]);
  ASSERT_EQ(points.size(), 2 * track.poses.size());
  for (std::size_t i = 0; i < track.poses.size(); ++i) {
    EXPECT_NEAR(points[2 * i], track.poses[i].p.x, 0.00051);
  }
  EXPECT_EQ(track_json["scans"]["beams"], track.scans_cm.front().size());
  const std::size_t num_ranges = track.poses.size() * track.scans_cm.front().size();
  EXPECT_EQ(track_json["scans"]["ranges"].get<std::string>().size(), (num_ranges + 2) / 3 * 4);
}

TEST(ReportPageData, ThinsFramesButKeepsTheLast) {
  std::vector<Result> results = Read({{"dwa", testing::MakeEvaluation({0.5})}});
  sim::EpisodeTrack& track = results[0].tracks[0];
  track.step = 0.03;
  track.poses.clear();
  for (int i = 0; i <= 1000; ++i) track.poses.push_back({{0.001 * i, 0.0}, 0.0});
  track.beams.reset();
  track.interventions = {3, 4, 6, 999};
  const json json_track = json::parse(ReportPageData(Compare(results)))["results"][0]["tracks"][0];
  EXPECT_DOUBLE_EQ(json_track["frame_time"], 0.12);
  EXPECT_DOUBLE_EQ(json_track["duration"], 30.0);
  const std::vector<double> points = Unpack(json_track["points"]);
  ASSERT_EQ(points.size(), 2u * 251u);
  EXPECT_NEAR(points[2], 0.004, 1e-9);
  EXPECT_NEAR(points[2 * 250], 1.0, 1e-9);
  EXPECT_THAT(Unpack(json_track["guarded"]), ::testing::ElementsAre(0, 1, 249));
  track.interventions.clear();
  const json plain = json::parse(ReportPageData(Compare(results)))["results"][0]["tracks"][0];
  EXPECT_FALSE(plain.contains("guarded"));
}

/// `num_results` results on 300 courses like BARN's, 30 s long at 20 Hz.
std::vector<Result> ManyResults(int num_results) {
  base::Random random(1);
  Result result = Read({{"dwa", testing::MakeEvaluation({0.5})}}).front();
  result.courses.resize(300, result.courses.front());
  result.course_set_data.courses.clear();
  sim::EpisodeTrack track = result.tracks.front();
  track.step = 0.05;
  track.beams.reset();
  track.scans_cm.clear();
  for (int i = 0; i < 600; ++i) track.poses.push_back({{0.01 * i, 0.0}, 0.0});
  result.tracks.clear();
  for (int c = 0; c < 300; ++c) {
    sim::Course course;
    course.name = result.courses[c].name = "course-" + std::to_string(c);
    for (int k = 0; k < 263; ++k) {
      course.circles.push_back({{random.Uniform(-5.0, 0.0), random.Uniform(0.0, 10.0)}, 0.075});
    }
    for (int k = 0; k < 12; ++k) {
      course.moving.push_back({0.3, {}, {{0.0, {}}, {20.0, {{3.0, 2.0}, 0.0}}}, {}});
    }
    result.course_set_data.courses.push_back(std::make_shared<const sim::Course>(course));
    track.course = course.name;
    result.tracks.push_back(track);
    if (c % 50 == 0) {
      result.tracks.back().beams = sim::TrackBeams{};
      result.tracks.back().scans_cm.assign(track.poses.size(), std::vector<std::uint16_t>(90, 77));
    }
  }
  return std::vector<Result>(static_cast<std::size_t>(num_results), result);
}

TEST(ReportPage, StaysAFewMegabytes) {
  // 2.0 MB of tracks, 2.0 MB of scans, 1.2 MB of motions, 0.7 MB of courses and what is between.
  const std::vector<Result> four = ManyResults(4);
  EXPECT_LT(ReportPage(Compare(four)).size(), 5'500'000u);
  EXPECT_LT(ReportPage(Compare(std::span(four).first(1))).size(), 4'000'000u);
}

TEST(ReportPage, HoldsEverythingItNeeds) {
  const std::vector<Result> results = Read({{"dwa", testing::MakeEvaluation({0.5, 0.5})}});
  const std::string page = ReportPage(Compare(results));
  // The one address is the name of SVG's elements, which nothing fetches.
  for (std::size_t at = 0; (at = page.find("http", at)) != std::string::npos; ++at) {
    const std::string near = page.substr(at, 26);
    EXPECT_TRUE(near == "http://www.w3.org/2000/svg" || near.starts_with("http-equiv")) << near;
  }
  EXPECT_THAT(page, Not(HasSubstr("src=")));
  EXPECT_THAT(page, Not(HasSubstr("/*DATA*/")));
  EXPECT_THAT(page, Not(HasSubstr("/*SCRIPT*/")));
  EXPECT_THAT(page, Not(HasSubstr("/*STYLE*/")));
}

TEST(ReportPage, NamesCannotEndTheirElement) {
  const std::string name = "</script><script>alert(1)</script>";
  const std::vector<Result> results = Read({{name, testing::MakeEvaluation({0.5})}});
  const std::string page = ReportPage(Compare(results));
  EXPECT_THAT(page, Not(HasSubstr("alert(1)</script>")));
  EXPECT_THAT(page, HasSubstr("\\u003c/script>\\u003cscript>alert(1)"));
}

}  // namespace
}  // namespace slalom::eval
