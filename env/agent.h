#pragma once

#include <span>
#include <string>

#include "env/action.h"
#include "env/observation.h"

namespace slalom::env {

/// Something that drives: a network, a planner, a person's script.
///
/// Batched: environment i of every call is the same environment, and `observations.first[i]` says
/// when a new episode began in it. Confined to one thread at a time.
class Agent {
 public:
  virtual ~Agent() = default;

  /// Chooses the next action of every environment.
  /// Requires: actions.size() == observations.batch_size.
  virtual void Act(const ObservationBatch& observations, std::span<Action> actions) = 0;

  /// Replaces the choices of the last `Act` by draws from the agent's own distribution, by standard
  /// normal numbers for every environment (linear, angular). False: it has none, and the choices
  /// stand. Requires: noise.size() == actions.size() == the batch size of that `Act`.
  virtual bool Explore(std::span<const Action> /*noise*/, std::span<Action> /*actions*/) {
    return false;
  }

  /// What it was doing in environment `i` at the last `Act`, in a few words without commas, so that
  /// records can tell why an episode failed; empty: nothing to say.
  virtual std::string Status(int /*i*/) const { return {}; }
};

}  // namespace slalom::env
