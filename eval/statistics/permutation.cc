#include "eval/statistics/permutation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "base/random.h"

namespace slalom::eval {
namespace {

/// Sums that differ by rounding alone are equal: scores are multiples of one over the number of
/// episodes, and many permutations tie with the observed statistic.
constexpr double kRelativeRounding = 1e-10;

/// The sum of numbers whose signs are the bits of some bytes, eight numbers by one look into a
/// table.
class SignedSums {
 public:
  explicit SignedSums(std::span<const double> numbers) : tables_((numbers.size() + 7) / 8) {
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      for (unsigned byte = 0; byte < 256; ++byte) {
        tables_[i / 8][byte] += (byte >> (i % 8) & 1u) != 0 ? -numbers[i] : numbers[i];
      }
    }
  }

  /// `next_bits()` gives the signs of the next 64 numbers.
  template <class NextBits>
  double Sum(NextBits next_bits) const {
    double sum = 0.0;
    std::uint64_t bits = 0;
    for (std::size_t b = 0; b < tables_.size(); ++b) {
      bits = b % 8 == 0 ? next_bits() : bits >> 8;
      sum += tables_[b][bits & 255u];
    }
    return sum;
  }

 private:
  std::vector<std::array<double, 256>> tables_;
};

double CorrectedShare(std::int64_t num_extreme, std::int64_t num_drawn) {
  return static_cast<double>(1 + num_extreme) / static_cast<double>(1 + num_drawn);
}

/// The number of ways to choose k of n, or more than `limit` if there are more.
double Choices(std::size_t n, std::size_t k, double limit) {
  double choices = 1.0;
  for (std::size_t i = 1; i <= k && choices <= limit; ++i) {
    choices = choices * static_cast<double>(n - k + i) / static_cast<double>(i);
  }
  return choices;
}

double MeanOfRow(const std::vector<double>& row) {
  return std::accumulate(row.begin(), row.end(), 0.0) / static_cast<double>(row.size());
}

std::vector<double> MeansBySeed(const ScoreTable& table) {
  std::vector<double> means;
  for (const std::vector<double>& row : table.scores) means.push_back(MeanOfRow(row));
  return means;
}

/// Adds the mean over seeds of each course, times `sign`.
void AddCourseMeans(const ScoreTable& table, double sign, std::vector<double>& sums) {
  for (const std::vector<double>& row : table.scores) {
    for (std::size_t c = 0; c < row.size(); ++c) {
      sums[c] += sign * row[c] / static_cast<double>(table.num_seeds());
    }
  }
}

}  // namespace

double SignFlipPValue(std::span<const double> differences, const PermutationOptions& options) {
  SLALOM_CHECK(!differences.empty());
  std::vector<double> sizes;
  double observed = 0.0;
  double total = 0.0;
  for (const double difference : differences) {
    SLALOM_CHECK(std::isfinite(difference));
    observed += difference;
    total += std::abs(difference);
  }
  for (const double difference : differences) {
    if (std::abs(difference) > kRelativeRounding * total) sizes.push_back(std::abs(difference));
  }
  if (sizes.empty()) return 1.0;
  const double threshold = std::abs(observed) - kRelativeRounding * total;
  const SignedSums sums(sizes);
  if (sizes.size() < 31 && (std::int64_t{1} << sizes.size()) <= options.max_exact) {
    const std::uint64_t num_flips = std::uint64_t{1} << sizes.size();
    std::int64_t num_extreme = 0;
    for (std::uint64_t flips = 0; flips < num_flips; ++flips) {
      num_extreme += std::abs(sums.Sum([&] { return flips; })) >= threshold;
    }
    return static_cast<double>(num_extreme) / static_cast<double>(num_flips);
  }
  base::Random random(base::DeriveSeed(options.seed, "sign flips"));
  std::int64_t num_extreme = 0;
  for (int k = 0; k < options.num_samples; ++k) {
    num_extreme += std::abs(sums.Sum([&] { return random.NextU64(); })) >= threshold;
  }
  return CorrectedShare(num_extreme, options.num_samples);
}

