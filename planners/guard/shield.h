#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/geometry.h"
#include "env/action.h"
#include "env/observation.h"
#include "env/sensing/obstacle_tracker.h"
#include "env/sensing/scan.h"
#include "planners/guard/drive_model.h"
#include "planners/guard/guard_config.h"
#include "planners/navigation/local_planner.h"

/// Frames: `O` odometry (fixed to the ground), `R` the robot. Shapes: `N` beams.

namespace slalom::planners {

/// A shield (Alshiekh et al. 2018) in front of the drive of one robot: a command passes if the
/// robot can take it for a control step and then brake to a stand, and its outline keeps the margin
/// to every point of the scan all the while, or comes no closer than it is. Another is replaced by
/// the nearest one that passes. What is seen is taken to stand still.
///
/// Where tracks tell that something moves, braking is not always a way out. Then a command passes
/// if the robot can take it for a step and escape: brake, go on, or drive ahead, back or to a side
/// for a while and then brake, and its outline keeps the margin all the while, and longer, to what
/// stands and to what moves on as it does. The margin to the latter grows with the time ahead.
///
/// The robot is predicted from its odometry and from the commands that it was given, as late as
/// they may act, and as early. Confined to one thread at a time. Cost: about 25 us a step, and 300
/// to 550 us where few commands pass (benchmarks/planner_bench.cc); with something that moves
/// nearby 300 us, and some milliseconds where few commands pass (benchmarks/tracking_bench.cc).
/// Where delays vary, each command is predicted twice.
class Shield {
 public:
  /// `bounds`: the commands to choose from. `step`: time for which a command is held, [s].
  Shield(const GuardConfig& config, const RobotModel& robot, const env::ScanGeometry& geometry,
         const env::ActionBounds& bounds, double step);

  /// Begins an episode with a robot at rest, and forgets everything before.
  void Reset();

  /// Takes the newest scan [N] [cm], where the robot was when it was taken and how it moved, and
  /// what moves by that scan. Once for each `Choose`, before it.
  /// Requires: ranges_cm.size() == num_beams.
  void See(std::span<const std::uint16_t> ranges_cm, const env::Odometry& odometry,
           std::span<const env::Track> tracks = {});

  /// A command, and how much room it leaves.
  struct Choice {
    Twist command;
    bool changed = false;    ///< Whether it is another than the one that was asked for.
    double clearance = 0.0;  ///< From the outline to the nearest point, up to the end, [m].
  };

  /// Returns `wanted` if it passes; or else the nearest command that does; or, if none does, the
  /// one with most room. The robot is taken to be given it.
  Choice Choose(Twist wanted);

 private:
  struct Point {
    base::Vec2 p_O;
    int age = 0;  // Control steps in which the robot moved since it was seen.
  };
  struct NearPoint {
    float x, y, distance;  // In C, and from C, [m].
  };
  struct MovingPoint {
    float x, y, vx, vy;  // In C, [m], [m/s].
  };

  Twist CommandAt(int tick, int delay) const;
  void Drive(int begin, int end, int delay, Motion& motion) const;
  double Smoothed(std::span<const std::uint16_t> ranges_cm, int beam, int neighbours) const;
  void LookAround(std::span<const std::uint16_t> ranges_cm, std::span<const env::Track> tracks);
  void AddTrack(std::span<const std::uint16_t> ranges_cm, const env::Track& track, int neighbours);
  float MarginOf(const Twist& command) const;
  Lanes RoomAt(const Motion& motion) const;
  Lanes RoomToMoving(const Motion& motion, int tick) const;
  Lanes RoomAmong(const Motion& motion, int tick) const;
  Lanes RoomOf(const Lanes& linear, const Lanes& angular) const;
  Lanes RoomFrom(Motion motion, int num_ticks, const Lanes& linear, const Lanes& angular) const;
  Lanes RoomOfEscapes(Motion motion, int begin, int num_ticks, const Twist& command,
                      float least) const;
  float RoomToEscape(const Twist& command, float least) const;

  const GuardConfig config_;
  const RobotModel robot_;
  const env::ScanGeometry geometry_;
  const env::ActionBounds bounds_;
  const int step_ticks_, delay_ticks_, least_delay_ticks_, memory_steps_;
  const DriveModel drive_;
  const double tick_;  // [s]
  const int escape_ticks_, horizon_ticks_;
  const float around_;         // Of the circle about C that holds the outline, [m].
  const double reach_, kept_;  // How far from C points matter, and are kept, [m].
  const double cos_view_;      // Of half the field of view.
  const double angle_step_;    // Between beams, [rad].
  const std::vector<base::Vec2> directions_R_;  // [N]
  // Commands to fall back on; the coarse ones where each is checked with all ways to escape.
  const std::vector<Twist> grid_, coarse_grid_;
  Lanes escape_linear_, escape_angular_;  // [m/s], [rad/s]

  base::Pose2 X_OR_;
  bool moves_ = false;
  std::vector<Point> points_;            // Near the robot: those of the scan, and remembered ones.
  std::vector<NearPoint> near_;          // The same, the nearest first.
  std::vector<MovingPoint> moving_;      // Of what moves.
  std::vector<std::uint8_t> is_moving_;  // [N], whether a beam hits what moves.
  std::vector<Twist> sent_;  // Commands that the drive may not act on yet, the newest first.
  Motion now_;               // As the robot moves now, in C.
  // When a new command begins to act: at the latest, and at the earliest where delays vary.
  Motion start_, early_start_;
  float promised_ = 0.0f;                         // Of the last command, less what may go, [m].
  float room_ = 0.0f;                             // The least room until then, [m].
  std::vector<std::pair<float, Twist>> choices_;  // By distance from the command that was wanted.
};

}  // namespace slalom::planners
