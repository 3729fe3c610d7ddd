#include "actor/actor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"

namespace slalom::actor {
namespace {

float Clip(double value) { return static_cast<float>(std::clamp(value, -1.0, 1.0)); }

/// First course of an actor in the stream of fresh courses, so that several drive different ones.
int FirstFreshCourse(std::uint64_t seed) {
  return static_cast<int>(
      base::Random(base::DeriveSeed(seed, "fresh courses")).UniformInt(std::uint64_t{1} << 30));
}

}  // namespace

std::vector<double> SpreadNoise(const ActorConfig& config, int num_environments) {
  base::ThrowIf(config.noise_min > config.noise_max,
                "actor.noise_min is {}, expected at most actor.noise_max = {}", config.noise_min,
                config.noise_max);
  const bool geometric =
      config.noise_spread == NoiseSpread::kGeometric && config.noise_min < config.noise_max;
  base::ThrowIf(
      geometric && config.noise_min == 0.0,
      "actor.noise_min is 0, expected more than 0 with actor.noise_spread = \"geometric\" (or "
      "choose \"linear\")");
  std::vector<double> noise(num_environments, config.noise_min);
  for (int i = 1; i < num_environments; ++i) {
    const double share = static_cast<double>(i) / (num_environments - 1);
    noise[i] = geometric ? config.noise_min * std::pow(config.noise_max / config.noise_min, share)
                         : config.noise_min + share * (config.noise_max - config.noise_min);
  }
  return noise;
}

Actor::Actor(const ActorConfig& config, env::BatchEnvironment& environments, env::Agent& agent,
             std::uint64_t seed, const SamplingConfig& sampling, Teachers* teachers)
    : config_(config),
      seed_(seed),
      environments_(environments),
      agent_(agent),
      teachers_(teachers),
      action_size_(environments.shape().action_size),
      noise_(SpreadNoise(config, environments.batch_size())),
      sampler_(sampling, environments.num_courses(), environments.has_fresh_courses(),
               FirstFreshCourse(seed)),
      running_(environments.batch_size()),
      actions_(environments.batch_size() * action_size_),
      teacher_actions_(actions_.size()),
      courses_(environments.batch_size()),
      normal_(environments.batch_size() * action_size_),
      results_(environments.batch_size()),
      rows_(environments.batch_size()) {
  for (int i = 0; i < environments_.batch_size(); ++i) {
    running_[i].noise =
        base::Random(base::DeriveSeed(seed_, "exploration", {static_cast<std::uint64_t>(i)}));
    BeginEpisode(i);
  }
}

void Actor::Step(replay::Chunk* out) {
  const env::ObservationBatch& observations = environments_.observations();
  agent_.Act(observations, actions_);
  RequireFinite(actions_, "the policy");
  Teach();
  AddNoise();
  std::vector<float>& recorded = teachers_ ? teacher_actions_ : actions_;
  const int num_rows = out->num_rows();
  for (int i = 0; i < environments_.batch_size(); ++i) {
    rows_[i] =
        out->BeginStep(i, observations.first[i] != 0, observations.frame(i), ActionOf(recorded, i));
  }
  try {
    environments_.Step(actions_, results_);
  } catch (...) {
    out->Truncate(num_rows);
    throw;
  }
  for (int i = 0; i < environments_.batch_size(); ++i) {
    out->SetResult(rows_[i], results_[i]);
    if (config_.time_limit_terminates && results_[i].ended()) {
      out->flags[rows_[i]] |= replay::kRowTerminated;
    }
    running_[i].actions.insert(running_[i].actions.end(), action(i).begin(), action(i).end());
    running_[i].episode_return += results_[i].reward;
    running_[i].episode_cost += results_[i].cost;
    if (results_[i].ended()) out->AddFinal(i, observations.frame(i));
  }
  for (int i = 0; i < environments_.batch_size(); ++i) {
    if (!results_[i].ended()) continue;
    EndEpisode(i);
    BeginEpisode(i);
  }
  base::MutexLock lock(mutex_);
  num_steps_ += environments_.batch_size();
}

void Actor::BeginEpisode(int i) {
  Environment& environment = running_[i];
  base::Random draw(base::DeriveSeed(seed_, "training episode",
                                     {static_cast<std::uint64_t>(i), environment.episode_number}));
  const CourseSampler::Draw course = sampler_.Next(draw);
  environment.spec.course = course.course;
  environment.is_learnable = course.is_learnable;
  environment.spec.seed = draw.NextU64();
  environment.episode_return = 0.0f;
  environment.episode_cost = 0.0f;
  environment.actions.clear();
  environments_.Reset(i, environment.spec);
}

void Actor::EndEpisode(int i) {
  Environment& environment = running_[i];
  ++environment.episode_number;
  sampler_.Report({environment.spec.course, environment.is_learnable},
                  results_[i].outcome == env::Outcome::kSuccess);
  base::MutexLock lock(mutex_);
  ++num_episodes_;
  ++num_outcomes_[static_cast<int>(results_[i].outcome)];
  sampling_stats_ = sampler_.stats();
  if (environment.is_learnable) return;
  recent_.push_back({results_[i].outcome,
                     static_cast<std::int32_t>(environment.actions.size() / action_size_),
                     environment.episode_return, environment.episode_cost});
  while (std::ssize(recent_) > config_.stats_episodes) recent_.pop_front();
}

void Actor::Teach() {
  if (!teachers_) return;
  for (std::size_t i = 0; i < running_.size(); ++i) courses_[i] = running_[i].spec.course;
  teachers_->Act(environments_.observations(), courses_, teacher_actions_);
  RequireFinite(teacher_actions_, "a teacher");
}

void Actor::RequireFinite(const std::vector<float>& actions, const char* who) const {
  const auto bad = std::ranges::find_if(actions, [](float a) { return !std::isfinite(a); });
  if (bad == actions.end()) return;
  const std::size_t i = static_cast<std::size_t>(bad - actions.begin()) / action_size_;
  throw base::Error("{} chose the action ({}) in environment {}; expected finite numbers", who,
                    fmt::join(std::span(actions).subspan(i * action_size_, action_size_), ", "), i);
}

void Actor::AddNoise() {
  bool warming_up;
  {
    base::MutexLock lock(mutex_);
    warming_up = num_steps_ < config_.warmup_steps;
  }
  for (int i = 0; i < environments_.batch_size(); ++i) {
    base::Random& random = running_[i].noise;
    for (std::size_t j = i * action_size_; j < (i + 1) * action_size_; ++j) {
      if (warming_up) {
        actions_[j] = static_cast<float>(random.Uniform(-1.0, 1.0));
      } else {
        normal_[j] = static_cast<float>(random.Normal());
      }
    }
  }
  if (warming_up || agent_.Explore(normal_, actions_)) return;
  for (std::size_t j = 0; j < actions_.size(); ++j) {
    actions_[j] = Clip(static_cast<double>(actions_[j]) +
                       noise_[j / action_size_] * static_cast<double>(normal_[j]));
  }
}

ActorStats Actor::stats() const {
  base::MutexLock lock(mutex_);
  ActorStats stats;
  stats.num_steps = num_steps_;
  stats.num_episodes = num_episodes_;
  stats.num_outcomes = num_outcomes_;
  stats.num_recent = static_cast<int>(recent_.size());
  stats.sampling = sampling_stats_;
  if (recent_.empty()) return stats;
  const double share = 1.0 / static_cast<double>(recent_.size());
  int num_outcomes[env::kNumOutcomes] = {};
  double cost = 0.0;
  for (const EpisodeSummary& episode : recent_) {
    ++num_outcomes[static_cast<int>(episode.outcome)];
    stats.mean_return += share * static_cast<double>(episode.episode_return);
    stats.mean_length += share * episode.num_steps;
    cost += static_cast<double>(episode.episode_cost);
  }
  stats.mean_cost = share * cost;
  stats.success_rate = share * num_outcomes[static_cast<int>(env::Outcome::kSuccess)];
  stats.collision_rate = share * num_outcomes[static_cast<int>(env::Outcome::kCollision)];
  stats.timeout_rate = share * num_outcomes[static_cast<int>(env::Outcome::kTimeout)];
  return stats;
}

std::uint64_t Actor::FrameChecksum(int i) const {
  const env::FrameView frame = environments_.observations().frame(i);
  return base::Checksum(std::as_bytes(frame.state), base::Checksum(std::as_bytes(frame.ranges_cm)));
}

ActorState Actor::Save() const {
  ActorState state;
  state.seed = seed_;
  {
    base::MutexLock lock(mutex_);
    state.num_steps = num_steps_;
    state.num_episodes = num_episodes_;
    state.recent.assign(recent_.begin(), recent_.end());
  }
  for (int i = 0; i < environments_.batch_size(); ++i) {
    const Environment& environment = running_[i];
    state.open.push_back({environment.episode_number, environment.spec, environment.is_learnable,
                          environment.noise.state(), environment.episode_return,
                          environment.episode_cost, FrameChecksum(i), environment.actions});
  }
  state.sampler = sampler_.Save();
  return state;
}

void Actor::Restore(const ActorState& state) {
  base::ThrowIf(state.seed != seed_, "the actor state has seed {}, expected {}", state.seed, seed_);
  base::ThrowIf(std::ssize(state.open) != environments_.batch_size(),
                "the actor state has {} environments, expected {}", state.open.size(),
                environments_.batch_size());
  sampler_.Restore(state.sampler);
  ReplayOpenEpisodes(state.open);
  for (int i = 0; i < environments_.batch_size(); ++i) {
    const OpenEpisode& open = state.open[i];
    base::ThrowIf(
        FrameChecksum(i) != open.frame_checksum,
        "driving the open episode of environment {} again led to another frame than when it was "
        "saved; expected the same courses and environment config",
        i);
    Environment& environment = running_[i];
    environment.episode_number = open.number;
    environment.spec = open.spec;
    environment.is_learnable = open.is_learnable;
    environment.noise.set_state(open.noise);
    environment.episode_return = open.episode_return;
    environment.episode_cost = open.episode_cost;
    environment.actions = open.actions;
  }
  base::MutexLock lock(mutex_);
  num_steps_ = state.num_steps;
  num_episodes_ = state.num_episodes;
  recent_.assign(state.recent.begin(), state.recent.end());
  sampling_stats_ = sampler_.stats();
}

/// Aligns the open episodes at their ends: shorter ones begin later, so that each step is driven
/// next to the same steps of the other environments as the first time. Until its episode begins, an
/// environment runs the episode that the constructor began, and the results are ignored.
void Actor::ReplayOpenEpisodes(const std::vector<OpenEpisode>& open) {
  std::size_t longest = 0;
  for (const OpenEpisode& episode : open) {
    const bool is_known =
        episode.spec.course < environments_.num_courses() || environments_.has_fresh_courses();
    base::ThrowIf(episode.spec.course < 0 || !is_known,
                  "the actor state is on course {}, expected a number below {}",
                  episode.spec.course, environments_.num_courses());
    longest = std::max(longest, episode.actions.size() / action_size_);
  }
  for (std::size_t left = longest;; --left) {
    for (int i = 0; i < environments_.batch_size(); ++i) {
      if (open[i].actions.size() / action_size_ == left) environments_.Reset(i, open[i].spec);
    }
    if (left == 0) return;
    agent_.Act(environments_.observations(), actions_);
    Teach();
    for (int i = 0; i < environments_.batch_size(); ++i) {
      const std::span<const float> recorded(open[i].actions);
      std::ranges::fill(action(i), 0.0f);
      if (recorded.size() < left * action_size_) continue;
      std::ranges::copy(recorded.last(left * action_size_).first(action_size_), action(i).begin());
    }
    environments_.Step(actions_, results_);
  }
}

}  // namespace slalom::actor
