#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "actor/course_sampler.h"
#include "base/random.h"
#include "env/action.h"
#include "env/episode.h"

namespace slalom::actor {

/// The figures of a finished episode that enter the statistics.
struct EpisodeSummary {
  env::Outcome outcome = env::Outcome::kRunning;
  std::int32_t num_steps = 0;
  float episode_return = 0.0f;  ///< Undiscounted sum of rewards.
  float episode_cost = 0.0f;    ///< Undiscounted sum of costs.

  friend bool operator==(const EpisodeSummary&, const EpisodeSummary&) = default;
};

/// The running episode of one environment.
struct OpenEpisode {
  std::uint64_t number = 0;  ///< Number of episodes that this environment began before.
  env::EpisodeSpec spec;
  bool is_learnable = false;         ///< Its course was drawn as a learnable one.
  base::Random::State noise{};       ///< Stream of the exploration noise, before the next step.
  float episode_return = 0.0f;       ///< Return so far.
  float episode_cost = 0.0f;         ///< Cost so far.
  std::uint64_t frame_checksum = 0;  ///< Checks that `Restore` led to the current frame.
  std::vector<float> actions;        ///< [T, A], actions so far, as given to the environment.
};

/// Everything that an `Actor` needs to continue as if it had never stopped. As environments are
/// deterministic, the actions of the open episodes stand for the environments' state.
struct ActorState {
  std::uint64_t seed = 0;
  std::int64_t num_steps = 0;          ///< Environment steps in total.
  std::int64_t num_episodes = 0;       ///< Finished episodes in total.
  std::vector<EpisodeSummary> recent;  ///< The last finished episodes, oldest first.
  std::vector<OpenEpisode> open;       ///< One per environment.
  SamplerState sampler;

  /// Returns the state as bytes, little-endian: "SLACTOR4", the fields in the order above (each
  /// list preceded by its length as u64), then the XXH3 checksum of all bytes before.
  std::string Serialize() const;

  /// Throws `base::Error`, with a message that starts with `source`, if the bytes are truncated,
  /// damaged or not a state.
  static ActorState Parse(std::string_view bytes, std::string_view source);
};

}  // namespace slalom::actor
