#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "eval/statistics/bootstrap.h"
#include "eval/statistics/score_table.h"
#include "eval/statistics/statistics.h"

/// Permutation tests of two agents on the same courses (docs/statistics.md). All p-values are
/// two-sided. If there are too many permutations to enumerate, a fixed number of them is drawn, and
/// p = (1 + number at least as extreme) / (1 + number drawn), which is never 0 (Phipson and Smyth
/// 2010).

namespace slalom::eval {

/// Number of permutations of a test.
struct PermutationOptions {
  int max_exact = 1 << 16;  ///< Up to this many are enumerated, and the p-value is exact.
  int num_samples = 50000;  ///< Drawn if there are more.
  std::uint64_t seed = 1;
};

/// Returns the p-value of the hypothesis that each difference might as well have had the other
/// sign. Differences of zero change nothing. Requires: at least one difference, all finite.
double SignFlipPValue(std::span<const double> differences, const PermutationOptions& options = {});

/// Returns the p-value of the hypothesis that the numbers of `first` and `second` come from one
/// distribution, by their difference in mean. Requires: at least one number in each, all finite.
double RelabellingPValue(std::span<const double> first, std::span<const double> second,
                         const PermutationOptions& options = {});

/// The difference of two agents, `first` minus `second`, and its tests. A value.
struct PairedTest {
  /// Difference of the means, with the interval of `BootstrapDifference`.
  Estimate difference;

  /// Are these trained policies equally good on courses of this kind? Signs of the courses'
  /// differences are flipped: an episode is compared with the other agent's episode of the same
  /// number on the same course, which has the same start, and the differences are averaged over a
  /// course and over seeds. The unit of exchange is the course, because the episodes on it are not
  /// independent. The p-value says nothing about another training.
  double p_value = 1.0;

  /// Are these ways to train equally good on these courses? The policies, each with its mean over
  /// the courses, change places between the agents. Against a planner, which is not trained, signs
  /// of the policies' differences from it are flipped. Empty if a trained agent has a single seed,
  /// or neither agent is trained.
  std::optional<double> training_p_value;

  /// The least `training_p_value` that these numbers of seeds can give; 1 if they give none.
  double least_training_p_value = 1.0;

  bool trained = true;  ///< At least one agent is trained.
  int num_pairs = 0;    ///< Courses, each with a difference.
};

/// Compares two agents. Requires: the same courses in the same order.
PairedTest ComparePaired(const ScoreTable& first, const ScoreTable& second,
                         const BootstrapOptions& bootstrap = {},
                         const PermutationOptions& permutation = {});

/// Verdict of a comparison at the 5 % level. For trained agents it is about the ways to train, not
/// about the policies at hand; for two planners it is about further courses.
enum class Verdict { kDiffers, kCouldBeChance, kTooFewSeeds };

/// "a clear difference", "could be chance", "too few seeds to tell".
std::string_view ToString(Verdict verdict);

/// Returns the verdict on one of several pairs, of which `num_compared` have a p-value of their
/// trainings. The p-values are corrected for their number. `kTooFewSeeds` means that no outcome
/// with these numbers of seeds could show a difference.
Verdict VerdictOf(const PairedTest& test, double corrected_p_value,
                  const std::optional<double>& corrected_training_p_value,
                  std::size_t num_compared);

/// Returns the p-values corrected for their number (Holm 1979), in the same order: if those below
/// 0.05 are taken for differences, the chance of even one mistake is at most 5 %.
/// Requires: numbers from 0 to 1.
std::vector<double> HolmCorrection(std::span<const double> p_values);

}  // namespace slalom::eval
