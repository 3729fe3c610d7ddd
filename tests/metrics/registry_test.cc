#include "metrics/registry.h"

#include <gmock/gmock.h>

#include <limits>
#include <sstream>
#include <thread>
#include <vector>

#include "metrics/catalogue.h"

namespace slalom::metrics {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

const Spec kThings{"slalom_things_total", Type::kCounter, "test", "Things.", {"kind"}, {}};
const Spec kLevel{"slalom_level", Type::kGauge, "test", "Level.", {}, {}};
const Spec kWait{"slalom_wait_seconds", Type::kHistogram, "test", "Wait.", {}, {0.1, 1.0}};

std::vector<std::string> Lines(const Registry& registry) {
  std::istringstream in(registry.Text());
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The labels that every metric has, as the text format orders them.
const std::string kLabels = R"(name="a1",role="actor",run="r")";

Registry MakeRegistry() {
  return Registry({.role = "actor", .name = "a1", .run = "r", .version = "0.1", .commit = "abc"});
}

TEST(RegistryTest, ShowsWhatWasCountedWithHelpTypeAndLabels) {
  Registry registry = MakeRegistry();
  Counter red = registry.counter(kThings, {"red"});
  registry.counter(kThings, {"blue"});
  red.Increment();
  red.Increment(2.5);
  registry.gauge(kLevel).Set(-4.25);
  const auto lines = Lines(registry);
  EXPECT_THAT(lines, Contains("# HELP slalom_things_total Things."));
  EXPECT_THAT(lines, Contains("# TYPE slalom_things_total counter"));
  EXPECT_THAT(lines, Contains("slalom_things_total{" + kLabels + R"(,kind="red"} 3.5)"));
  EXPECT_THAT(lines, Contains("slalom_things_total{" + kLabels + R"(,kind="blue"} 0)"))
      << "a metric shows from when its handle is taken";
  EXPECT_THAT(lines, Contains("slalom_level{" + kLabels + "} -4.25"));
  EXPECT_EQ(red.value(), 3.5);
}

TEST(RegistryTest, TheSameMetricIsOneValue) {
  Registry registry = MakeRegistry();
  registry.counter(kThings, {"red"}).Increment();
  registry.counter(kThings, {"red"}).Increment();
  EXPECT_EQ(registry.counter(kThings, {"red"}).value(), 2.0);
  EXPECT_EQ(registry.counter(kThings, {"blue"}).value(), 0.0);
}

TEST(RegistryTest, ACounterFollowsATotalAndNeverFalls) {
  Registry registry = MakeRegistry();
  Counter counter = registry.counter(kThings, {"red"});
  for (const auto& [total, expected] :
       std::vector<std::pair<double, double>>{{10.0, 10.0}, {7.0, 10.0}, {12.0, 12.0}}) {
    counter.RaiseTo(total);
    EXPECT_EQ(counter.value(), expected);
  }
}

// Prometheus counts a value into every bucket whose upper bound is not below it.
TEST(RegistryTest, AHistogramsBucketsHoldTheirUpperBound) {
  Registry registry = MakeRegistry();
  Histogram wait = registry.histogram(kWait);
  for (const double value : {0.05, 0.1, 0.5, 1.0, 7.0}) wait.Observe(value);
  const auto lines = Lines(registry);
  const auto bucket = [](const std::string& bound, int count) {
    return "slalom_wait_seconds_bucket{" + kLabels + ",le=\"" + bound + "\"} " +
           std::to_string(count);
  };
  EXPECT_THAT(lines, Contains(bucket("0.1", 2)));
  EXPECT_THAT(lines, Contains(bucket("1", 4)));
  EXPECT_THAT(lines, Contains(bucket("+Inf", 5)));
  EXPECT_THAT(lines, Contains("slalom_wait_seconds_count{" + kLabels + "} 5"));
  EXPECT_THAT(lines, Contains("slalom_wait_seconds_sum{" + kLabels + "} 8.65"));
}

TEST(RegistryTest, UnknownIsNan) {
  Registry registry = MakeRegistry();
  registry.gauge(kLevel).Set(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(Lines(registry), Contains("slalom_level{" + kLabels + "} Nan"));
}

TEST(RegistryTest, BuildAndProcessAreThereFromTheStart) {
  const Registry registry = MakeRegistry();
  const std::string text = registry.Text();
  EXPECT_THAT(text,
              HasSubstr("slalom_build_info{" + kLabels + R"(,commit="abc",version="0.1"} 1)"));
  EXPECT_THAT(text, HasSubstr("slalom_blas_info{" + kLabels + R"(,kernel="none"} 1)"));
  EXPECT_THAT(text, HasSubstr("process_resident_memory_bytes{" + kLabels + "}"));
  EXPECT_THAT(text, Not(HasSubstr("process_open_fds{" + kLabels + "} 0\n")));
}

TEST(RegistryTest, ReplacedSeriesAreNoLongerShown) {
  const Spec level{"slalom_level", Type::kGauge, "test", "Level.", {"cell", "state"}, {}};
  Registry registry = MakeRegistry();
  registry.counter(kThings, {"red"});
  registry.Replace({{&level, {"c1", "done"}, 1.0}, {&level, {"c\"2", "failed"}, 2.5}});
  auto lines = Lines(registry);
  EXPECT_THAT(lines, Contains("# HELP slalom_level Level."));
  EXPECT_THAT(lines, Contains("# TYPE slalom_level gauge").Times(1));
  EXPECT_THAT(lines, Contains("slalom_level{" + kLabels + R"(,cell="c1",state="done"} 1)"));
  EXPECT_THAT(lines, Contains("slalom_level{" + kLabels + R"(,cell="c\"2",state="failed"} 2.5)"));
  registry.Replace({{&level, {"c1", "training"}, 1.0}});
  lines = Lines(registry);
  EXPECT_THAT(lines, Contains("slalom_level{" + kLabels + R"(,cell="c1",state="training"} 1)"));
  EXPECT_THAT(lines, Contains(testing::StartsWith("slalom_level{")).Times(1));
  EXPECT_THAT(lines, Contains("slalom_things_total{" + kLabels + R"(,kind="red"} 0)"));
  registry.Replace({});
  EXPECT_THAT(registry.Text(), Not(HasSubstr("slalom_level")));
}

TEST(RegistryTest, WhatALabelMayHoldIsEscaped) {
  Registry registry = MakeRegistry();
  registry.counter(kThings, {"a\"b\\c\nd"});
  EXPECT_THAT(registry.Text(), HasSubstr(R"(kind="a\"b\\c\nd"})"));
}

TEST(RegistryTest, NothingIsLostBetweenThreads) {
  Registry registry = MakeRegistry();
  constexpr int kThreads = 4;
  constexpr int kEach = 5000;
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&registry] {
        Counter counter = registry.counter(kThings, {"red"});
        Histogram wait = registry.histogram(kWait);
        for (int i = 0; i < kEach; ++i) {
          counter.Increment();
          wait.Observe(0.5);
          if (i % 1000 != 0) continue;
          EXPECT_THAT(registry.Text(), HasSubstr("slalom_things_total"));
        }
      });
    }
  }
  EXPECT_EQ(registry.counter(kThings, {"red"}).value(), kThreads * kEach);
  EXPECT_THAT(Lines(registry), Contains("slalom_wait_seconds_count{" + kLabels + "} " +
                                        std::to_string(kThreads * kEach)));
}

TEST(RegistryDeathTest, MistakesOfOursEndTheProgram) {
  Registry registry = MakeRegistry();
  EXPECT_DEATH(registry.counter(kThings), "check failed");
  EXPECT_DEATH(registry.counter(kLevel), "check failed");
  EXPECT_DEATH(registry.counter(kThings, {"red"}).Increment(-1.0), "check failed");
  EXPECT_DEATH(Counter().Increment(), "check failed");
  EXPECT_DEATH(registry.Replace({{&kThings, {}, 1.0}}), "check failed");
  EXPECT_DEATH(registry.Replace({{&kWait, {}, 1.0}}), "check failed");
}

}  // namespace
}  // namespace slalom::metrics
