#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "planners/navigation/local_planner.h"
#include "planners/teb/banded_system.h"
#include "planners/teb/teb_config.h"
#include "planners/teb/timed_band.h"

namespace slalom::planners {

/// The obstacles, via-points and start velocity that shape a band, besides the robot's limits.
struct BandSurroundings {
  std::span<const base::Vec2> obstacles_O;   ///< Points to keep away from, [m].
  std::span<const base::Vec2> via_points_O;  ///< Points to come near to, [m].
  Twist start_velocity;  ///< Velocity of the robot at the start; at the band's end it stands still.
};

/// The cost by which bands are compared.
struct BandCost {
  double obstacles = 0.0;
  double rest = 0.0;

  double total() const { return obstacles + rest; }
};

/// Finds the band of least cost near a given one by Levenberg-Marquardt on TEB's edges, resizing
/// the band every few steps (Roesmann et al. 2012, 2013). The ends stay fixed.
///
/// Confined to one thread at a time. Cost: 0.6 ms for 20 steps on 15 poses among 300 obstacle
/// points.
class BandOptimizer {
 public:
  /// `config` must outlive this object.
  explicit BandOptimizer(const TebConfig& config) : config_(config) {}

  /// Optimises in place. Returns false if the problem has no finite solution; discard the band
  /// then.
  [[nodiscard]] bool Optimize(const BandSurroundings& surroundings, TimedBand& band);

  /// Returns the cost of the band as it is, with obstacles at their initial weight.
  BandCost Cost(const BandSurroundings& surroundings, const TimedBand& band);

 private:
  /// An obstacle that acts on a pose.
  struct Contact {
    int pose;
    base::Vec2 p_O;
  };

  void FindContacts(const BandSurroundings& surroundings, const TimedBand& band);
  void FindViaContacts(const BandSurroundings& surroundings, const TimedBand& band);
  bool DescendFrom(const BandSurroundings& surroundings, double obstacle_weight, TimedBand& band);
  BandCost Sum(const BandSurroundings& surroundings, double obstacle_weight, const TimedBand& band,
               BandedSystem* system) const;

  const TebConfig& config_;
  std::vector<Contact> contacts_;
  std::vector<Contact> via_contacts_;
  BandedSystem system_;
  Eigen::VectorXd step_;
  TimedBand tried_;
};

}  // namespace slalom::planners
