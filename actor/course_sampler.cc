#include "actor/course_sampler.h"

#include <algorithm>

#include "base/check.h"
#include "base/error.h"

namespace slalom::actor {
namespace {

/// Factor on the weight of older episodes when another ends: the last five count about as much as
/// all before them.
constexpr float kMemory = 0.875f;
constexpr std::size_t kNumRecent = 1000;

void Count(MeasuredCourse& course, bool is_success, float memory) {
  course.num_successes *= memory;
  course.num_failures *= memory;
  (is_success ? course.num_successes : course.num_failures) += 1.0f;
}

}  // namespace

double MeasuredCourse::learnability() const {
  const double all = num_episodes();
  if (all == 0.0) return 0.0;
  return static_cast<double>(num_successes) * static_cast<double>(num_failures) / (all * all);
}

CourseSampler::CourseSampler(const SamplingConfig& config, int num_named, bool has_fresh,
                             int first_fresh)
    : config_(config), num_named_(num_named), has_fresh_(has_fresh), first_fresh_(first_fresh) {
  SLALOM_CHECK(num_named >= 1 || has_fresh);
  for (int i = 0; i < num_named; ++i) named_.push_back({.course = i});
}

CourseSampler::Draw CourseSampler::Next(base::Random& random) {
  if (config_.sampling == Sampling::kLearnable && random.Uniform() < config_.learnable_share) {
    double total = 0.0;
    for (const auto* courses : {&named_, &learnable_}) {
      for (const MeasuredCourse& course : *courses) total += course.learnability();
    }
    double left = total * random.Uniform();
    for (const auto* courses : {&named_, &learnable_}) {
      for (const MeasuredCourse& course : *courses) {
        left -= course.learnability();
        if (left < 0.0) return {course.course, true};
      }
    }
  }
  const bool is_fresh = has_fresh_ && (num_named_ == 0 || random.Uniform() < config_.fresh_share);
  if (!is_fresh) {
    return {static_cast<int>(random.UniformInt(static_cast<std::uint64_t>(num_named_))), false};
  }
  const int course =
      num_named_ + first_fresh_ + static_cast<int>(num_fresh_draws_++ / config_.fresh_episodes);
  candidates_.try_emplace(course, MeasuredCourse{.course = course});
  return {course, false};
}

void CourseSampler::Report(const Draw& draw, bool is_success) {
  if (!IsFresh(draw.course)) {
    MeasuredCourse& course = named_[draw.course];
    if (course.num_episodes() == 0.0) ++num_named_driven_;
    Count(course, is_success, kMemory);
  } else if (draw.is_learnable) {
    const auto found = std::ranges::find(learnable_, draw.course, &MeasuredCourse::course);
    if (found != learnable_.end()) Count(*found, is_success, kMemory);
  } else {
    const auto found = candidates_.find(draw.course);
    if (found == candidates_.end()) return;
    Count(found->second, is_success, 1.0f);
    const MeasuredCourse measured = found->second;
    if (measured.num_episodes() < config_.fresh_episodes) return;
    candidates_.erase(found);
    Remember(measured);
    Keep(measured);
  }
}

void CourseSampler::Remember(const MeasuredCourse& measured) {
  const auto count = [this](const MeasuredCourse& course, int sign) {
    recent_successes_ += sign * static_cast<std::int64_t>(course.num_successes);
    recent_learnable_ += course.learnability() > 0.0 ? sign : 0;
  };
  count(recent_.emplace_back(measured), 1);
  if (recent_.size() <= kNumRecent) return;
  count(recent_.front(), -1);
  recent_.pop_front();
}

void CourseSampler::Keep(const MeasuredCourse& measured) {
  if (config_.sampling != Sampling::kLearnable || measured.learnability() == 0.0) return;
  if (std::ssize(learnable_) < config_.learnable_courses) {
    learnable_.push_back(measured);
    return;
  }
  const auto least = std::ranges::min_element(learnable_, {}, &MeasuredCourse::learnability);
  if (least->learnability() < measured.learnability()) *least = measured;
}

SamplingStats CourseSampler::stats() const {
  SamplingStats stats;
  stats.num_courses =
      num_named_driven_ + (num_fresh_draws_ + config_.fresh_episodes - 1) / config_.fresh_episodes;
  if (recent_.empty()) return stats;
  const auto num_recent = static_cast<double>(recent_.size());
  stats.mean_success =
      static_cast<double>(recent_successes_) / (num_recent * config_.fresh_episodes);
  stats.learnable_share = static_cast<double>(recent_learnable_) / num_recent;
  return stats;
}

SamplerState CourseSampler::Save() const {
  SamplerState state{.num_fresh_draws = num_fresh_draws_,
                     .named = named_,
                     .candidates = {},
                     .learnable = learnable_,
                     .recent = {recent_.begin(), recent_.end()}};
  for (const auto& [number, candidate] : candidates_) state.candidates.push_back(candidate);
  return state;
}

void CourseSampler::Restore(const SamplerState& state) {
  base::ThrowIf(state.named.size() != named_.size(), "the actor state has {} courses, expected {}",
                state.named.size(), named_.size());
  num_fresh_draws_ = state.num_fresh_draws;
  named_ = state.named;
  learnable_ = state.learnable;
  num_named_driven_ = std::ranges::count_if(
      named_, [](const MeasuredCourse& course) { return course.num_episodes() > 0.0; });
  recent_.clear();
  recent_successes_ = recent_learnable_ = 0;
  for (const MeasuredCourse& measured : state.recent) Remember(measured);
  candidates_.clear();
  for (const MeasuredCourse& candidate : state.candidates) {
    candidates_[candidate.course] = candidate;
  }
}

}  // namespace slalom::actor
