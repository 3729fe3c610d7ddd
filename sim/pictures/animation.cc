#include "sim/pictures/animation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "sim/courses/motion.h"
#include "sim/pictures/course_painter.h"

namespace slalom::sim {
namespace {

constexpr double kMaxScale = 64.0;        // [pixels/m]
constexpr double kMaxRowHeight = 720.0;   // Largest height of a course, [pixels].
constexpr double kMinScale = 4.0;         // [pixels/m]; below, nothing can be made out.
constexpr double kMaxSide = 8000.0;       // Largest side of the picture, [pixels].
constexpr double kKeyTime = 0.05;         // Time between poses of a motion that are checked, [s].
constexpr double kAnglePerLength = 10.0;  // [rad/m]

void RequirePlayable(const EpisodeTrack& track, const std::string& source) {
  const auto refuse = [&](const char* what) {
    throw base::Error("{}: the episode {} on course {} {}", source, track.episode, track.course,
                      what);
  };
  if (track.poses.empty()) refuse("has no poses, expected at least one");
  if (!(track.step > 0.0)) refuse("has no step_s, expected the time between its poses in seconds");
}

double WidthOf(const Bounds& view) { return view.max_W.x - view.min_W.x; }
double HeightOf(const Bounds& view) { return view.max_W.y - view.min_W.y; }

/// The part of a panel's course that is shown. `around`: as in the options.
Bounds ViewOf(const AnimationPanel& panel, double around) {
  if (!(around > 0.0)) return sim::ViewOf({panel.course.get(), panel.tracks});
  Bounds near{panel.course->goal_W, panel.course->goal_W};
  for (const EpisodeTrack& track : panel.tracks) {
    for (const base::Pose2& pose : track.poses) near = Including(near, Circle{pose.p, 0.0});
  }
  return {near.min_W - base::Vec2{around, around}, near.max_W + base::Vec2{around, around}};
}

/// Panels that stand side by side.
struct Row {
  std::size_t begin = 0;
  std::size_t end = 0;
  double width = 0.0;   ///< Width of their views together, [m].
  double height = 0.0;  ///< Height of the highest, [m].

  /// Width of the space between and beside them, [pixels].
  double margins() const { return static_cast<double>(end - begin + 1) * kPanelMargin; }
};

std::vector<Row> MakeRows(const std::vector<PanelPlace>& places, std::size_t num_columns) {
  std::vector<Row> rows;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i % num_columns == 0) rows.push_back({.begin = i, .end = i});
    Row& row = rows.back();
    row.end = i + 1;
    row.width += WidthOf(places[i].view);
    row.height = std::max(row.height, HeightOf(places[i].view));
  }
  return rows;
}

double EvenlyUp(double pixels) { return 2.0 * std::ceil(0.5 * pixels - 1e-9); }

base::Pose2 Between(const base::Pose2& a, const base::Pose2& b, double fraction) {
  return {a.p + fraction * (b.p - a.p), a.yaw + fraction * (b.yaw - a.yaw)};
}

/// How far the pose is from the way between two keys, [m].
double Deviation(const PoseKey& first, const PoseKey& last, const PoseKey& key) {
  const double span = last.time - first.time;
  const double fraction = span > 0.0 ? (key.time - first.time) / span : 0.0;
  const base::Pose2 even = Between(first.pose, last.pose, fraction);
  return std::max(base::Norm(key.pose.p - even.p),
                  std::abs(key.pose.yaw - even.yaw) / kAnglePerLength);
}

/// Appends the needed ones of keys[first + 1] ... keys[last], if keys[first] is there already.
void AppendNeeded(const std::vector<PoseKey>& keys, std::size_t first, std::size_t last,
                  double tolerance, std::vector<PoseKey>& needed) {
  std::size_t worst = first;
  double largest = tolerance;
  for (std::size_t i = first + 1; i < last; ++i) {
    const double deviation = Deviation(keys[first], keys[last], keys[i]);
    if (deviation <= largest) continue;
    largest = deviation;
    worst = i;
  }
  if (worst != first) {
    AppendNeeded(keys, first, worst, tolerance, needed);
    AppendNeeded(keys, worst, last, tolerance, needed);
  } else if (last != first) {
    needed.push_back(keys[last]);
  }
}

