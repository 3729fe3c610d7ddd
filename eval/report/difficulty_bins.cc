#include "eval/report/difficulty_bins.h"

#include <algorithm>
#include <numeric>

#include "eval/statistics/bootstrap.h"
#include "sim/courses/course_difficulty.h"

namespace slalom::eval {
namespace {

constexpr std::size_t kMaxBins = 5;
constexpr std::size_t kMinCoursesPerBin = 4;

struct DifficultyMeasure {
  std::string_view key;
  std::string_view name;
  std::string_view unit;
  double sim::Difficulty::*value;
};

constexpr DifficultyMeasure kDifficultyMeasures[] = {
    {"distance", "distance to obstacles", "cells", &sim::Difficulty::distance_to_obstacle},
    {"visibility", "visibility", "cells", &sim::Difficulty::visibility},
    {"dispersion", "dispersion", "", &sim::Difficulty::dispersion},
    {"width", "characteristic dimension", "cells", &sim::Difficulty::characteristic_dimension},
    {"tortuosity", "tortuosity", "", &sim::Difficulty::tortuosity},
};

}  // namespace

std::vector<CourseMeasure> MeasureCourses(const sim::CourseSet& courses) {
  std::vector<CourseMeasure> measures;
  const auto add = [&](std::string_view key, std::string_view name, std::string_view unit,
                       auto&& value) {
    CourseMeasure measure{key, name, unit, {}};
    for (const auto& course : courses.courses) measure.values.push_back(value(*course));
    const auto [low, high] = std::ranges::minmax(measure.values);
    if (low < high) measures.push_back(std::move(measure));
  };
  if (std::ranges::all_of(courses.courses,
                          [](const auto& c) { return c->difficulty.has_value(); })) {
    for (const DifficultyMeasure& m : kDifficultyMeasures) {
      add(m.key, m.name, m.unit, [&](const sim::Course& c) { return *c.difficulty.*m.value; });
    }
  }
  add("length", "length of the reference path", "m",
      [](const sim::Course& c) { return sim::ReferenceLength(c); });
  add("obstacles", "number of obstacles", "", [](const sim::Course& c) {
    return static_cast<double>(c.circles.size() + c.boxes.size() + c.moving.size());
  });
  add("density", "moving obstacles on 100 m^2", "",
      [](const sim::Course& c) { return 100.0 * sim::MeasureMotion(c).density; });
  add("speed", "mean speed of moving obstacles", "m/s",
      [](const sim::Course& c) { return sim::MeasureMotion(c).mean_speed; });
  return measures;
}

std::vector<CourseBin> BinCourses(const CourseMeasure& measure) {
  const std::size_t n = measure.values.size();
  const std::size_t num_bins = std::min(kMaxBins, n / kMinCoursesPerBin);
  if (num_bins < 2) return {};
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, {}, [&](std::size_t c) { return measure.values[c]; });
  std::vector<CourseBin> bins;
  for (std::size_t b = 0; b < num_bins; ++b) {
    const auto begin = order.begin() + static_cast<std::ptrdiff_t>(b * n / num_bins);
    const auto end = order.begin() + static_cast<std::ptrdiff_t>((b + 1) * n / num_bins);
    bins.push_back({measure.values[*begin], measure.values[*(end - 1)], {begin, end}});
  }
  return bins;
}

Estimate SuccessInBin(std::span<const Result> results, const AgentResults& agent,
                      const CourseBin& bin) {
  RatioTables tables;
  for (const std::size_t r : agent.results) {
    std::vector<double>& sums = tables.sums.scores.emplace_back();
    std::vector<double>& counts = tables.counts.scores.emplace_back();
    for (const std::size_t c : bin.courses) {
      const std::vector<ResultEpisode>& episodes = results[r].courses[c].episodes;
      const auto hits =
          std::ranges::count(episodes, env::Outcome::kSuccess, &ResultEpisode::outcome);
      sums.push_back(static_cast<double>(hits));
      counts.push_back(static_cast<double>(episodes.size()));
    }
  }
  return *BootstrapShare(tables);
}

}  // namespace slalom::eval
