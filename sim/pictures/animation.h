#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/geometry.h"
#include "sim/courses/course.h"
#include "sim/courses/episode_file.h"

/// Recorded drives as moving pictures: the contents of each picture, their places and times.
/// sim/pictures/animation_svg.h and sim/pictures/animation_frames.h draw it.

namespace slalom::sim {

/// How drives are shown.
struct AnimationOptions {
  int num_columns = 6;   ///< Panels side by side.
  double around = 0.0;   ///< Shows only the part this near to a drive, [m]; 0 shows whole courses.
  double width = 960.0;  ///< Largest width of the picture, [pixels].
  double speed = 1.0;    ///< Speed of the playback relative to the drive.
  double hold = 2.5;     ///< Time for which the end is shown before the next round, [s].
  bool shows_scans = false;  ///< Whether to show the scans of tracks that hold them.
};

/// One course with the drives that are shown on it, all beginning at once.
struct AnimationPanel {
  std::shared_ptr<const Course> course;
  std::string title;
  std::vector<EpisodeTrack> tracks;  ///< At least one; all with the same `motion_start`.
};

/// The tracks sorted to the courses that they were driven on, in the order of `set`. Courses
/// without a track are left out. Drives that met the moving obstacles of a course at different
/// times get a panel each, as an obstacle can be at one place only.
///
/// Throws `Error` that names `source` if no track is on a course of the set, or if a track cannot
/// be played because it has no pose or no time step.
std::vector<AnimationPanel> MakePanels(const CourseSet& set, std::vector<EpisodeTrack> tracks,
                                       const std::string& source);

/// Place of a panel's course on the picture, [pixels] from the top left corner.
struct PanelPlace {
  Bounds view;  ///< The part of the course that is shown, [m].
  double left = 0.0;
  double top = 0.0;
  double width = 0.0;
  double height = 0.0;
};

/// Panels with a place on a page and a time. A value.
struct Animation {
  AnimationOptions options;
  std::vector<AnimationPanel> panels;
  std::vector<PanelPlace> places;  ///< One for each panel.
  double width = 0.0;              ///< Width of the picture, even, [pixels].
  double height = 0.0;             ///< Height of the picture, even, [pixels].
  double scale = 0.0;              ///< [pixels/m]
  double drive_time = 0.0;         ///< Duration of the longest drive, as driven, [s].

  /// Time of one round as shown, [s].
  double loop_time() const { return drive_time / options.speed + options.hold; }
};

// Lengths on the page, [pixels].
inline constexpr double kPanelMargin = 14.0;
inline constexpr double kPanelTitleHeight = 20.0;    ///< Above a course.
inline constexpr double kPanelCaptionHeight = 20.0;  ///< Below it.
inline constexpr double kAnimationFooter = 22.0;     ///< Clock and bar.

/// Places the panels row by row, all at one scale. Throws `Error` if the picture would be too large
/// to be drawn. Requires: at least one panel, num_columns >= 1, width > 0, speed > 0, hold >= 0,
/// around >= 0.
Animation PlaceAnimation(std::vector<AnimationPanel> panels, const AnimationOptions& options);

/// Time from the first pose to the last, [s].
double DurationOf(const EpisodeTrack& track);

/// The time of the longest drive of the panel, [s].
double DurationOf(const AnimationPanel& panel);

/// Pose of the robot `time` [s] after the first pose. Interpolates evenly between two poses, the
/// shorter way round in heading, and stays at the last pose after the end. Requires: time >= 0.
base::Pose2 PoseAt(const EpisodeTrack& track, double time);

/// Text below a panel at its end: "success 7.4 s", or the number of drives by outcome.
std::string CaptionOf(const AnimationPanel& panel);

/// A pose at a time, [s].
struct PoseKey {
  double time = 0.0;
  base::Pose2 pose;  ///< The heading goes on beyond pi.
};

/// Reduces the drive to a few poses. The robot that moves evenly between them is nowhere farther
/// than `tolerance` [m] from its recorded place, and its heading differs by at most `tolerance` x
/// 10 rad/m.
std::vector<PoseKey> KeysOf(const EpisodeTrack& track, double tolerance);

/// Does the same for a moving obstacle from motion time `begin` on for `duration`, both [s]. The
/// first key is at time 0. A jump of the obstacle makes two keys of one time.
std::vector<PoseKey> KeysOf(const MovingObstacle& obstacle, double begin, double duration,
                            double tolerance);

}  // namespace slalom::sim
