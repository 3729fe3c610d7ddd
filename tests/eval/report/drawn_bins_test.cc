#include "eval/report/drawn_bins.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "eval/report/report.h"
#include "eval/statistics/bootstrap.h"
#include "sim/randomized_config.h"
#include "tests/eval/report/made_evaluation.h"
#include "tests/support/scratch_directory.h"

namespace slalom::eval {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kCourses = 10;
constexpr int kEpisodes = 12;

const std::vector<AgentResults> kThree = {{"a", {0}}, {"b", {1}}, {"c", {2}}};
const std::vector<AgentResults> kTwo = {{"a", {0}}, {"b", {1}}};
const std::vector<AgentResults> kOne = {{"a", {0}}};
const std::vector<AgentResults> kSecond = {{"b", {1}}};

/// Random outcomes, with a number and a name drawn for each episode; success is likelier where the
/// number is small.
Result MakeResult(std::uint64_t seed) {
  base::Random random(seed);
  Result result;
  DrawnField delay{.key = "robot.command_delay", .unit = "s", .names = {}, .values = {}};
  DrawnField law{.key = "robot.friction", .unit = "", .names = {"cone", "gazebo"}, .values = {}};
  for (int c = 0; c < kCourses; ++c) {
    ResultCourse& course = result.courses.emplace_back();
    course.name = std::to_string(c);
    delay.values.emplace_back();
    law.values.emplace_back();
    for (int k = 0; k < kEpisodes; ++k) {
      delay.values[c].push_back(random.Uniform(0.0, 0.12));
      law.values[c].push_back(static_cast<double>(random.UniformInt(2)));
      const bool succeeds = random.Uniform(0.0, 0.12) > delay.values[c][k];
      course.episodes.push_back(
          {succeeds ? env::Outcome::kSuccess : env::Outcome::kCollision, 5.0, succeeds ? 0 : 1});
    }
  }
  result.drawn = {std::move(delay), std::move(law)};
  return result;
}

/// The estimate by counting.
Estimate Counted(const Result& result, int field, double low, double high) {
  RatioTables tables{{"", {std::vector<double>(kCourses)}}, {"", {std::vector<double>(kCourses)}}};
  for (int c = 0; c < kCourses; ++c) {
    for (int k = 0; k < kEpisodes; ++k) {
      const double value = result.drawn[field].values[c][k];
      if (value < low || value > high) continue;
      tables.counts.scores[0][c] += 1.0;
      const bool succeeds = result.courses[c].episodes[k].outcome == env::Outcome::kSuccess;
      if (succeeds) tables.sums.scores[0][c] += 1.0;
    }
  }
  return *BootstrapShare(tables);
}

TEST(DrawnBins, CutNumbersAtTheirQuantilesAndCountEachEpisodeOnce) {
  const std::vector<Result> results = {MakeResult(1)};
  const auto fields = BinByDrawnFields(results, kOne);
  ASSERT_EQ(fields.size(), 2u);
  EXPECT_EQ(fields[0].key, "robot.command_delay");
  EXPECT_EQ(fields[0].unit, "s");
  ASSERT_EQ(fields[0].bins.size(), 5u);
  std::vector<double> values;
  for (const auto& course : results[0].drawn[0].values) {
    values.insert(values.end(), course.begin(), course.end());
  }
  std::ranges::sort(values);
  for (int b = 0; b < 5; ++b) {
    const DrawnBin& bin = fields[0].bins[b];
    EXPECT_THAT(bin.num_episodes, ElementsAre(24)) << "a fifth of 120";
    const Estimate expected = Counted(results[0], 0, values[24 * b], values[24 * b + 23]);
    EXPECT_EQ(bin.success_rates[0]->value, expected.value);
    EXPECT_EQ(bin.success_rates[0]->interval, expected.interval);
  }
  EXPECT_EQ(fields[0].bins[0].label, fmt::format("{:.3g} – {:.3g}", values[0], values[24]));
  EXPECT_GT(fields[0].bins[0].success_rates[0]->value, fields[0].bins[4].success_rates[0]->value);
}

TEST(DrawnBins, NamesHaveABinEachAndAgentsWithoutAFieldNone) {
  std::vector<Result> results = {MakeResult(1), MakeResult(2), MakeResult(3)};
  results[1].drawn.clear();
  results[2].drawn[1].names = {"pyramid", "cone"};
  const auto fields = BinByDrawnFields(results, kThree);
  ASSERT_EQ(fields.size(), 2u);
  const auto& bins = fields[1].bins;
  ASSERT_EQ(bins.size(), 3u);
  EXPECT_EQ(bins[0].label, "cone");
  EXPECT_EQ(bins[1].label, "gazebo");
  EXPECT_EQ(bins[2].label, "pyramid");
  EXPECT_EQ(bins[0].success_rates[0]->value, Counted(results[0], 1, 0.0, 0.0).value);
  EXPECT_EQ(bins[0].success_rates[2]->value, Counted(results[2], 1, 1.0, 1.0).value);
  EXPECT_EQ(bins[0].num_episodes[0] + bins[1].num_episodes[0], kCourses * kEpisodes);
  EXPECT_EQ(bins[0].num_episodes[1], 0);
  EXPECT_FALSE(bins[0].success_rates[1]);
  EXPECT_EQ(bins[2].num_episodes[0], 0);
  EXPECT_FALSE(bins[1].success_rates[2]);
  EXPECT_TRUE(BinByDrawnFields(results, kSecond).empty());
}

TEST(DrawnBins, FewEpisodesAreNotCut) {
  std::vector<Result> results = {MakeResult(1)};
  results[0].courses.resize(3);
  for (DrawnField& field : results[0].drawn) field.values.resize(3);
  const auto fields = BinByDrawnFields(results, kOne);
  ASSERT_EQ(fields[0].bins.size(), 1u) << "of 36 episodes";
  EXPECT_THAT(fields[0].bins[0].num_episodes, ElementsAre(36));
  // All values are the same.
  for (auto& course : results[0].drawn[0].values) course.assign(course.size(), 0.04);
  EXPECT_EQ(BinByDrawnFields(results, kOne)[0].bins[0].label, "0.04 – 0.04");
}

TEST(DrawnBins, TheFieldsOwnValueHasABinOfItsOwn) {
  std::vector<Result> results = {MakeResult(1), MakeResult(2)};
  constexpr double kOwn = 0.05;  // In the middle of what is drawn.
  results[0].settings = {{"environment.randomize_share", "0.5"},
                         {"environment.robot.command_delay", "0.05"}};
  for (int c = 0; c < kCourses; c += 2) std::ranges::fill(results[0].drawn[0].values[c], kOwn);
  const auto bins = BinByDrawnFields(results, kTwo)[0].bins;
  ASSERT_EQ(bins.size(), 1u + 4u) << "180 drawn episodes of two agents";
  EXPECT_EQ(bins[0].label, "not drawn: 0.05");
  EXPECT_THAT(bins[0].num_episodes, ElementsAre(60, 0));
  EXPECT_EQ(bins[0].success_rates[0]->value, Counted(results[0], 0, kOwn, kOwn).value);
  int drawn = 0;
  for (std::size_t b = 1; b < bins.size(); ++b) {
    EXPECT_EQ(bins[b].num_episodes[0] + bins[b].num_episodes[1], 45) << bins[b].label;
    drawn += bins[b].num_episodes[0];
  }
  EXPECT_EQ(drawn, 60);
  // It may be all that there is, and at one end of what is drawn.
  for (auto& course : results[0].drawn[0].values) std::ranges::fill(course, kOwn);
  EXPECT_EQ(BinByDrawnFields(results, kOne)[0].bins.size(), 1u);
  results[0].settings["environment.randomize_share"] = "1.0";
  EXPECT_EQ(BinByDrawnFields(results, kOne)[0].bins[0].label, "0.05 – 0.05");
}

TEST(DrawnBins, HoldTheEpisodesOfAllSeedsOfAnAgent) {
  const std::vector<Result> results = {MakeResult(1), MakeResult(2)};
  const std::vector<AgentResults> both = {{"a", {0, 1}}};
  const auto names = BinByDrawnFields(results, both)[1].bins;
  const auto apart = BinByDrawnFields(results, kTwo)[1].bins;
  ASSERT_EQ(names.size(), 2u);
  EXPECT_EQ(names[0].num_episodes[0], apart[0].num_episodes[0] + apart[0].num_episodes[1]);
  const double hits = apart[0].num_episodes[0] * apart[0].success_rates[0]->value +
                      apart[0].num_episodes[1] * apart[0].success_rates[1]->value;
  EXPECT_NEAR(names[0].success_rates[0]->value, hits / names[0].num_episodes[0], 1e-12);
}

TEST(DrawnBins, StandInATableOfTheReport) {
  const std::vector<Result> results = {MakeResult(1)};
  const auto fields = BinByDrawnFields(results, kOne);
  const std::string text = MarkdownOf(fields, std::vector<std::string>{"a|b"}, 3);
  EXPECT_THAT(text, HasSubstr("\n### Success by randomised field\n"));
  EXPECT_THAT(text, HasSubstr("| field | value | a\\|b [%], episodes |"));
  EXPECT_THAT(text, HasSubstr("| `robot.command_delay` | 0."));
  const Estimate cone = Counted(results[0], 1, 0.0, 0.0);
  EXPECT_THAT(text,
              HasSubstr(fmt::format("| `robot.friction` | cone | {:.1f} (", 100 * cone.value)));
  EXPECT_EQ(MarkdownOf({}, std::vector<std::string>{"a"}, 3), "");
}

/// The randomised fields of a true evaluation, through its files.
class DrawnFilesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    task_.randomize = {{"lidar.offset_x", {"[-0.1, 0.1]", ""}},
                       {"robot.friction", {"['cone', 'gazebo']", ""}}};
    evaluation_ = testing::DriveCourses(3, task_);
    WriteReports(evaluation_, testing::MakeProvenance("reactive"), scratch_.path());
  }

  std::string ErrorAfter(const std::function<void(nlohmann::json&)>& change) {
    const auto file = scratch_.path() / kEvaluationFile;
    const std::string before = base::ReadFile(file);
    nlohmann::json object = nlohmann::json::parse(before);
    change(object);
    base::WriteFileAtomically(file, object.dump());
    std::string error = "none";
    try {
      (void)ReadResult(file);
    } catch (const base::Error& e) {
      error = e.what();
    }
    base::WriteFileAtomically(file, before);
    return error;
  }

  sim::EnvironmentConfig task_;
  Evaluation evaluation_;
  test::ScratchDirectory scratch_;
};

