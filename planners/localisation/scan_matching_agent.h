#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "env/agent.h"
#include "planners/localisation/scan_matcher.h"

namespace slalom::planners {

/// Drives as another agent does that knows where it is: odometry and goal are shown to it as a
/// `ScanMatcher` has corrected them. Confined to one thread at a time. Allocates when the batch
/// size changes.
class ScanMatchingAgent : public env::Agent {
 public:
  ScanMatchingAgent(std::unique_ptr<env::Agent> agent, const env::ScanGeometry& geometry);

  /// Requires: observations.num_beams == geometry.num_beams; in the first call, and in a call with
  /// another batch size, first[i] is set for all i.
  void Act(const env::ObservationBatch& observations, std::span<float> actions) override;

  bool Explore(std::span<const float> noise, std::span<float> actions) override {
    return agent_->Explore(noise, actions);
  }
  std::string Status(int i) const override { return agent_->Status(i); }
  bool Intervened(int i) const override { return agent_->Intervened(i); }

  /// What the agent was shown in the last `Act`.
  const env::ObservationBatch& shown() const { return shown_; }

 private:
  const std::unique_ptr<env::Agent> agent_;
  const env::ScanGeometry geometry_;
  std::vector<ScanMatcher> matchers_;  // [B]
  env::ObservationBatch shown_;
};

}  // namespace slalom::planners
