#include "eval/comparison/quantity.h"

#include <algorithm>
#include <array>

#include "eval/summary.h"

namespace slalom::eval {
namespace {

template <env::Outcome outcome>
std::optional<double> Has(const ResultEpisode& episode, double /*optimal_time*/) {
  return episode.outcome == outcome ? 1.0 : 0.0;
}

template <bool of_successes>
std::optional<double> Time(const ResultEpisode& episode, double /*optimal_time*/) {
  const bool is_success = episode.outcome == env::Outcome::kSuccess;
  return is_success == of_successes ? std::optional(episode.time) : std::nullopt;
}

std::optional<double> Touched(const ResultEpisode& episode, double /*optimal_time*/) {
  return episode.num_collisions > 0 ? 1.0 : 0.0;
}

std::optional<double> Score(const ResultEpisode& episode, double optimal_time) {
  return BarnScore(episode.outcome, episode.time, optimal_time);
}

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

constexpr std::array<Quantity, 9> kQuantities = {{
    {"success_rate", "success", "%", 100.0, 1, true, true, 1.0, Aggregate::kMean,
     Has<env::Outcome::kSuccess>},
    {"success_rate_iqm", "IQM", "%", 100.0, 1, true, true, 1.0, Aggregate::kInterquartileMean,
     Has<env::Outcome::kSuccess>},
    {"success_rate_worst", "worst 5 %", "%", 100.0, 1, true, true, 1.0,
     Aggregate::kLowestTwentiethMean, Has<env::Outcome::kSuccess>},
    {"collision_rate", "collision", "%", 100.0, 1, false, true, 1.0, Aggregate::kMean,
     Has<env::Outcome::kCollision>},
    {"timeout_rate", "timeout", "%", 100.0, 1, false, true, 1.0, Aggregate::kMean,
     Has<env::Outcome::kTimeout>},
    {"contact_rate", "touched", "%", 100.0, 1, false, true, 1.0, Aggregate::kMean, Touched},
    {"survival_time_s", "survival", "s", 1.0, 1, true, false, kNoLimit, Aggregate::kMean,
     Time<false>},
    {"traversal_time_s", "traversal", "s", 1.0, 1, false, false, kNoLimit, Aggregate::kMean,
     Time<true>},
    {"barn_score", "BARN score", "", 1.0, 3, true, false, 1.0 / kBarnLimit, Aggregate::kMean,
     Score},
}};

}  // namespace

std::span<const Quantity> Quantities() { return kQuantities; }

std::optional<std::size_t> FindQuantity(std::string_view key) {
  const auto found = std::ranges::find(kQuantities, key, &Quantity::key);
  if (found == kQuantities.end()) return std::nullopt;
  return static_cast<std::size_t>(found - kQuantities.begin());
}

}  // namespace slalom::eval
