#pragma once

#include <optional>
#include <vector>

#include "planners/elastic_band/elastic_band.h"
#include "planners/elastic_band/elastic_band_config.h"
#include "planners/navigation/local_planner.h"

namespace slalom::planners {

/// The elastic band as a local planner, as eband_local_planner's `EBandPlannerROS` with its
/// controller for differential drives.
///
/// A new path becomes a new band, as far as the map reaches. In each cycle the band is connected to
/// the robot and optimised. Then the robot turns towards the next bubble (on the spot if the angle
/// is large) and drives the faster, the larger its own bubble is. If a new path leads through an
/// obstacle of the local map, which may differ from the global one, the robot ignores obstacles for
/// one cycle, as the original does by clearing its costmap. Confined to one thread at a time.
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
  base::Vec2 end_O_;  // End of the part of the path that the band was laid along.
  std::vector<base::Vec2> path_O_;
};

}  // namespace slalom::planners
