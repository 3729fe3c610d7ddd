#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "proto/messages.h"

namespace slalom::learner {

/// What all actors that report did lately, together. NaN: none has finished an episode.
struct ActorFigures {
  std::int64_t num_episodes = 0;
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double mean_return = 0.0;
  double mean_length = 0.0;
};

/// Means over the connected actors of a status.
ActorFigures Summarise(const proto::StatusReply& status);

/// Counts episodes that actors finished, each once, over restarts and silences of actors and of the
/// replay server that tells of them. Thread-compatible.
class FinishedEpisodes {
 public:
  /// Those since the last call. An actor that is heard of for the first time counts from then on,
  /// as nobody knows which of its episodes were counted before; one that starts anew from 0.
  std::int64_t Take(const proto::StatusReply& status);

 private:
  std::map<std::string, std::int64_t> seen_;  // By the actor's name.
};

}  // namespace slalom::learner