/// Appends the keys that are needed of a stretch without a jump.
void AppendThinned(const std::vector<PoseKey>& keys, double tolerance,
                   std::vector<PoseKey>& needed) {
  needed.push_back(keys.front());
  AppendNeeded(keys, 0, keys.size() - 1, tolerance, needed);
}

}  // namespace

std::vector<AnimationPanel> MakePanels(const CourseSet& set, std::vector<EpisodeTrack> tracks,
                                       const std::string& source) {
  std::vector<AnimationPanel> panels;
  for (const auto& course : set.courses) {
    const std::size_t first = panels.size();
    for (EpisodeTrack& track : tracks) {
      if (track.course != course->name) continue;
      RequirePlayable(track, source);
      const auto fits = [&](const AnimationPanel& panel) {
        return course->moving.empty() || panel.tracks.front().motion_start == track.motion_start;
      };
      const auto panel =
          std::find_if(panels.begin() + static_cast<std::ptrdiff_t>(first), panels.end(), fits);
      if (panel != panels.end()) {
        panel->tracks.push_back(std::move(track));
      } else {
        panels.push_back({course, course->name, {std::move(track)}});
      }
    }
    for (std::size_t i = first; i < panels.size() && panels.size() > first + 1; ++i) {
      panels[i].title += fmt::format(", episode {}", panels[i].tracks.front().episode);
    }
  }
  base::ThrowIf(panels.empty(), "{}: holds no episode on a course of {}", source, set.name);
  return panels;
}

Animation PlaceAnimation(std::vector<AnimationPanel> panels, const AnimationOptions& options) {
  SLALOM_CHECK(!panels.empty());
  SLALOM_CHECK_GE(options.num_columns, 1);
  SLALOM_CHECK(options.width > 0.0 && options.speed > 0.0 && options.hold >= 0.0 &&
               options.around >= 0.0);
  Animation animation{options, std::move(panels), {}};
  for (const AnimationPanel& panel : animation.panels) {
    animation.places.push_back({.view = ViewOf(panel, options.around)});
    animation.drive_time = std::max(animation.drive_time, DurationOf(panel));
  }
  const std::vector<Row> rows =
      MakeRows(animation.places, static_cast<std::size_t>(options.num_columns));
  double scale = kMaxScale;
  for (const Row& row : rows) {
    scale =
        std::min({scale, kMaxRowHeight / row.height, (options.width - row.margins()) / row.width});
  }
  scale = std::max(kMinScale, scale);
  constexpr double kMinWidth = 160.0;  // Clock and bar have room.
  double width = kMinWidth;
  for (const Row& row : rows) width = std::max(width, scale * row.width + row.margins());
  double top = 0.5 * kPanelMargin;
  for (const Row& row : rows) {
    double left = 0.5 * (width - scale * row.width - row.margins()) + kPanelMargin;
    for (std::size_t i = row.begin; i < row.end; ++i) {
      PanelPlace& place = animation.places[i];
      place.width = scale * WidthOf(place.view);
      place.height = scale * HeightOf(place.view);
      place.left = left;
      place.top = top + kPanelTitleHeight + scale * row.height - place.height;
      left += place.width + kPanelMargin;
    }
    top += kPanelTitleHeight + scale * row.height + kPanelCaptionHeight + 0.5 * kPanelMargin;
  }
  animation.scale = scale;
  animation.width = EvenlyUp(width);
  animation.height = EvenlyUp(top + 0.5 * kPanelMargin + kAnimationFooter);
  base::ThrowIf(
      animation.width > kMaxSide || animation.height > kMaxSide,
      "{} pictures would make one of {:.0f} x {:.0f} pixels, expected at most {:.0f} each way; "
      "choose fewer with --course, or more --columns",
      animation.panels.size(), animation.width, animation.height, kMaxSide);
  return animation;
}

