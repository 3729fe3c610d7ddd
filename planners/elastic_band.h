#pragma once

#include <span>
#include <vector>

#include "base/geometry.h"
#include "planners/costmap.h"
#include "planners/elastic_band_config.h"

namespace slalom::planners {

/// A disc that is free of obstacles.
struct Bubble {
  base::Vec2 p_O;       ///< Centre, [m].
  double radius = 0.0;  ///< [m]
};

/// How far obstacles are, read off a costmap's inflation.
///
/// The distance is that of the robot's inscribed circle: 0 from kInscribedCost on. Immutable.
class BandField {
 public:
  /// `blind`: sees no obstacles.
  BandField(const Costmap& costmap, double costmap_weight, bool blind);

  /// Radius of the bubble at a point, [m]; the largest where nothing is near or the map ends.
  double Clearance(base::Vec2 p_O) const;

 private:
  const Costmap& costmap_;
  const double weight_;
  const bool blind_;
};

/// The elastic band (Quinlan and Khatib 1993) as eband_local_planner has it: a chain of bubbles
/// along a path, which inner forces shorten and outer forces push away from obstacles.
///
/// Bubbles here are points without a heading: in the original, headings come from navfn, whose
/// plans have none. Where an operation fails, the band is as before. Thread-compatible; a value.
class ElasticBand {
 public:
  explicit ElasticBand(const ElasticBandConfig& config) : config_(config) {}

  void Clear() { bubbles_.clear(); }
  /// From the robot to the end; neighbours overlap after `SetPath` and `Optimise`.
  std::span<const Bubble> bubbles() const { return bubbles_; }

  /// Lays the band along a path. False: the path is too short or leads through an obstacle, or a
  /// gap between two bubbles cannot be filled.
  [[nodiscard]] bool SetPath(const BandField& field, std::span<const base::Vec2> path_O);
  /// Lets the band begin at the robot, dropping the bubbles before the last that overlaps the
  /// robot's. False: the robot is in an obstacle, or nothing leads to the band.
  [[nodiscard]] bool BeginAt(const BandField& field, base::Vec2 p_O);
  /// Moves the bubbles by the forces on them, `num_iterations` times there and back along the band.
  /// False: the band leads through an obstacle.
  [[nodiscard]] bool Optimise(const BandField& field);

  /// Force on a bubble in the place of bubble i, across the band: what shortens and what pushes
  /// away, less what would only slide it along. Requires: 0 < i < bubbles().size() - 1.
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
