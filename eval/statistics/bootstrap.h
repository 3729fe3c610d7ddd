#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "eval/statistics/score_table.h"
#include "eval/statistics/statistics.h"

/// 95 % bootstrap intervals over the seeds of training and over courses.
///
/// A resample draws courses, and for each agent its seeds, with replacement: the bootstrap of two
/// crossed factors (Owen 2007). Both agents of a comparison get the same courses. The interval
/// reaches from the 2.5 % to the 97.5 % percentile, stretched for few seeds (docs/statistics.md).
/// With one seed only courses are drawn, so it says nothing about another training. There is none
/// on fewer than two courses, or if leaving out any one course or seed changes nothing.
///
/// The same input and options give the same numbers on every machine. Functions of one options'
/// seed draw the same courses.

namespace slalom::eval {

/// Options of a bootstrap.
struct BootstrapOptions {
  int num_samples = 2000;  ///< At least 100.
  std::uint64_t seed = 1;
};

/// Estimates `Mean`.
Estimate BootstrapMean(const ScoreTable& table, const BootstrapOptions& options = {});

/// Estimates `InterquartileMean`.
Estimate BootstrapInterquartileMean(const ScoreTable& table, const BootstrapOptions& options = {});

/// Estimates `LowestTwentiethMean`.
Estimate BootstrapLowestTwentiethMean(const ScoreTable& table,
                                      const BootstrapOptions& options = {});

/// A quantity that not every episode has, such as the time of those that succeeded: its sums over
/// the episodes on each course, and how many of these have it. Requires: tables of one shape,
/// counts of 0 or more.
struct RatioTables {
  ScoreTable sums;
  ScoreTable counts;
};

/// Estimates the sum of all `sums` over the sum of all `counts`. Returns nothing if all counts are
/// 0. The interval is cut to the limits of `sums`. There is none if only one seed or one course has
/// a count.
std::optional<Estimate> BootstrapRatio(const RatioTables& tables,
                                       const BootstrapOptions& options = {});

/// Estimates a share of episodes: `BootstrapRatio`, but where resamples have no spread (one course,
/// or all courses and seeds alike), Wilson's interval (`EstimateRate`). Then courses are
/// independent, or seeds if there is one course; the episodes of one seed are counted, as seeds
/// drive the same starts. Requires: 0 <= sums <= counts.
std::optional<Estimate> BootstrapShare(const RatioTables& tables,
                                       const BootstrapOptions& options = {});

/// Estimates the ratio of `first` minus the ratio of `second`. `same_courses`: both drove the same
/// courses in the same order, so these are drawn for both together; otherwise each ratio has draws
/// of its own. Returns nothing, and no interval, as `BootstrapRatio` does.
std::optional<Estimate> BootstrapRatioDifference(const RatioTables& first,
                                                 const RatioTables& second, bool same_courses,
                                                 const BootstrapOptions& options = {});

/// Estimates `Mean(first) - Mean(second)`. Requires: the same courses in the same order.
Estimate BootstrapDifference(const ScoreTable& first, const ScoreTable& second,
                             const BootstrapOptions& options = {});

/// Estimates the probability that a policy of `first` scores higher than a policy of `second` on
/// the same course; a draw counts half (Agarwal et al. 2021): the Mann-Whitney statistic over all
/// pairs of seeds, averaged over courses. Requires: the same courses in the same order.
Estimate BootstrapProbabilityOfImprovement(const ScoreTable& first, const ScoreTable& second,
                                           const BootstrapOptions& options = {});

/// Estimates, for each threshold, the share of all scores that lie above it (Agarwal et al. 2021).
/// The bands are pointwise: each holds for its own threshold.
/// Requires: thresholds in increasing order.
std::vector<Estimate> BootstrapProfile(const ScoreTable& table, std::span<const double> thresholds,
                                       const BootstrapOptions& options = {});

}  // namespace slalom::eval