double DurationOf(const EpisodeTrack& track) {
  return track.step * static_cast<double>(track.poses.size() - 1);
}

double DurationOf(const AnimationPanel& panel) {
  double duration = 0.0;
  for (const EpisodeTrack& track : panel.tracks) duration = std::max(duration, DurationOf(track));
  return duration;
}

base::Pose2 PoseAt(const EpisodeTrack& track, double time) {
  const double steps = time / track.step;
  const auto before = static_cast<std::size_t>(steps);
  if (before + 1 >= track.poses.size()) return track.poses.back();
  const base::Pose2& a = track.poses[before];
  base::Pose2 b = track.poses[before + 1];
  b.yaw = a.yaw + base::WrapAngle(b.yaw - a.yaw);
  return Between(a, b, steps - static_cast<double>(before));
}

std::string CaptionOf(const AnimationPanel& panel) {
  const bool is_guarded = std::ranges::any_of(
      panel.tracks, [](const EpisodeTrack& track) { return !track.interventions.empty(); });
  const char* const marks = is_guarded ? "; rings: guard" : "";
  if (panel.tracks.size() == 1) {
    const EpisodeTrack& track = panel.tracks.front();
    return fmt::format("{} {:.1f} s{}", ToString(track.outcome), DurationOf(track), marks);
  }
  std::string caption;
  for (const env::Outcome outcome : {env::Outcome::kSuccess, env::Outcome::kCollision,
                                     env::Outcome::kTimeout, env::Outcome::kRunning}) {
    const auto count =
        std::count_if(panel.tracks.begin(), panel.tracks.end(),
                      [outcome](const EpisodeTrack& t) { return t.outcome == outcome; });
    if (count == 0) continue;
    caption += fmt::format("{}{} {}", caption.empty() ? "" : ", ", count, ToString(outcome));
  }
  return caption + marks;
}

std::vector<PoseKey> KeysOf(const EpisodeTrack& track, double tolerance) {
  std::vector<PoseKey> keys;
  double yaw = track.poses.front().yaw;
  for (const base::Pose2& pose : track.poses) {
    yaw += base::WrapAngle(pose.yaw - yaw);
    keys.push_back({track.step * static_cast<double>(keys.size()), {pose.p, yaw}});
  }
  std::vector<PoseKey> needed;
  AppendThinned(keys, tolerance, needed);
  return needed;
}

std::vector<PoseKey> KeysOf(const MovingObstacle& obstacle, double begin, double duration,
                            double tolerance) {
  const Motion motion(obstacle);
  const bool jumps = obstacle.playback == Playback::kLoop;
  std::vector<PoseKey> needed;
  double time = 0.0;
  while (true) {
    // The end of this round: at a jump, or with the picture.
    const double round_end =
        (std::floor((begin + time) / motion.period() + 1e-9) + 1.0) * motion.period() - begin;
    const double end = jumps ? std::min(duration, round_end) : duration;
    const int num_steps = std::max(1, static_cast<int>(std::ceil((end - time) / kKeyTime)));
    std::vector<PoseKey> keys;
    for (int i = 0; i <= num_steps; ++i) {
      const double at = time + (end - time) * i / num_steps;
      // The last pose of a round is the one before the jump.
      const double inside = i == num_steps ? -1e-9 : i == 0 ? 1e-9 : 0.0;
      keys.push_back({at, motion.At(std::max(0.0, begin + at + inside)).X_WB});
    }
    AppendThinned(keys, tolerance, needed);
    if (end >= duration) return needed;
    time = end;
  }
}

}  // namespace slalom::sim
