#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string_view>

#include "eval/report/result.h"

namespace slalom::eval {

/// How the scores of an agent by seed and course become one number.
enum class Aggregate {
  kMean,                 ///< Over the episodes that have the quantity.
  kInterquartileMean,    ///< `InterquartileMean`
  kLowestTwentiethMean,  ///< `LowestTwentiethMean`
};

/// A quantity that is measured of an agent. All tables, files and pages show quantities of one
/// list, `Quantities`.
struct Quantity {
  std::string_view key;    ///< In files: "success_rate".
  std::string_view title;  ///< In tables, in lower case: "success".
  std::string_view unit;   ///< As shown: "%", "s" or empty.
  double factor = 1.0;     ///< From the quantity to the number that is shown.
  int digits = 1;          ///< Decimals that are shown.
  bool higher_is_better = true;
  bool is_rate = true;                                     ///< A share of episodes.
  double limit = std::numeric_limits<double>::infinity();  ///< No value lies above it.
  Aggregate aggregate = Aggregate::kMean;
  /// Value of an episode; none: the episode does not have the quantity. `optimal_time`: [s].
  std::optional<double> (*value)(const ResultEpisode& episode, double optimal_time) = nullptr;

  /// "points" for rates, else the unit.
  std::string_view difference_unit() const { return is_rate ? "points" : unit; }
};

/// Returns all quantities in the order of tables: success_rate (the first), success_rate_iqm,
/// success_rate_worst, collision_rate, timeout_rate, contact_rate, survival_time_s,
/// traversal_time_s, barn_score.
std::span<const Quantity> Quantities();

/// Returns the place in `Quantities` of the quantity of this key; none: there is none.
std::optional<std::size_t> FindQuantity(std::string_view key);

}  // namespace slalom::eval
