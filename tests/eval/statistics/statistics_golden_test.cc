// The statistics of several seeds against NumPy and SciPy: make_statistics_golden.py wrote the
// numbers, and says how.

#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/statistics/bootstrap.h"
#include "eval/statistics/permutation.h"
#include "eval/statistics/score_table.h"

namespace slalom::eval {
namespace {

using nlohmann::json;

constexpr double kExact = 1e-9;

const json& Golden() {
  static const json golden =
      json::parse(std::ifstream(SLALOM_SOURCE_DIR "/tests/eval/statistics/statistics_golden.json"));
  return golden;
}

ScoreTable Table(const json& scores) {
  return {"agent", scores.get<std::vector<std::vector<double>>>(), {0.0, 1.0}};
}

void ExpectInterval(const Estimate& estimate, const json& golden, const std::string& what) {
  ASSERT_TRUE(estimate.interval) << what;
  EXPECT_NEAR(estimate.interval->low, golden.at("low").get<double>(),
              golden.at("tolerance").at(0).get<double>())
      << what;
  EXPECT_NEAR(estimate.interval->high, golden.at("high").get<double>(),
              golden.at("tolerance").at(1).get<double>())
      << what;
}

TEST(StatisticsGolden, SaysWhatMadeIt) {
  for (const char* part : {"python", "numpy", "scipy"}) {
    EXPECT_NE(Golden().at("versions").at(part).get<std::string>(), "") << part;
  }
  EXPECT_EQ(Golden().at("samples").get<int>(), BootstrapOptions{}.num_samples);
  EXPECT_EQ(Golden().at("cases").size(), 3u);
}

TEST(StatisticsGolden, ExactQuantitiesAgree) {
  for (const json& golden : Golden().at("cases")) {
    SCOPED_TRACE(golden.at("name").get<std::string>());
    const ScoreTable first = Table(golden.at("first"));
    const ScoreTable second = Table(golden.at("second"));
    EXPECT_NEAR(Mean(first), golden.at("mean").get<double>(), kExact);
    EXPECT_NEAR(InterquartileMean(first), golden.at("interquartile_mean").get<double>(), kExact);
    EXPECT_NEAR(BootstrapProbabilityOfImprovement(first, second).value,
                golden.at("improvement").get<double>(), kExact);
    const auto thresholds = golden.at("thresholds").get<std::vector<double>>();
    const std::vector<Estimate> bands = BootstrapProfile(first, thresholds);
    for (std::size_t t = 0; t < thresholds.size(); ++t) {
      EXPECT_NEAR(bands[t].value, golden.at("profile").at(t).get<double>(), kExact);
    }
    const PairedTest test = ComparePaired(first, second);
    EXPECT_NEAR(test.difference.value, golden.at("difference").get<double>(), kExact);
    EXPECT_NEAR(test.p_value, golden.at("sign_flip_p").get<double>(), kExact);
    ASSERT_EQ(test.training_p_value.has_value(), golden.contains("relabelling_p"));
    if (test.training_p_value) {
      EXPECT_NEAR(*test.training_p_value, golden.at("relabelling_p").get<double>(), kExact);
    }
  }
}

TEST(StatisticsGolden, IntervalsAgree) {
  for (const json& golden : Golden().at("cases")) {
    SCOPED_TRACE(golden.at("name").get<std::string>());
    const ScoreTable first = Table(golden.at("first"));
    const ScoreTable second = Table(golden.at("second"));
    const json& intervals = golden.at("intervals");
    ExpectInterval(BootstrapMean(first), intervals.at("mean"), "mean");
    ExpectInterval(BootstrapInterquartileMean(first), intervals.at("interquartile_mean"), "IQM");
    const std::vector<double> half{0.5};
    ExpectInterval(BootstrapProfile(first, half).front(), intervals.at("share_above_half"),
                   "profile");
    ExpectInterval(BootstrapDifference(first, second), intervals.at("difference"), "difference");
    ExpectInterval(BootstrapProbabilityOfImprovement(first, second), intervals.at("improvement"),
                   "improvement");
  }
}

TEST(StatisticsGolden, ARatioAgrees) {
  const json& golden = Golden().at("ratio");
  ScoreTable sums = Table(golden.at("sums"));
  sums.limits = {0.0, std::numeric_limits<double>::infinity()};
  const auto estimate = BootstrapRatio({sums, Table(golden.at("counts"))});
  ASSERT_TRUE(estimate);
  EXPECT_NEAR(estimate->value, golden.at("value").get<double>(), kExact);
  ExpectInterval(*estimate, golden.at("interval"), "ratio");
}

TEST(StatisticsGolden, AreaHolmAndStudentAgree) {
  const json& area = Golden().at("area");
  EXPECT_NEAR(AreaUnderCurve(area.at("x").get<std::vector<double>>(),
                             area.at("y").get<std::vector<double>>()),
              area.at("value").get<double>(), 1e-12);
  const json& holm = Golden().at("holm");
  const auto corrected = HolmCorrection(holm.at("p").get<std::vector<double>>());
  for (std::size_t i = 0; i < corrected.size(); ++i) {
    EXPECT_NEAR(corrected[i], holm.at("corrected").at(i).get<double>(), 1e-12) << i;
  }
  for (const auto& [df, quantile] : Golden().at("student").items()) {
    EXPECT_NEAR(StudentCritical(std::stoi(df)), quantile.get<double>(), kExact) << df;
  }
}

}  // namespace
}  // namespace slalom::eval
