#include "learner/run/learning_watch.h"

#include <fmt/format.h>

#include <cmath>

namespace slalom::run {
namespace {

/// Updates without a gradient up to this row, of which the last `updates` had the norm `norm`: NaN
/// if the network was due in none of them.
std::int64_t CountStill(std::int64_t before, std::int64_t updates, double norm) {
  if (std::isnan(norm)) return before;
  return norm == 0.0 ? before + updates : 0;
}

}  // namespace

std::optional<std::string> LearningWatch::Observe(const MetricsRow& row, double fraction) {
  if (!first_) {
    first_ = row;
    last_.updates = row.updates;
  }
  const std::int64_t updates = row.updates - last_.updates;
  if (updates > 0) {
    actor_still_updates_ =
        CountStill(actor_still_updates_, updates, row.learning.actor_gradient_norm);
    critic_still_updates_ =
        CountStill(critic_still_updates_, updates, row.learning.critic_gradient_norm);
  }
  has_succeeded_ = has_succeeded_ || row.success_rate > 0.0;
  last_ = row;
  fraction_ = fraction;
  // The counts in the sentence change with each row; only its kind decides whether it was logged
  // before.
  const std::string kind = is_actor_still()    ? "actor"
                           : is_critic_still() ? "critic"
                           : fault().empty()   ? ""
                                               : "success";
  if (kind.empty() || kind == said_) return std::nullopt;
  said_ = kind;
  return fault();
}

std::string LearningWatch::fault() const {
  if (is_actor_still() || is_critic_still()) {
    const bool actor = is_actor_still();
    return fmt::format(
        "{} had a gradient of exactly 0 in the last {} updates, so {} and never will again: the "
        "network is saturated, usually because learner.{}_learning_rate is too high",
        actor ? "the actor" : "the critics", actor ? actor_still_updates_ : critic_still_updates_,
        actor ? "it does not learn" : "they do not learn", actor ? "actor" : "critic");
  }
  if (!first_ || has_succeeded_ || fraction_ < 0.5) return "";
  const std::int64_t episodes = last_.episodes - first_->episodes;
  if (episodes < kEpisodes || last_.updates == 0) return "";
  return fmt::format(
      "none of {} training episodes has reached its goal; docs/training.md says what to check when "
      "training does not work",
      episodes);
}

bool LearningWatch::nothing_learned() const {
  return (is_actor_still() || is_critic_still()) && !has_succeeded_;
}

}  // namespace slalom::run
