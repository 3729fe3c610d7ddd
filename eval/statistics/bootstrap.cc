#include "eval/statistics/bootstrap.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include "base/check.h"
#include "base/random.h"

namespace slalom::eval {
namespace {

/// How often each course, or each seed of an agent, is in a resample.
using Drawn = std::vector<double>;

/// Computes the values of one resample. `drawn`: courses, then seeds of the first and the second
/// agent. A value that does not exist is NaN.
using Statistic = std::function<void(std::span<const Drawn> drawn, std::span<double> values)>;

/// The variance that each of the factors (courses, seeds) adds to a value, by leaving out one
/// course or seed at a time.
struct Jackknife {
  double variance = 0.0;        ///< Sum over factors.
  double drawn_variance = 0.0;  ///< Part that resamples as large as each factor reproduce.
  double squares_by_df = 0.0;   ///< Sum of variance^2 / degrees of freedom.
  double degrees_of_freedom() const { return variance * variance / squares_by_df; }
};

std::vector<Jackknife> LeaveOneOut(const std::vector<Drawn>& all, std::size_t num_values,
                                   const Statistic& statistic) {
  std::vector<Jackknife> jackknives(num_values);
  std::vector<Drawn> drawn = all;
  std::vector<double> values(num_values);
  for (Drawn& factor : drawn) {
    const auto n = static_cast<double>(factor.size());
    if (factor.size() < 2) continue;
    std::vector<std::vector<double>> left(num_values);
    for (double& one : factor) {
      one = 0.0;
      statistic(drawn, values);
      one = 1.0;
      for (std::size_t v = 0; v < num_values; ++v) left[v].push_back(values[v]);
    }
    for (std::size_t v = 0; v < num_values; ++v) {
      double mean = 0.0;
      for (const double value : left[v]) mean += value / n;
      double squares = 0.0;
      for (const double value : left[v]) squares += (value - mean) * (value - mean);
      const double variance = (n - 1.0) / n * squares;
      jackknives[v].variance += variance;
      jackknives[v].drawn_variance += (n - 1.0) / n * variance;
      jackknives[v].squares_by_df += variance * variance / (n - 1.0);
    }
  }
  return jackknives;
}

/// Factor by which the percentile interval is stretched. Empty if the spread is not known.
std::optional<double> Stretch(const Jackknife& jackknife, double value) {
  const double smallest = 1e-12 * std::max(1.0, std::abs(value));
  // Written so that NaN has none, too.
  if (!(std::sqrt(jackknife.variance) > smallest)) return std::nullopt;
  const int df = std::max(1, static_cast<int>(jackknife.degrees_of_freedom() + 1e-9));
  return StudentCritical(df) / kNormalCritical *
         std::sqrt(jackknife.variance / jackknife.drawn_variance);
}

/// The quantile at `p` of sorted numbers, with lines between them.
double Quantile(const std::vector<double>& sorted, double p) {
  const double place = p * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

std::vector<std::vector<double>> Resample(const std::vector<Drawn>& all, std::size_t num_values,
                                          const Statistic& statistic,
                                          const BootstrapOptions& options) {
  std::vector<base::Random> streams;
  for (std::size_t f = 0; f < all.size(); ++f) {
    streams.emplace_back(base::DeriveSeed(options.seed, "bootstrap", {f}));
  }
  std::vector<std::vector<double>> samples(num_values);
  for (auto& of_value : samples) of_value.reserve(static_cast<std::size_t>(options.num_samples));
  std::vector<Drawn> drawn = all;
  std::vector<double> values(num_values);
  for (int k = 0; k < options.num_samples; ++k) {
    for (std::size_t f = 0; f < all.size(); ++f) {
      std::ranges::fill(drawn[f], 0.0);
      for (std::size_t i = 0; i < drawn[f].size(); ++i) {
        drawn[f][streams[f].UniformInt(drawn[f].size())] += 1.0;
      }
    }
    statistic(drawn, values);
    for (std::size_t v = 0; v < num_values; ++v) {
      if (!std::isnan(values[v])) samples[v].push_back(values[v]);
    }
  }
  return samples;
}

/// `sizes`: how many courses, and how many seeds of each agent.
std::vector<Estimate> Bootstrap(const std::vector<std::size_t>& sizes, std::size_t num_values,
                                const Statistic& statistic, Interval limits,
                                const BootstrapOptions& options) {
  SLALOM_CHECK_GE(options.num_samples, 100);
  std::vector<Drawn> all;
  all.reserve(sizes.size());
  for (const std::size_t size : sizes) all.emplace_back(size, 1.0);
  std::vector<double> values(num_values);
  statistic(all, values);
  std::vector<Estimate> estimates;
  estimates.reserve(values.size());
  for (const double value : values) estimates.push_back({value, std::nullopt});
  if (sizes.front() < 2) return estimates;
  const std::vector<Jackknife> jackknives = LeaveOneOut(all, num_values, statistic);
  std::vector<std::vector<double>> samples = Resample(all, num_values, statistic, options);
  for (std::size_t v = 0; v < num_values; ++v) {
    const std::optional<double> stretch = Stretch(jackknives[v], values[v]);
    if (!stretch || samples[v].empty()) continue;
    std::ranges::sort(samples[v]);
    const double low = values[v] + *stretch * (Quantile(samples[v], 0.025) - values[v]);
    const double high = values[v] + *stretch * (Quantile(samples[v], 0.975) - values[v]);
    estimates[v].interval = Interval{std::min(values[v], std::max(limits.low, low)),
                                     std::max(values[v], std::min(limits.high, high))};
  }
  return estimates;
}

Estimate BootstrapOne(const std::vector<std::size_t>& sizes,
                      const std::function<double(std::span<const Drawn>)>& statistic,
                      Interval limits, const BootstrapOptions& options) {
  const auto with_span = [&](std::span<const Drawn> drawn, std::span<double> values) {
    values[0] = statistic(drawn);
  };
  return Bootstrap(sizes, 1, with_span, limits, options).front();
}

double Sum(const Drawn& drawn) {
  double sum = 0.0;
  for (const double times : drawn) sum += times;
  return sum;
}

double WeightedSum(const ScoreTable& table, const Drawn& seeds, const Drawn& courses) {
  double total = 0.0;
  for (std::size_t s = 0; s < seeds.size(); ++s) {
    if (seeds[s] == 0.0) continue;
    double sum = 0.0;
    for (std::size_t c = 0; c < courses.size(); ++c) sum += courses[c] * table.scores[s][c];
    total += seeds[s] * sum;
  }
  return total;
}

double WeightedMean(const ScoreTable& table, const Drawn& seeds, const Drawn& courses) {
  return WeightedSum(table, seeds, courses) / (Sum(seeds) * Sum(courses));
}

/// NaN: nothing was counted.
double WeightedRatio(const RatioTables& tables, const Drawn& seeds, const Drawn& courses) {
  const double count = WeightedSum(tables.counts, seeds, courses);
  return count > 0.0 ? WeightedSum(tables.sums, seeds, courses) / count
                     : std::numeric_limits<double>::quiet_NaN();
}

/// A score with its place in the table.
struct PlacedScore {
  double score = 0.0;
  std::size_t seed = 0;
  std::size_t course = 0;
};

std::vector<PlacedScore> SortedScores(const ScoreTable& table) {
  std::vector<PlacedScore> sorted;
  for (std::size_t s = 0; s < table.num_seeds(); ++s) {
    for (std::size_t c = 0; c < table.num_courses(); ++c) {
      sorted.push_back({table.scores[s][c], s, c});
    }
  }
  std::ranges::stable_sort(sorted, {}, &PlacedScore::score);
  return sorted;
}

std::vector<std::size_t> SizesOf(const ScoreTable& table) {
  return {table.num_courses(), table.num_seeds()};
}

std::vector<std::size_t> SizesOf(const RatioTables& tables) {
  SLALOM_CHECK_EQ(tables.sums.num_seeds(), tables.counts.num_seeds());
  SLALOM_CHECK_EQ(tables.sums.num_courses(), tables.counts.num_courses());
  return SizesOf(tables.sums);
}

std::vector<std::size_t> SizesOf(const ScoreTable& first, const ScoreTable& second) {
  SLALOM_CHECK_EQ(first.num_courses(), second.num_courses());
  return {first.num_courses(), first.num_seeds(), second.num_seeds()};
}

/// Estimates the mean of some of the sorted scores. `ranks`: the first rank and the rank after the
/// last, of n scores.
Estimate BootstrapMeanOfRanks(const ScoreTable& table,
                              const std::function<std::pair<double, double>(double n)>& ranks,
                              const BootstrapOptions& options) {
  const std::vector<PlacedScore> sorted = SortedScores(table);
  const auto mean = [&](std::span<const Drawn> drawn) {
    const auto [begin, end] = ranks(Sum(drawn[0]) * Sum(drawn[1]));
    double place = 0.0;
    double sum = 0.0;
    for (const PlacedScore& placed : sorted) {
      const double next = place + drawn[0][placed.course] * drawn[1][placed.seed];
      const double inside = std::min(next, end) - std::max(place, begin);
      if (inside > 0.0) sum += inside * placed.score;
      place = next;
    }
    return sum / (end - begin);
  };
  return BootstrapOne(SizesOf(table), mean, table.limits, options);
}

}  // namespace

Estimate BootstrapMean(const ScoreTable& table, const BootstrapOptions& options) {
  return BootstrapOne(
      SizesOf(table),
      [&](std::span<const Drawn> drawn) { return WeightedMean(table, drawn[1], drawn[0]); },
      table.limits, options);
}

Estimate BootstrapInterquartileMean(const ScoreTable& table, const BootstrapOptions& options) {
  const auto middle_half = [](double n) -> std::pair<double, double> {
    const double cut = std::floor(n / 4.0);
    return {cut, n - cut};
  };
  return BootstrapMeanOfRanks(table, middle_half, options);
}

Estimate BootstrapLowestTwentiethMean(const ScoreTable& table, const BootstrapOptions& options) {
  const auto lowest = [](double n) -> std::pair<double, double> {
    return {0.0, std::ceil(n / 20.0)};
  };
  return BootstrapMeanOfRanks(table, lowest, options);
}

std::optional<Estimate> BootstrapRatio(const RatioTables& tables, const BootstrapOptions& options) {
  const auto ratio = [&](std::span<const Drawn> drawn) {
    return WeightedRatio(tables, drawn[1], drawn[0]);
  };
  const Estimate estimate = BootstrapOne(SizesOf(tables), ratio, tables.sums.limits, options);
  if (std::isnan(estimate.value)) return std::nullopt;
  return estimate;
}

std::optional<Estimate> BootstrapShare(const RatioTables& tables, const BootstrapOptions& options) {
  std::optional<Estimate> estimate = BootstrapRatio(tables, options);
  if (!estimate || estimate->interval) return estimate;
  const std::size_t num_seeds = tables.sums.num_seeds();
  const bool by_course = tables.sums.num_courses() > 1;
  std::vector<CourseTotal> totals(by_course ? tables.sums.num_courses() : num_seeds);
  const double weight = by_course ? 1.0 / static_cast<double>(num_seeds) : 1.0;
  for (std::size_t s = 0; s < num_seeds; ++s) {
    for (std::size_t c = 0; c < tables.sums.num_courses(); ++c) {
      CourseTotal& total = totals[by_course ? c : s];
      total.sum += weight * tables.sums.scores[s][c];
      total.count += weight * tables.counts.scores[s][c];
    }
  }
  estimate->interval = EstimateRate(totals).interval;
  return estimate;
}

std::optional<Estimate> BootstrapRatioDifference(const RatioTables& first,
                                                 const RatioTables& second, bool same_courses,
                                                 const BootstrapOptions& options) {
  std::vector<std::size_t> sizes = SizesOf(first);
  if (same_courses) {
    SLALOM_CHECK_EQ(first.sums.num_courses(), second.sums.num_courses());
    sizes.push_back(second.sums.num_seeds());
  } else {
    std::ranges::copy(SizesOf(second), std::back_inserter(sizes));
  }
  const auto difference = [&](std::span<const Drawn> drawn) {
    const Drawn& courses = same_courses ? drawn.front() : drawn[2];
    return WeightedRatio(first, drawn[1], drawn[0]) - WeightedRatio(second, drawn.back(), courses);
  };
  const Interval limits{first.sums.limits.low - second.sums.limits.high,
                        first.sums.limits.high - second.sums.limits.low};
  const Estimate estimate = BootstrapOne(sizes, difference, limits, options);
  if (std::isnan(estimate.value)) return std::nullopt;
  return estimate;
}

Estimate BootstrapDifference(const ScoreTable& first, const ScoreTable& second,
                             const BootstrapOptions& options) {
  const auto difference = [&](std::span<const Drawn> drawn) {
    return WeightedMean(first, drawn[1], drawn[0]) - WeightedMean(second, drawn[2], drawn[0]);
  };
  const Interval limits{first.limits.low - second.limits.high,
                        first.limits.high - second.limits.low};
  return BootstrapOne(SizesOf(first, second), difference, limits, options);
}

Estimate BootstrapProbabilityOfImprovement(const ScoreTable& first, const ScoreTable& second,
                                           const BootstrapOptions& options) {
  const std::vector<std::size_t> sizes = SizesOf(first, second);
  const std::size_t num_pairs = first.num_seeds() * second.num_seeds();
  // [course][pair of seeds]: 1 if the first is better, 0.5 for a draw.
  std::vector<double> wins;
  for (std::size_t c = 0; c < first.num_courses(); ++c) {
    for (const std::vector<double>& a : first.scores) {
      for (const std::vector<double>& b : second.scores) {
        wins.push_back(a[c] > b[c] ? 1.0 : a[c] == b[c] ? 0.5 : 0.0);
      }
    }
  }
  std::vector<double> by_pair(num_pairs);
  const auto probability = [&](std::span<const Drawn> drawn) {
    std::ranges::fill(by_pair, 0.0);
    for (std::size_t c = 0; c < drawn[0].size(); ++c) {
      const double times = drawn[0][c];
      const double* of_course = wins.data() + c * num_pairs;
      for (std::size_t k = 0; k < num_pairs; ++k) by_pair[k] += times * of_course[k];
    }
    double sum = 0.0;
    for (std::size_t k = 0; k < num_pairs; ++k) {
      sum += drawn[1][k / drawn[2].size()] * drawn[2][k % drawn[2].size()] * by_pair[k];
    }
    return sum / (Sum(drawn[0]) * Sum(drawn[1]) * Sum(drawn[2]));
  };
  return BootstrapOne(sizes, probability, {0.0, 1.0}, options);
}

std::vector<Estimate> BootstrapProfile(const ScoreTable& table, std::span<const double> thresholds,
                                       const BootstrapOptions& options) {
  SLALOM_CHECK(std::ranges::is_sorted(thresholds));
  // [seed][course]: how many thresholds a score is above.
  std::vector<std::vector<std::size_t>> num_below;
  for (const std::vector<double>& row : table.scores) {
    auto& of_seed = num_below.emplace_back();
    for (const double score : row) {
      of_seed.push_back(static_cast<std::size_t>(std::ranges::lower_bound(thresholds, score) -
                                                 thresholds.begin()));
    }
  }
  std::vector<double> histogram;
  const auto shares = [&](std::span<const Drawn> drawn, std::span<double> values) {
    histogram.assign(thresholds.size() + 1, 0.0);
    for (std::size_t s = 0; s < num_below.size(); ++s) {
      if (drawn[1][s] == 0.0) continue;
      for (std::size_t c = 0; c < num_below[s].size(); ++c) {
        histogram[num_below[s][c]] += drawn[1][s] * drawn[0][c];
      }
    }
    const double total = Sum(drawn[0]) * Sum(drawn[1]);
    double above = 0.0;
    for (std::size_t t = thresholds.size(); t-- > 0;) {
      above += histogram[t + 1];
      values[t] = above / total;
    }
  };
  return Bootstrap(SizesOf(table), thresholds.size(), shares, {0.0, 1.0}, options);
}

}  // namespace slalom::eval
