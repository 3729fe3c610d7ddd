#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "actor/actor_config.h"
#include "actor/actor_state.h"
#include "actor/course_sampler.h"
#include "actor/teachers.h"
#include "base/mutex.h"
#include "base/random.h"
#include "env/agent.h"
#include "env/environment.h"
#include "replay/chunk.h"

/// Shapes: `B` environments, `A` numbers of an action.

namespace slalom::actor {

/// Statistics of the last `stats_episodes` finished episodes whose courses were drawn uniformly; 0
/// if there is none yet.
struct ActorStats {
  std::int64_t num_steps = 0;     ///< Environment steps in total.
  std::int64_t num_episodes = 0;  ///< Finished episodes in total.
  /// Finished episodes by `env::Outcome`, without those from before a `Restore`.
  std::array<std::int64_t, env::kNumOutcomes> num_outcomes{};
  int num_recent = 0;  ///< Finished episodes that the means below are taken over.
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double mean_return = 0.0;
  double mean_cost = 0.0;    ///< Sum of an episode's costs; on courses, its collisions.
  double mean_length = 0.0;  ///< Control steps.
  SamplingStats sampling;
};

/// Returns the standard deviation of the exploration noise in each environment, [B]. Throws
/// `base::Error` if noise_min exceeds noise_max, or if it is 0 and the spread to a larger noise_max
/// is geometric.
std::vector<double> SpreadNoise(const ActorConfig& config, int num_environments);

/// Drives a batch of environments with an agent and exploration noise, and collects the rows.
///
/// A `CourseSampler` draws the course of each episode. Every environment has its own random
/// streams, so with uniform sampling on a named set its draws do not depend on when the episodes of
/// other environments end.
///
/// `Step`, `Save` and `Restore` are confined to one thread at a time; `stats` may be called by any.
class Actor {
 public:
  /// Begins the first episode of every environment. What is referred to must outlive the actor.
  /// With `teachers`, a row's action is the one that its teacher would have taken, not the one that
  /// was driven. Throws `base::Error` if `config` contradicts itself.
  Actor(const ActorConfig& config, env::BatchEnvironment& environments, env::Agent& agent,
        std::uint64_t seed, const SamplingConfig& sampling = {}, Teachers* teachers = nullptr);

  /// Does one control step in every environment. Adds B rows to `out`, and a final row for each
  /// episode that ends, whose environment then begins the next one. Stream i of the chunk is
  /// environment i. Throws `base::Error` if the agent chooses an action that is not finite (its
  /// network diverged); the actor is then unchanged. What an environment throws passes through: a
  /// step that is not made leaves no row, and one after which an episode cannot begin leaves all.
  /// Do not use the actor after that.
  /// Requires: out->shape is the environments'.
  void Step(replay::Chunk* out);

  ActorStats stats() const EXCLUDES(mutex_);

  /// Returns the actor's state between two steps.
  ActorState Save() const;

  /// Continues from `state`: drives the open episodes again with their recorded actions. The agent
  /// sees the same frames as then (its choices are ignored), which restores whatever it remembers
  /// of an episode. The following steps are, bit for bit, the saved actor's if the agent chooses
  /// the same actions. Throws `base::Error` if the state has another seed or another number of
  /// environments, or does not lead to the frames it was saved with (other courses or another
  /// environment config). Do not use the actor after that.
  void Restore(const ActorState& state);

 private:
  struct Environment {
    std::uint64_t episode_number = 0;
    env::EpisodeSpec spec;
    bool is_learnable = false;  // Its course was drawn as a learnable one.
    base::Random noise{0};
    float episode_return = 0.0f;
    float episode_cost = 0.0f;
    std::vector<float> actions;  // [T, A], taken in the running episode.
  };

  std::span<float> action(int i) { return ActionOf(actions_, i); }
  std::span<float> ActionOf(std::vector<float>& actions, int i) const {
    return std::span(actions).subspan(static_cast<std::size_t>(i) * action_size_, action_size_);
  }
  /// Writes the teachers' actions for the current frames, if there are teachers.
  void Teach();
  void BeginEpisode(int i);
  void EndEpisode(int i);
  void RequireFinite(const std::vector<float>& actions, const char* who) const;
  void AddNoise();
  std::uint64_t FrameChecksum(int i) const;
  void ReplayOpenEpisodes(const std::vector<OpenEpisode>& open);

  const ActorConfig config_;
  const std::uint64_t seed_;
  env::BatchEnvironment& environments_;
  env::Agent& agent_;
  Teachers* const teachers_;         // May be null.
  const std::size_t action_size_;    // A
  const std::vector<double> noise_;  // [B]
  CourseSampler sampler_;
  std::vector<Environment> running_;      // [B]
  std::vector<float> actions_;            // [B, A]
  std::vector<float> teacher_actions_;    // [B, A].
  std::vector<int> courses_;              // [B], for the teachers.
  std::vector<float> normal_;             // [B, A], a step's standard normal numbers.
  std::vector<env::StepResult> results_;  // [B]
  std::vector<int> rows_;                 // [B], indices into the chunk being filled.

  mutable base::Mutex mutex_;
  std::int64_t num_steps_ GUARDED_BY(mutex_) = 0;
  std::int64_t num_episodes_ GUARDED_BY(mutex_) = 0;
  std::array<std::int64_t, env::kNumOutcomes> num_outcomes_ GUARDED_BY(mutex_){};
  std::deque<EpisodeSummary> recent_ GUARDED_BY(mutex_);
  SamplingStats sampling_stats_ GUARDED_BY(mutex_);
};

}  // namespace slalom::actor
