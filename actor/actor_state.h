#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/random.h"
#include "env/action.h"
#include "env/episode.h"

namespace slalom::actor {

/// What the statistics keep of a finished episode.
struct EpisodeSummary {
  env::Outcome outcome = env::Outcome::kRunning;
  std::int32_t num_steps = 0;
  float episode_return = 0.0f;  ///< Sum of rewards, not discounted.

  friend bool operator==(const EpisodeSummary&, const EpisodeSummary&) = default;
};

/// What one environment is in the middle of.
struct OpenEpisode {
  std::uint64_t number = 0;  ///< How many episodes this environment began before.
  env::EpisodeSpec spec;
  base::Random::State noise{};       ///< Stream of the exploration noise, before the next step.
  float episode_return = 0.0f;       ///< So far.
  std::uint64_t frame_checksum = 0;  ///< Of the current frame, to see that a replay led to it.
  std::vector<env::Action> actions;  ///< Taken so far, as given to the environment.
};

/// All that an `Actor` needs to go on as if it had never stopped: environments are deterministic,
/// so the actions of the open episodes stand for their state.
struct ActorState {
  std::uint64_t seed = 0;
  std::int64_t num_steps = 0;          ///< Environment steps in all.
  std::int64_t num_episodes = 0;       ///< Finished in all.
  std::vector<EpisodeSummary> recent;  ///< Last finished episodes, oldest first.
  std::vector<OpenEpisode> open;       ///< One per environment.

  /// The state as bytes, little-endian: "SLACTOR1", the fields in the order above (each list
  /// preceded by its length as u64), then the XXH3 of all bytes before.
  std::string Serialize() const;

  /// Throws `base::Error` that starts with `source` where the bytes are cut, damaged or not a
  /// state.
  static ActorState Parse(std::string_view bytes, std::string_view source);
};

}  // namespace slalom::actor