TEST_F(DrawnFilesTest, HoldTheValuesThatTheSeedsDraw) {
  const Result result = ReadResult(scratch_.path());
  ASSERT_EQ(result.drawn.size(), 2u);
  EXPECT_EQ(result.drawn[0].key, "lidar.offset_x");
  EXPECT_EQ(result.drawn[0].unit, "m");
  EXPECT_THAT(result.drawn[1].names, ElementsAre("cone", "gazebo"));
  sim::RandomizedConfig drawn(task_);
  const std::string csv = base::ReadFile(scratch_.path() / "evaluation-episodes.csv");
  EXPECT_THAT(csv, HasSubstr(",agent_status,lidar.offset_x,robot.friction\n"));
  for (const EpisodeRecord& record : evaluation_.episodes.records) {
    drawn.Draw(record.seed);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(result.drawn[i].values[record.course][record.episode], drawn.values()[i]);
    }
    EXPECT_THAT(csv, HasSubstr(fmt::format(",{},{}\n", drawn.config().lidar.offset_x,
                                           base::EnumName(drawn.config().robot.friction))));
  }
  // Scans were taken from where the sensor stood.
  for (const sim::EpisodeTrack& track : result.tracks) {
    if (!track.beams) continue;
    const int course = std::stoi(track.course.substr(track.course.rfind('-') + 1));
    EXPECT_EQ(track.beams->p_RS.x, result.drawn[0].values[course][track.episode]);
  }
  // Archives of sweeps leave the values out.
  const std::string compact =
      CompactResult(base::ReadFile(scratch_.path() / kEvaluationFile), "archive");
  EXPECT_THAT(compact, Not(HasSubstr("offset_x")));
  EXPECT_TRUE(ParseResult(compact, "archive").result.drawn.empty());
}

TEST_F(DrawnFilesTest, ValuesThatCannotBeAreRefused) {
  using nlohmann::json;
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][1]["drawn"]["robot.friction"][0] = 2; }),
              HasSubstr("a value of robot.friction is 2, expected a number from 0 to 1"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][1]["drawn"]["robot.friction"][0] = 0.5; }),
              HasSubstr("a value of robot.friction is 0.5, expected a whole number"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][1]["drawn"]["lidar.offset_x"][0] = "a"; }),
              HasSubstr("a value of lidar.offset_x is \"a\""));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][1]["drawn"]["lidar.offset_x"].erase(0); }),
              HasSubstr("one for each outcome"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][1].erase("drawn"); }),
              HasSubstr("courses[1].drawn is missing"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["drawn"][1]["names"] = json::array(); }),
              HasSubstr("names is [], expected at least one name"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["drawn"][0].erase("key"); }),
              HasSubstr("drawn[0].key is missing"));
  EXPECT_EQ(ErrorAfter([](json& o) { o.erase("drawn"); }), "none");
}

}  // namespace
}  // namespace slalom::eval
