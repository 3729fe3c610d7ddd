#include "sim/pictures/animation_frames.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "sim/courses/motion.h"
#include "sim/pictures/course_painter.h"

namespace slalom::sim {
namespace {

constexpr Colour kRobot{0.13, 0.39, 0.83};
constexpr Colour kBar{0.84, 0.86, 0.89};
constexpr double kFontSize = 12.0;

struct Destroy {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};
using Surface = std::unique_ptr<cairo_surface_t, Destroy>;
using Context = std::unique_ptr<cairo_t, Destroy>;

Surface MakeSurface(const Animation& animation) {
  Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(animation.width),
                                             static_cast<int>(animation.height)));
  const cairo_status_t status = cairo_surface_status(surface.get());
  base::ThrowIf(status != CAIRO_STATUS_SUCCESS, "the picture cannot be drawn: {}",
                cairo_status_to_string(status));
  return surface;
}

Context MakeContext(cairo_surface_t* surface) {
  Context context(cairo_create(surface));
  cairo_select_font_face(context.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context.get(), kFontSize);
  return context;
}

/// Paints a text around `middle`, smaller if it is wider than `room`.
void PaintText(cairo_t* cairo, const std::string& text, double middle, double y, double room,
               Colour colour) {
  cairo_text_extents_t extents;
  cairo_text_extents(cairo, text.c_str(), &extents);
  const double factor = std::min(1.0, room / std::max(1.0, extents.x_advance));
  cairo_set_font_size(cairo, factor * kFontSize);
  SetColour(cairo, colour);
  cairo_move_to(cairo, middle - 0.5 * factor * extents.x_advance, y);
  cairo_show_text(cairo, text.c_str());
  cairo_new_path(cairo);
  cairo_set_font_size(cairo, kFontSize);
}

}  // namespace

struct AnimationFrames::Impl {
  explicit Impl(const Animation& shown)
      : animation(shown), ground(MakeSurface(shown)), frame(MakeSurface(shown)) {
    const Context context = MakeContext(ground.get());
    cairo_t* cairo = context.get();
    cairo_set_source_rgb(cairo, 1.0, 1.0, 1.0);
    cairo_paint(cairo);
    for (std::size_t i = 0; i < animation.panels.size(); ++i) {
      const AnimationPanel& panel = animation.panels[i];
      const PanelPlace& place = animation.places[i];
      PaintText(cairo, panel.title, place.left + 0.5 * place.width, place.top - 7.0,
                place.width + kPanelMargin, kMuted);
      cairo_save(cairo);
      EnterCourse(cairo, place);
      SetColour(cairo, kFloor);
      cairo_paint(cairo);
      CoursePainter(cairo).PaintFixed(*panel.course);
      cairo_restore(cairo);
    }
    for (const AnimationPanel& panel : animation.panels) {
      motions.emplace_back();
      for (const MovingObstacle& obstacle : panel.course->moving) {
        motions.back().emplace_back(obstacle);
      }
    }
  }

  /// From here on the context draws in the course's frame, inside its panel.
  void EnterCourse(cairo_t* cairo, const PanelPlace& place) const {
    cairo_rectangle(cairo, place.left, place.top, place.width, place.height);
    cairo_clip(cairo);
    cairo_translate(cairo, place.left, place.top + place.height);
    cairo_scale(cairo, animation.scale, -animation.scale);
    cairo_translate(cairo, -place.view.min_W.x, -place.view.min_W.y);
  }

  void PaintScan(cairo_t* cairo, const EpisodeTrack& track, double time) const {
    const auto i = std::min(static_cast<std::size_t>(time / track.step), track.poses.size() - 1);
    const base::Vec2 sensor = base::Transform(track.poses[i], track.beams->p_RS);
    cairo_move_to(cairo, sensor.x, sensor.y);
    for (std::size_t k = 0; k < track.scans_cm[i].size(); ++k) {
      const auto [sin, cos] =
          base::SinCos(track.beams->angle_min + static_cast<double>(k) * track.beams->angle_step);
      const double range = 0.01 * track.scans_cm[i][k];
      const base::Vec2 p =
          base::Transform(track.poses[i], track.beams->p_RS + base::Vec2{range * cos, range * sin});
      cairo_line_to(cairo, p.x, p.y);
    }
    cairo_close_path(cairo);
    SetColour(cairo, kRobot, 0.13);
    cairo_fill(cairo);
  }

