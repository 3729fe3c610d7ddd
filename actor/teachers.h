#pragma once

#include <span>

#include "env/observation.h"

/// Shapes: `B` environments, `A` numbers of an action.

namespace slalom::actor {

/// Agents that tell what they would do while another one, their student, drives. Confined to one
/// thread at a time.
class Teachers {
 public:
  virtual ~Teachers() = default;

  /// Writes the action that the teacher of each environment's course would take. It is called for
  /// every frame, as `env::Agent::Act` is, so that teachers may remember.
  /// courses: [B], numbers of courses (`env::EpisodeSpec`); actions: [B, A], each in [-1, 1].
  virtual void Act(const env::ObservationBatch& observations, std::span<const int> courses,
                   std::span<float> actions) = 0;
};

}  // namespace slalom::actor
