#include "app/python/vector_environment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "sim/scene.h"

namespace slalom::python {
namespace {

constexpr char kStream[] = "episodes of a vector environment";

std::vector<std::string> NamesOf(const sim::CourseSet& courses) {
  std::vector<std::string> names;
  for (const auto& course : courses.courses) names.push_back(course->name);
  return names;
}

}  // namespace

VectorEnvironment::VectorEnvironment(const VectorConfig& config)
    : autoreset_(config.autoreset),
      course_names_(NamesOf(config.courses)),
      parallel_(config.num_threads),
      environments_(config.environment, sim::MakeScenes(config.courses), config.num_environments,
                    &parallel_,
                    config.physics.make_bodies ? config.physics.make_bodies : sim::MakeRobots()),
      features_(sim::MakeObservationSpec(config.environment), {}) {
  const auto size = static_cast<std::size_t>(config.num_environments);
  streams_.assign(size, base::Random(0));
  results_.resize(size);
  final_.Resize(config.num_environments, observations().num_beams, observations().state_size);
  for (auto* numbers : {&rewards_, &costs_, &final_returns_, &returns_}) numbers->resize(size);
  for (auto* flags : {&terminations_, &truncations_, &ended_, &outcomes_}) flags->resize(size);
  waiting_.assign(size, 1);
  for (auto* counts : {&courses_, &lengths_, &final_courses_, &final_lengths_}) {
    counts->resize(size);
  }
}

void VectorEnvironment::Seed(int i, std::uint64_t seed) {
  streams_[i] = base::Random(base::DeriveSeed(seed, kStream));
}

void VectorEnvironment::Reset(int i, std::optional<int> course, std::optional<std::uint64_t> seed) {
  const auto num_courses = static_cast<std::uint64_t>(environments_.num_courses());
  // Drawn in any case, so that the episodes that follow are the same.
  const auto drawn_course = static_cast<int>(streams_[i].UniformInt(num_courses));
  const std::uint64_t drawn_seed = streams_[i].NextU64();
  const env::EpisodeSpec spec = {course.value_or(drawn_course), seed.value_or(drawn_seed)};
  if (spec.course < 0 || spec.course >= environments_.num_courses()) {
    throw base::Error(fmt::format("course {}: expected a number from 0 to {}", spec.course,
                                  environments_.num_courses() - 1));
  }
  environments_.Reset(i, spec);
  courses_[i] = spec.course;
  lengths_[i] = 0;
  returns_[i] = 0.0;
  waiting_[i] = 0;
}

void VectorEnvironment::KeepFinal(int i, env::Outcome outcome) {
  const env::FrameView frame = observations().frame(i);
  std::ranges::copy(frame.ranges_cm, final_.mutable_ranges(i).begin());
  std::ranges::copy(frame.state, final_.mutable_state(i).begin());
  outcomes_[i] = static_cast<std::uint8_t>(outcome);
  final_courses_[i] = courses_[i];
  final_lengths_[i] = lengths_[i];
  final_returns_[i] = returns_[i];
}

bool VectorEnvironment::Step(std::span<const env::Action> actions) {
  for (int i = 0; i < size(); ++i) {
    if (waiting_[i]) {
      if (autoreset_ == Autoreset::kNextStep && ended_[i]) continue;
      throw base::Error(fmt::format("environment {}: has no running episode; reset it first", i));
    }
    if (std::isfinite(actions[i].linear) && std::isfinite(actions[i].angular)) continue;
    throw base::Error(fmt::format("environment {}: action is ({}, {}), expected finite numbers", i,
                                  actions[i].linear, actions[i].angular));
  }
  environments_.Step(env::NumbersOf(actions), results_);
  changing_.clear();
  bool any = false;
  for (int i = 0; i < size(); ++i) {
    if (waiting_[i]) {  // Its environment stood still.
      results_[i] = {};
      changing_.push_back(i);
    } else {
      ++lengths_[i];
    }
    const env::StepResult result = results_[i];
    rewards_[i] = result.reward;
    costs_[i] = result.cost;
    returns_[i] += result.reward;
    terminations_[i] = result.terminated();
    ended_[i] = result.ended();
    truncations_[i] = result.ended() && !result.terminated();
    if (!result.ended()) continue;
    any = true;
    changing_.push_back(i);
  }
  parallel_.For(static_cast<int>(changing_.size()), [this](int k) {
    const int i = changing_[k];
    if (!ended_[i]) return Reset(i);
    waiting_[i] = 1;
    KeepFinal(i, results_[i].outcome);
    if (autoreset_ == Autoreset::kSameStep) Reset(i);
  });
  return any;
}

}  // namespace slalom::python