  static void PaintDrive(CoursePainter& painter, const EpisodeTrack& track, double time) {
    std::vector<base::Vec2> trail;
    for (std::size_t i = 0; i < track.poses.size(); ++i) {
      if (track.step * static_cast<double>(i) <= time) trail.push_back(track.poses[i].p);
    }
    const base::Pose2 pose = PoseAt(track, time);
    trail.push_back(pose.p);
    painter.PaintTrail(trail, kRobot);
    painter.PaintGuardMarks(track, time, kRobot);
    painter.PaintRobot(pose, time < DurationOf(track) ? kRobot : OutcomeColour(track.outcome));
  }

  /// `time` [s] of the drives.
  void PaintPanel(cairo_t* cairo, std::size_t number, double time) const {
    const AnimationPanel& panel = animation.panels[number];
    const PanelPlace& place = animation.places[number];
    const double end = DurationOf(panel);
    cairo_save(cairo);
    EnterCourse(cairo, place);
    CoursePainter painter(cairo);
    for (const EpisodeTrack& track : panel.tracks) {
      if (!animation.options.shows_scans || !track.beams || time >= DurationOf(track)) continue;
      PaintScan(cairo, track, time);
    }
    for (const EpisodeTrack& track : panel.tracks) PaintDrive(painter, track, time);
    // Above the robots, so that a small one that hits is seen.
    for (std::size_t i = 0; i < panel.course->moving.size(); ++i) {
      const double motion_time = panel.tracks.front().motion_start + std::min(time, end);
      painter.PaintMovingAt(panel.course->moving[i], motions[number][i].At(motion_time).X_WB);
    }
    cairo_restore(cairo);
    if (time < end) return;
    PaintText(cairo, CaptionOf(panel), place.left + 0.5 * place.width,
              place.top + place.height + 15.0, place.width + kPanelMargin,
              panel.tracks.size() == 1 ? OutcomeColour(panel.tracks.front().outcome) : kInk);
  }

  void PaintClock(cairo_t* cairo, double time) const {
    const double top = animation.height - kAnimationFooter + 7.0;
    const double bar = animation.width - 2.0 * kPanelMargin - 90.0;
    const double done =
        animation.drive_time > 0.0 ? std::min(1.0, time / animation.drive_time) : 1.0;
    for (const auto& [colour, length] : {std::pair{kBar, bar}, {kRobot, done * bar}}) {
      cairo_rectangle(cairo, kPanelMargin, top, length, 3.0);
      SetColour(cairo, colour);
      cairo_fill(cairo);
    }
    const double speed = animation.options.speed;
    PaintText(cairo,
              fmt::format("{:.0f} s{}", std::floor(std::min(time, animation.drive_time)),
                          speed == 1.0 ? "" : fmt::format(", {:g} x", speed)),
              animation.width - kPanelMargin - 40.0, top + 6.0, 80.0, kMuted);
  }

  const Animation& animation;
  const Surface ground;  // Everything that stands still.
  const Surface frame;
  std::vector<std::vector<Motion>> motions;  // Motions of the obstacles, panel by panel.
};

AnimationFrames::AnimationFrames(const Animation& animation)
    : impl_(std::make_unique<Impl>(animation)) {}

AnimationFrames::~AnimationFrames() = default;

int AnimationFrames::width() const { return cairo_image_surface_get_width(impl_->frame.get()); }
int AnimationFrames::height() const { return cairo_image_surface_get_height(impl_->frame.get()); }

std::span<const std::byte> AnimationFrames::Draw(double time) {
  const double drive_time = time * impl_->animation.options.speed;
  {
    const Context context = MakeContext(impl_->frame.get());
    cairo_set_source_surface(context.get(), impl_->ground.get(), 0.0, 0.0);
    cairo_paint(context.get());
    for (std::size_t i = 0; i < impl_->animation.panels.size(); ++i) {
      impl_->PaintPanel(context.get(), i, drive_time);
    }
    impl_->PaintClock(context.get(), drive_time);
  }
  cairo_surface_t* surface = impl_->frame.get();
  cairo_surface_flush(surface);
  // Rows of four bytes a pixel lie without a gap.
  SLALOM_CHECK_EQ(cairo_image_surface_get_stride(surface), 4 * width());
  return std::as_bytes(std::span(cairo_image_surface_get_data(surface),
                                 static_cast<std::size_t>(4 * width() * height())));
}

}  // namespace slalom::sim
