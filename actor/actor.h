#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "actor/actor_config.h"
#include "actor/actor_state.h"
#include "base/mutex.h"
#include "base/random.h"
#include "env/agent.h"
#include "env/environment.h"
#include "replay/chunk.h"

/// Shapes: `B` environments.

namespace slalom::actor {

/// Figures of the last `stats_episodes` finished episodes; 0 where there is none yet.
struct ActorStats {
  std::int64_t num_steps = 0;     ///< Environment steps in all.
  std::int64_t num_episodes = 0;  ///< Finished in all.
  /// Of them, by `env::Outcome`, those that this actor drove itself (none from before a `Restore`).
  std::array<std::int64_t, 4> num_outcomes{};
  int num_recent = 0;  ///< Finished episodes that the figures below stand on.
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double mean_return = 0.0;
  double mean_length = 0.0;  ///< Control steps.
};

/// Standard deviation of the exploration noise in each of the environments, [B].
/// Throws `base::Error` where noise_min exceeds noise_max, or is 0 in a geometric spread that is
/// not even.
std::vector<double> SpreadNoise(const ActorConfig& config, int num_environments);

/// Drives a batch of environments with an agent and exploration noise, and hands on what happens.
///
/// Each episode's course is drawn uniformly. Every environment has random streams of its own, so
/// what is drawn for one does not depend on when the episodes of others end.
///
/// `Step`, `Save` and `Restore` are confined to one thread at a time; `stats` may be called by any.
class Actor {
 public:
  /// Begins the first episode of every environment. Both references must outlive the actor.
  /// Throws `base::Error` where `config` contradicts itself.
  Actor(const ActorConfig& config, env::BatchEnvironment& environments, env::Agent& agent,
        std::uint64_t seed);

  /// One control step of every environment: B rows are added to `out`, and one more for each
  /// episode that ends; in its place the next one begins. Stream i of the chunk is environment i.
  /// Throws `base::Error` where the agent chooses an action that is not finite (a network that
  /// diverged); the actor is then as before.
  /// Requires: out->num_beams is that of the observations.
  void Step(replay::Chunk* out);

  ActorStats stats() const EXCLUDES(mutex_);

  /// The state between two steps.
  ActorState Save() const;

  /// Goes on from `state`: the open episodes are driven again with their recorded actions. The
  /// agent sees the same frames on the way (its choices are ignored), so that whatever it remembers
  /// of an episode is there again. The following steps are, bit for bit, those of the actor that
  /// was saved, provided that the agent chooses the same.
  /// Throws `base::Error` where the state is of another seed, another number of environments, or
  /// does not lead to the frames it was saved with (other courses or another environment config);
  /// the actor is then not to be used further.
  void Restore(const ActorState& state);

 private:
  struct Environment {
    std::uint64_t episode_number = 0;
    env::EpisodeSpec spec;
    base::Random noise{0};
    float episode_return = 0.0f;
    std::vector<env::Action> actions;  // Of the running episode.
  };

  void BeginEpisode(int i);
  void EndEpisode(int i);
  void RequireFiniteActions() const;
  void AddNoise();
  std::uint64_t FrameChecksum(int i) const;
  void ReplayOpenEpisodes(const std::vector<OpenEpisode>& open);

  const ActorConfig config_;
  const std::uint64_t seed_;
  env::BatchEnvironment& environments_;
  env::Agent& agent_;
  const std::vector<double> noise_;       // [B]
  std::vector<Environment> running_;      // [B]
  std::vector<env::Action> actions_;      // [B]
  std::vector<env::Action> normal_;       // [B], standard normal numbers of a step.
  std::vector<env::StepResult> results_;  // [B]
  std::vector<int> rows_;                 // [B] in the chunk being filled.

  mutable base::Mutex mutex_;
  std::int64_t num_steps_ GUARDED_BY(mutex_) = 0;
  std::int64_t num_episodes_ GUARDED_BY(mutex_) = 0;
  std::array<std::int64_t, 4> num_outcomes_ GUARDED_BY(mutex_){};
  std::deque<EpisodeSummary> recent_ GUARDED_BY(mutex_);
};

}  // namespace slalom::actor
