#pragma once

#include <span>
#include <string>

#include "env/observation.h"

/// Shapes: `B` environments, `A` numbers of an action (on a course `kActionSize`).

namespace slalom::env {

/// The driver of the robot: a network, a planner or a script.
///
/// An agent drives a batch of environments. Environment i is the same one in every call, and
/// `observations.first[i]` tells when a new episode began in it. Confined to one thread at a time.
class Agent {
 public:
  virtual ~Agent() = default;

  /// Chooses the next action of every environment. actions: [B, A], each number in [-1, 1].
  virtual void Act(const ObservationBatch& observations, std::span<float> actions) = 0;

  /// Replaces the actions of the last `Act` by draws from the agent's own distribution. `noise`
  /// holds standard normal numbers. Returns false and leaves the actions as they are if the agent
  /// has no distribution. noise, actions: [B, A], as in that `Act`.
  virtual bool Explore(std::span<const float> /*noise*/, std::span<float> /*actions*/) {
    return false;
  }

  /// Activity of the agent in environment `i` at the last `Act`, in a few words without commas, so
  /// that records can tell why an episode failed. May be empty.
  virtual std::string Status(int /*i*/) const { return {}; }

  /// Whether the action of environment `i` at the last `Act` was put in the place of one that was
  /// not safe (planners/guard/).
  virtual bool Intervened(int /*i*/) const { return false; }
};

}  // namespace slalom::env
