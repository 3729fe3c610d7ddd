#include "replay/rate_limiter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "base/check.h"
#include "base/file.h"
#include "base/name.h"

namespace slalom::replay {

RateLimiter::RateLimiter(const Options& options, std::int64_t steps)
    : options_(options),
      batches_per_step_(options.updates_per_step * options.batches_per_update),
      steps_(steps) {
  SLALOM_CHECK_GT(options.updates_per_step, 0.0);
  SLALOM_CHECK_GE(options.batches_per_update, 1);
  SLALOM_CHECK_GE(options.learning_starts, 0);
  SLALOM_CHECK_GE(options.max_ahead_steps, 0);
  SLALOM_CHECK_GE(steps, 0);
}

double RateLimiter::granted() const {
  double sum = 0.0;
  for (const auto& [name, learner] : learners_) sum += static_cast<double>(learner.next);
  return sum;
}

void RateLimiter::Ask(const std::string& learner, std::uint64_t cursor) {
  if (!learners_.contains(learner)) MakeRoom();
  learners_[learner] = {.next = cursor, .present = true, .used = ++calls_};
}

bool RateLimiter::MaySample(const std::string& learner) const {
  SLALOM_CHECK(learners_.contains(learner));
  return granted() + 1.0 <=
         batches_per_step_ * static_cast<double>(steps_ - options_.learning_starts);
}

void RateLimiter::Grant(const std::string& learner) {
  SLALOM_CHECK(learners_.contains(learner));
  ++learners_[learner].next;
}

void RateLimiter::Leave(const std::string& learner) {
  if (const auto it = learners_.find(learner); it != learners_.end()) it->second.present = false;
}

std::string RateLimiter::PrintCursors() const {
  std::string lines;
  for (const auto& [name, learner] : learners_) lines += fmt::format("{} {}\n", learner.next, name);
  return fmt::format("{:016x}\n{}", base::Checksum(lines), lines);
}

std::optional<base::Failure> RateLimiter::RestoreCursors(std::string_view text) {
  const std::size_t end = std::min(text.find('\n'), text.size());
  const std::string_view lines = text.substr(std::min(end + 1, text.size()));
  if (text.substr(0, end) != fmt::format("{:016x}", base::Checksum(lines))) {
    return base::Failure{"damaged, as its checksum does not match"};
  }
  std::istringstream words{std::string(lines)};
  std::map<std::string, Learner> learners;
  std::uint64_t next = 0;
  for (std::string name; words >> next >> name;) {
    if (!base::IsName(name) || learners.size() == kMaxLearners) {
      return base::Failure{"no cursors of learners"};
    }
    learners[name] = {.next = next, .present = false, .used = 0};
  }
  learners_ = std::move(learners);
  return std::nullopt;
}

bool RateLimiter::MayInsert() const {
  if (options_.max_ahead_steps == 0 || starved_ || steps_ < options_.learning_starts) return true;
  const double ahead =
      std::max(static_cast<double>(options_.max_ahead_steps), std::ceil(1.0 / batches_per_step_));
  return static_cast<double>(steps_ - options_.learning_starts) <=
         granted() / batches_per_step_ + ahead;
}

// Peers may claim any name, so the one that has been silent for longest is dropped.
void RateLimiter::MakeRoom() {
  if (learners_.size() < kMaxLearners) return;
  learners_.erase(
      std::min_element(learners_.begin(), learners_.end(), [](const auto& a, const auto& b) {
        return std::pair(a.second.present, a.second.used) <
               std::pair(b.second.present, b.second.used);
      }));
}

}  // namespace slalom::replay
