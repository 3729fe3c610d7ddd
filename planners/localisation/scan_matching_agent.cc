#include "planners/localisation/scan_matching_agent.h"

#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/check.h"
#include "base/geometry.h"

namespace slalom::planners {

ScanMatchingAgent::ScanMatchingAgent(std::unique_ptr<env::Agent> agent,
                                     const env::ScanGeometry& geometry)
    : agent_(std::move(agent)), geometry_(geometry) {}

void ScanMatchingAgent::Act(const env::ObservationBatch& observations, std::span<float> actions) {
  const auto batch_size = static_cast<std::size_t>(observations.batch_size);
  if (matchers_.size() != batch_size) {
    for (const std::uint8_t first : observations.first) SLALOM_CHECK(first != 0);
    matchers_.clear();
    for (std::size_t i = 0; i < batch_size; ++i) matchers_.emplace_back(geometry_);
  }
  shown_ = observations;
  for (int i = 0; i < observations.batch_size; ++i) {
    if (observations.ended[i] != 0) continue;
    if (observations.first[i] != 0) matchers_[i].Reset();
    const std::span<float> state = shown_.mutable_state(i);
    base::Pose2& pose = shown_.odometry[i].X_OR;
    const base::Vec2 goal_O = base::Transform(pose, {state[0], state[1]});
    pose = matchers_[i].Match(observations.frame(i).ranges_cm, pose);
    const base::Vec2 goal_R = base::InverseTransform(pose, goal_O);
    state[0] = static_cast<float>(goal_R.x);
    state[1] = static_cast<float>(goal_R.y);
  }
  agent_->Act(shown_, actions);
}

}  // namespace slalom::planners
