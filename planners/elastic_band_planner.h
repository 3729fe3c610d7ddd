#pragma once

#include <optional>
#include <span>
#include <vector>

#include "planners/elastic_band.h"
#include "planners/elastic_band_config.h"
#include "planners/local_planner.h"

namespace slalom::planners {

/// The elastic band as a local planner, as eband_local_planner's `EBandPlannerROS` with its
/// controller for differential drives.
///
/// A new path becomes a new band, as far as the map reaches. In each cycle the band is led to the
/// robot and optimised; then the robot turns towards the next bubble, on the spot where it looks
/// too far beside it, and drives the faster the larger its own bubble is. As the original, which
/// then empties the costmap, it drives blind for a cycle where a new path leads through an obstacle
/// of the local map (the global map's may differ). Confined to one thread at a time.
class ElasticBandPlanner : public LocalPlanner {
 public:
  explicit ElasticBandPlanner(const ElasticBandConfig& config);

  void Reset(std::uint64_t seed) override;
  std::optional<Twist> ComputeCommand(const LocalView& view) override;

  const ElasticBand& band() const { return band_; }

 private:
  bool LayBand(const LocalView& view, bool& blind);
  Twist FollowBand(const base::Pose2& X_OR) const;

  const ElasticBandConfig config_;
  ElasticBand band_;
  base::Vec2 end_O_;  // Of the path on the map, that the band was laid along.
  std::vector<base::Vec2> path_O_;
};

}  // namespace slalom::planners
