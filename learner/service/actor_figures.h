#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "proto/messages.h"

namespace slalom::learner {

/// Statistics of recent episodes over all connected actors. NaN if none has finished an episode.
struct ActorFigures {
  std::int64_t num_episodes = 0;
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double mean_return = 0.0;
  double mean_cost = 0.0;  ///< Sum of an episode's costs.
  double mean_length = 0.0;
};

/// Returns the means over the connected actors of a status.
ActorFigures Summarise(const proto::StatusReply& status);

/// Counts the episodes that actors finish. Each counts once, even if actors, or the replay server
/// that reports them, restart or fall silent. Thread-compatible.
class FinishedEpisodes {
 public:
  /// Returns the number of episodes since the last call. A new name counts from its first report
  /// on, because it is unknown which of its episodes were counted before. A restarted actor counts
  /// from 0.
  std::int64_t Take(const proto::StatusReply& status);

 private:
  std::map<std::string, std::int64_t> seen_;  // By the actor's name.
};

}  // namespace slalom::learner
