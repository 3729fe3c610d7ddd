#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/geometry.h"
#include "env/sensing/scan.h"
#include "env/state_layout.h"

/// Frames: `O` odometry (fixed to the ground), `R` the robot. Shapes: `N` beams.

namespace slalom::env {

/// A moving obstacle as a tracker knows it. A value.
struct Track {
  base::Vec2 p_O;       ///< Its middle, [m].
  base::Vec2 v_O;       ///< Its velocity, [m/s].
  double radius = 0.0;  ///< Half of its width, as far as it was seen, [m].
  int first_beam = 0;   ///< The beams [first_beam, end_beam) of the last scan hit it; none if it
  int end_beam = 0;     ///< was hidden.

  friend bool operator==(const Track&, const Track&) = default;
};

/// Tells what moves, and how, from the scans of a robot that knows how it moves itself.
///
/// A scan is cut into convex pieces. Each is followed from scan to scan by a Kalman filter of its
/// place at a constant velocity. What is measured is not the middle of what is seen, which wanders
/// as other sides come into view, but how far the piece reaches in each of 16 directions (its
/// support function): in the directions that face the sensor, a convex body that is not hidden
/// shows it exactly, whatever its shape. How far the body reaches from its place is learned beside.
/// An end of a piece that is hidden by something nearer, or beyond the range, says nothing.
///
/// A body moves if its velocity is sure to be more than 0.2 m/s and, besides, scans of the last
/// seconds saw through places where it is now, or this scan through places where it was. What is
/// only cut differently as the robot passes does neither.
///
/// A track that is hidden goes on for less than a second. Bodies are taken not to turn.
///
/// Confined to one thread at a time. Allocates nothing after the first scans. Cost: 30 to 90 us a
/// scan (benchmarks/tracking_bench.cc).
class ObstacleTracker {
 public:
  /// `step`: time between scans, [s].
  ObstacleTracker(const ScanGeometry& geometry, double step);

  /// Forgets everything.
  void Reset();

  /// Takes the next scan `ranges_cm` [N] [cm] and the pose at which it was taken.
  /// Requires: ranges_cm.size() == num_beams.
  void Update(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR);

  /// What moves, the nearest first.
  std::span<const Track> tracks() const { return tracks_; }

  /// The field "tracked obstacle" of a state: place [m] and velocity over the ground [m/s] of each
  /// of the nearest, in the frame of a robot at `X_OR`.
  std::array<double, 4 * kObservedObstacles> Observe(const base::Pose2& X_OR) const;

 private:
  static constexpr int kDirections = 16;
  static constexpr int kNumSamples = 5;  // Points of a piece that are looked at closely.
  static constexpr int kNumScans = 8;    // That are remembered.

  using Samples = std::array<base::Vec2, kNumSamples>;

  /// A scan and where it was taken.
  struct Scan {
    base::Pose2 X_OR;
    std::vector<std::uint16_t> ranges_cm;  // [N]
  };

  /// Points [begin, end) of a scan that seem to belong together.
  struct Piece {
    int begin = 0, end = 0;
    bool shows_begin = false, shows_end = false;  // Whether its body ends there.
    base::Vec2 middle_O{}, first_O{}, last_O{};
  };

  /// How far a body reaches from its place in a direction, as the mean over so many scans.
  struct Reach {
    double distance = 0.0;  // [m]
    int num_scans = 0;      // 0: not known.
  };

  struct Body {
    Eigen::Vector4d state;  // x, y, vx, vy in O, [m], [m/s].
    Eigen::Matrix4d covariance;
    std::array<base::Vec2, kDirections> directions;
    std::array<Reach, kDirections> reaches;
    base::Vec2 middle, first, last;  // Of the piece that showed it last, from its place, [m].
    int first_beam = 0, end_beam = 0;
    std::array<Samples, kNumScans> samples_O;  // Of the last pieces.
    int num_scans = 0, num_missed = 0;         // That showed it; since then.
    double freedom = 0.0;  // Share of samples where nothing was before, or is now; smoothed.
    int num_doubts = 0;    // Scans since it last seemed to move.
    bool moves = false;
  };

  struct Match {
    double distance = 0.0;  // [m]
    int body = 0, piece = 0;
  };

  void ReadScan(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR);
  void FindPieces();
  void AddConvexPieces(int begin, int end);
  bool ShowsEnd(int point, int step) const;
  void Predict(Body& body) const;
  void FindMatches();
  void Begin(const Piece& piece);
  void Correct(const Piece& piece, Body& body) const;
  void JudgeMotion(const Piece& piece, Body& body) const;
  bool SeesThrough(const Scan& scan, base::Vec2 p_O) const;
  static Track TrackOf(const Body& body);

  const ScanGeometry geometry_;
  const double step_, angle_step_;  // [s], [rad].
  const ScanProjector projector_;

  Scan now_;
  ScanRays rays_;                     // Of the scan.
  std::vector<base::Vec2> points_O_;  // Of the scan, those with an echo,
  std::vector<int> beams_;            // and their beams.
  std::vector<Piece> pieces_;
  std::vector<std::pair<int, int>> spans_;  // Of points, to be cut.
  std::vector<Match> matches_;              // The best first.
  std::vector<std::uint8_t> is_taken_;      // Of each piece.
  std::array<Scan, kNumScans> scans_;       // Before this one, by their number.
  int num_scans_ = 0;                       // Before this one.
  std::vector<Body> bodies_;
  std::vector<Track> tracks_;
};

}  // namespace slalom::env