double RelabellingPValue(std::span<const double> first, std::span<const double> second,
                         const PermutationOptions& options) {
  SLALOM_CHECK(!first.empty());
  SLALOM_CHECK(!second.empty());
  std::vector<double> all(first.begin(), first.end());
  all.insert(all.end(), second.begin(), second.end());
  double total = 0.0;
  double largest = 0.0;
  for (const double number : all) {
    SLALOM_CHECK(std::isfinite(number));
    total += number;
    largest = std::max(largest, std::abs(number));
  }
  const auto num_first = static_cast<double>(first.size());
  const auto num_second = static_cast<double>(second.size());
  const auto difference = [&](double sum_of_first) {
    return std::abs(sum_of_first / num_first - (total - sum_of_first) / num_second);
  };
  const double threshold =
      difference(std::accumulate(first.begin(), first.end(), 0.0)) - kRelativeRounding * largest;
  std::int64_t num_extreme = 0;
  if (Choices(all.size(), first.size(), options.max_exact) <= options.max_exact) {
    std::vector<char> is_second(all.size(), 1);
    std::fill_n(is_second.begin(), first.size(), 0);
    std::int64_t num_choices = 0;
    do {
      double sum = 0.0;
      for (std::size_t i = 0; i < all.size(); ++i) sum += is_second[i] != 0 ? 0.0 : all[i];
      num_extreme += difference(sum) >= threshold;
      ++num_choices;
    } while (std::ranges::next_permutation(is_second).found);
    return static_cast<double>(num_extreme) / static_cast<double>(num_choices);
  }
  base::Random random(base::DeriveSeed(options.seed, "relabelling"));
  for (int k = 0; k < options.num_samples; ++k) {
    double sum = 0.0;
    for (std::size_t i = 0; i < first.size(); ++i) {
      std::swap(all[i], all[i + random.UniformInt(all.size() - i)]);
      sum += all[i];
    }
    num_extreme += difference(sum) >= threshold;
  }
  return CorrectedShare(num_extreme, options.num_samples);
}

PairedTest ComparePaired(const ScoreTable& first, const ScoreTable& second,
                         const BootstrapOptions& bootstrap, const PermutationOptions& permutation) {
  PairedTest test;
  test.difference = BootstrapDifference(first, second, bootstrap);
  test.num_pairs = static_cast<int>(first.num_courses());
  std::vector<double> differences(first.num_courses());
  AddCourseMeans(first, 1.0, differences);
  AddCourseMeans(second, -1.0, differences);
  test.p_value = SignFlipPValue(differences, permutation);
  test.trained = first.trained || second.trained;
  const auto is_single = [](const ScoreTable& t) { return t.trained && t.num_seeds() == 1; };
  if (!test.trained || is_single(first) || is_single(second)) return test;
  const std::vector<double> a = MeansBySeed(first);
  const std::vector<double> b = MeansBySeed(second);
  if (first.trained && second.trained) {
    test.training_p_value = RelabellingPValue(a, b, permutation);
    // With as many seeds on both sides, a choice and its complement are equally extreme.
    test.least_training_p_value =
        (a.size() == b.size() ? 2.0 : 1.0) /
        static_cast<double>(Choices(a.size() + b.size(), a.size(), permutation.max_exact));
    return test;
  }
  std::vector<double> from_planner = first.trained ? a : b;
  const double planner = Mean(first.trained ? second : first);
  for (double& mean : from_planner) mean -= planner;
  test.training_p_value = SignFlipPValue(from_planner, permutation);
  test.least_training_p_value = std::ldexp(2.0, -static_cast<int>(from_planner.size()));
  return test;
}

std::string_view ToString(Verdict verdict) {
  constexpr std::array<std::string_view, 3> kNames = {"a clear difference", "could be chance",
                                                      "too few seeds to tell"};
  return kNames.at(static_cast<std::size_t>(verdict));
}

Verdict VerdictOf(const PairedTest& test, double corrected_p_value,
                  const std::optional<double>& corrected_training_p_value,
                  std::size_t num_compared) {
  constexpr double kLevel = 0.05;
  const double p = test.trained ? corrected_training_p_value.value_or(1.0) : corrected_p_value;
  if (p < kLevel) return Verdict::kDiffers;
  const bool could_differ =
      !test.trained || (corrected_training_p_value &&
                        static_cast<double>(num_compared) * test.least_training_p_value < kLevel);
  return could_differ ? Verdict::kCouldBeChance : Verdict::kTooFewSeeds;
}

std::vector<double> HolmCorrection(std::span<const double> p_values) {
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return p_values[i]; });
  std::vector<double> corrected(p_values.size());
  double highest = 0.0;
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const double p = p_values[order[rank]];
    SLALOM_CHECK_GE(p, 0.0);
    SLALOM_CHECK_LE(p, 1.0);
    highest = std::max(highest, std::min(1.0, static_cast<double>(order.size() - rank) * p));
    corrected[order[rank]] = highest;
  }
  return corrected;
}

}  // namespace slalom::eval
