#pragma once

#include <span>
#include <vector>

#include "base/geometry.h"
#include "planners/elastic_band/elastic_band_config.h"
#include "planners/navigation/costmap.h"

namespace slalom::planners {

/// A disc that is free of obstacles.
struct Bubble {
  base::Vec2 p_O;       ///< Centre, [m].
  double radius = 0.0;  ///< [m]
};

/// The distance to obstacles, derived from a costmap's inflation.
///
/// It is measured from the robot's inscribed circle: 0 for costs of kInscribedCost and above.
/// Immutable.
class BandField {
 public:
  /// `blind`: whether to ignore all obstacles.
  BandField(const Costmap& costmap, double costmap_weight, bool blind);

  /// Returns the radius of the bubble at a point, [m]. It is the maximum if nothing is near, and
  /// off the map.
  double Clearance(base::Vec2 p_O) const;

 private:
  const Costmap& costmap_;
  const double weight_;
  const bool blind_;
};

/// The elastic band (Quinlan and Khatib 1993) as in eband_local_planner: a chain of bubbles along a
/// path. Internal forces shorten it, external forces push it away from obstacles.
///
/// Bubbles have no heading here: in the original, headings come from navfn, whose plans have none.
/// If an operation fails, the band stays unchanged. Thread-compatible; a value.
class ElasticBand {
 public:
  explicit ElasticBand(const ElasticBandConfig& config) : config_(config) {}

  void Clear() { bubbles_.clear(); }
  /// From the robot to the end; neighbours overlap after `SetPath` and `Optimise`.
  std::span<const Bubble> bubbles() const { return bubbles_; }

  /// Lays the band along a path. Returns false if the path is too short or leads through an
  /// obstacle, or if a gap between two bubbles cannot be filled.
  [[nodiscard]] bool SetPath(const BandField& field, std::span<const base::Vec2> path_O);
  /// Makes the band begin at the robot, and drops the bubbles before the last one that overlaps the
  /// robot's. Returns false if the robot is in an obstacle, or cannot be connected to the band.
  [[nodiscard]] bool BeginAt(const BandField& field, base::Vec2 p_O);
  /// Moves the bubbles by the forces on them, `num_iterations` times there and back along the band.
  /// Returns false if the band leads through an obstacle.
  [[nodiscard]] bool Optimise(const BandField& field);

  /// Returns the force on `bubble` in place of bubble i: the sum of internal and external forces
  /// without its component along the band. Requires: 0 < i < bubbles().size() - 1.
  base::Vec2 Force(const BandField& field, std::size_t i, const Bubble& bubble) const;

 private:
  bool Overlap(const Bubble& a, const Bubble& b) const;
  bool Refine(const BandField& field);
  bool RefineBetween(const BandField& field, std::size_t first, std::size_t last,
                     std::vector<Bubble>& out) const;
  bool FillGap(const BandField& field, const Bubble& a, const Bubble& b,
               std::vector<Bubble>& out) const;
  bool Connected(const BandField& field, const Bubble& a, const Bubble& b);
  void Move(const BandField& field, std::size_t i);
  Bubble TowardsEquilibrium(const BandField& field, std::size_t i, base::Vec2 force,
                            base::Vec2 step, Bubble overshot) const;
  bool Significant(base::Vec2 force, base::Vec2 before) const;

  ElasticBandConfig config_;
  std::vector<Bubble> bubbles_;
  std::vector<Bubble> refined_, filled_;  // Scratch.
};

}  // namespace slalom::planners
