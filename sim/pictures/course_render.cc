#include "sim/pictures/course_render.h"

#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "sim/pictures/course_painter.h"
#include "sim/pictures/guard_marks.h"

namespace slalom::sim {
namespace {

// Lengths on the page in pixels (PNG) or points (SVG).
constexpr double kMargin = 16.0;
constexpr double kTitleHeight = 24.0;
constexpr double kLegendRow = 20.0;
constexpr double kFontSize = 12.0;
constexpr double kMaxSide = 20000.0;
constexpr double kPageScale = 64.0;   // Per metre, for one course;
constexpr double kPageSide = 2000.0;  // less if the larger side would exceed this.
constexpr double kSheetScale = 22.0;  // Per metre, for a contact sheet.
constexpr double kSheetSide = 480.0;
constexpr double kMinScale = 4.0;  // Per metre. A smaller picture shows nothing.

struct Size {
  double width = 0.0;
  double height = 0.0;
};

/// A cairo context that writes one picture into a string.
class Page {
 public:
  Page(Size size, PictureFormat format) : format_(format) {
    base::ThrowIf(!(size.width <= kMaxSide && size.height <= kMaxSide),
                  "the picture would have {:.0f} x {:.0f} pixels; expected at most {:.0f} in each "
                  "direction",
                  size.width, size.height, kMaxSide);
    surface_.reset(
        format == PictureFormat::kSvg
            ? cairo_svg_surface_create_for_stream(Append, &bytes_, size.width, size.height)
            : cairo_image_surface_create(CAIRO_FORMAT_RGB24,
                                         static_cast<int>(std::lround(size.width)),
                                         static_cast<int>(std::lround(size.height))));
    context_.reset(cairo_create(surface_.get()));
    cairo_set_source_rgb(cairo(), 1.0, 1.0, 1.0);
    cairo_paint(cairo());
    cairo_select_font_face(cairo(), "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo(), kFontSize);
  }

  cairo_t* cairo() { return context_.get(); }

  void Text(double x, double y, const std::string& text, Colour colour = kInk) {
    SetColour(cairo(), colour);
    cairo_move_to(cairo(), x, y);
    cairo_show_text(cairo(), text.c_str());
    cairo_new_path(cairo());
  }

  /// Returns the bytes of the picture. Nothing can be drawn afterwards.
  std::string Finish() {
    const cairo_status_t drawn = cairo_status(cairo());
    context_.reset();
    if (format_ == PictureFormat::kPng) {
      cairo_surface_write_to_png_stream(surface_.get(), Append, &bytes_);
    }
    cairo_surface_finish(surface_.get());
    const cairo_status_t written = cairo_surface_status(surface_.get());
    const cairo_status_t status = drawn != CAIRO_STATUS_SUCCESS ? drawn : written;
    base::ThrowIf(status != CAIRO_STATUS_SUCCESS, "the picture cannot be drawn: {}",
                  cairo_status_to_string(status));
    return std::move(bytes_);
  }

 private:
  static cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int size) {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), size);
    return CAIRO_STATUS_SUCCESS;
  }

  struct Destroy {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* context) const { cairo_destroy(context); }
  };

  const PictureFormat format_;
  std::string bytes_;
  std::unique_ptr<cairo_surface_t, Destroy> surface_;
  std::unique_ptr<cairo_t, Destroy> context_;
};

Size SizeOf(const Bounds& view, double scale) {
  return {scale * (view.max_W.x - view.min_W.x), scale * (view.max_W.y - view.min_W.y)};
}

/// The larger side of a view, [m].
double SideOf(const Bounds& view) {
  return std::max(view.max_W.x - view.min_W.x, view.max_W.y - view.min_W.y);
}

/// `scale`, or less if a view of this side would exceed `max_side` on the page.
double ScaleFor(double side, double scale, double max_side) {
  return std::max(kMinScale, std::min(scale, max_side / side));
}

/// Draws the scene with its top left corner at (left, top) of the page.
void PaintScene(Page& page, const CourseScene& scene, const Bounds& view, double left, double top,
                double scale) {
  cairo_t* cairo = page.cairo();
  const Size size = SizeOf(view, scale);
  cairo_save(cairo);
  cairo_rectangle(cairo, left, top, size.width, size.height);
  cairo_clip(cairo);
  cairo_translate(cairo, left, top + size.height);
  cairo_scale(cairo, scale, -scale);
  cairo_translate(cairo, -view.min_W.x, -view.min_W.y);
  CoursePainter painter(cairo);
  painter.PaintCourse(*scene.course);
  painter.PaintStart(scene.course->start);
  for (const EpisodeTrack& track : scene.tracks) painter.PaintTrack(track);
  cairo_restore(cairo);
}

/// An entry of the scenes' legend.
struct LegendEntry {
  std::string text;
  std::function<void(CoursePainter&, base::Vec2)>
      paint;  // The symbol, centred on a point of the page.
};

std::vector<LegendEntry> LegendOf(std::span<const CourseScene> scenes) {
  std::vector<LegendEntry> entries = {
      {"goal, reached within 0.4 m",
       [](CoursePainter& painter, base::Vec2 p) { painter.PaintGoal(p, 7.0); }},
      {"reference path", [](CoursePainter& painter, base::Vec2 p) {
         painter.PaintDashes(std::array<base::Vec2, 2>{{{p.x - 9.0, p.y}, {p.x + 9.0, p.y}}}, 2.2);
       }}};
  const bool has_moving = std::any_of(scenes.begin(), scenes.end(), [](const CourseScene& scene) {
    return !scene.course->moving.empty();
  });
  if (has_moving) {
    entries.push_back({"moving, outline each second", [](CoursePainter& painter, base::Vec2 p) {
                         painter.PaintMovingSymbol(p, 9.0);
                       }});
  }
  std::size_t num_drives = 0;
  for (const CourseScene& scene : scenes) num_drives += scene.tracks.size();
  for (const env::Outcome outcome : {env::Outcome::kSuccess, env::Outcome::kCollision,
                                     env::Outcome::kTimeout, env::Outcome::kRunning}) {
    std::ptrdiff_t count = 0;
    for (const CourseScene& scene : scenes) {
      count += std::count_if(scene.tracks.begin(), scene.tracks.end(),
                             [outcome](const EpisodeTrack& t) { return t.outcome == outcome; });
    }
    if (count == 0) continue;
    entries.push_back(
        {fmt::format("{} ({} of {} drives shown)", ToString(outcome), count, num_drives),
         [outcome](CoursePainter& painter, base::Vec2 p) {
           painter.PaintEndMark(p, 5.0, outcome);
         }});
  }
  const bool is_guarded = std::ranges::any_of(scenes, [](const CourseScene& scene) {
    return std::ranges::any_of(
        scene.tracks, [](const EpisodeTrack& track) { return !track.interventions.empty(); });
  });
  if (is_guarded) {
    entries.push_back({std::string(kGuardMarksMeaning), [](CoursePainter& painter, base::Vec2 p) {
                         painter.PaintGuardMark(p, 4.0, kInk);
                       }});
  }
  return entries;
}

void PaintEntry(Page& page, const LegendEntry& entry, double left, double middle) {
  CoursePainter painter(page.cairo());
  entry.paint(painter, {left + 9.0, middle});
  page.Text(left + 26.0, middle + 0.35 * kFontSize, entry.text);
}

/// A bar of 1, 2, 5, 10, ... metres, long enough to be seen.
void PaintScaleBar(Page& page, double left, double y, double scale) {
  constexpr double kMinLength = 20.0;
  constexpr std::array kMetres = {1, 2, 5, 10, 20};
  int metres = kMetres.front();
  for (const int candidate : kMetres) {
    if (scale * metres < kMinLength) metres = candidate;
  }
  const double length = scale * metres;
  cairo_t* cairo = page.cairo();
  for (const double x : {left, left + length}) {
    cairo_move_to(cairo, x, y - 4.0);
    cairo_line_to(cairo, x, y + 4.0);
  }
  cairo_move_to(cairo, left, y);
  cairo_line_to(cairo, left + length, y);
  SetColour(cairo, kInk);
  cairo_set_line_width(cairo, 1.5);
  cairo_stroke(cairo);
  page.Text(left + length + 8.0, y + 0.35 * kFontSize, fmt::format("{} m", metres));
}

std::vector<std::string> FactsOf(const Course& course) {
  std::vector<std::string> facts = {
      fmt::format("{} obstacles", course.circles.size() + course.boxes.size()),
      fmt::format("path {:.2f} m", ReferenceLength(course))};
  if (!course.moving.empty()) {
    facts.front() = fmt::format("{} fixed obstacles, {} moving",
                                course.circles.size() + course.boxes.size(), course.moving.size());
  }
  if (course.difficulty) {
    const Difficulty& d = *course.difficulty;
    facts.emplace_back("difficulty [cells]");
    facts.push_back(fmt::format("  to obstacle {:.2f}", d.distance_to_obstacle));
    facts.push_back(fmt::format("  visibility {:.2f}", d.visibility));
    facts.push_back(fmt::format("  dispersion {:.2f}", d.dispersion));
    facts.push_back(fmt::format("  width {:.2f}", d.characteristic_dimension));
    facts.push_back(fmt::format("  tortuosity {:.3f}", d.tortuosity));
  }
  return facts;
}

}  // namespace

std::string RenderCourse(const CourseScene& scene, PictureFormat format) {
  SLALOM_CHECK(scene.course != nullptr);
  constexpr double kPanelWidth = 220.0;
  const Bounds view = ViewOf(scene);
  const double scale = ScaleFor(SideOf(view), kPageScale, kPageSide);
  const Size size = SizeOf(view, scale);
  const double height = std::max(size.height, 18.0 * kLegendRow);
  Page page({size.width + kPanelWidth + 3.0 * kMargin, height + kTitleHeight + 2.0 * kMargin},
            format);
  cairo_set_font_size(page.cairo(), 1.25 * kFontSize);
  page.Text(kMargin, kMargin + 0.5 * kTitleHeight, scene.course->name);
  cairo_set_font_size(page.cairo(), kFontSize);
  const double top = kMargin + kTitleHeight;
  PaintScene(page, scene, view, kMargin, top, scale);

  const double panel = size.width + 2.0 * kMargin;
  double middle = top + 0.5 * kLegendRow;
  for (const LegendEntry& entry : LegendOf(std::span(&scene, 1))) {
    PaintEntry(page, entry, panel, middle);
    middle += kLegendRow;
  }
  middle += 0.5 * kLegendRow;
  for (const std::string& fact : FactsOf(*scene.course)) {
    page.Text(panel, middle + 0.35 * kFontSize, fact, kMuted);
    middle += 0.85 * kLegendRow;
  }
  PaintScaleBar(page, panel, top + height - 8.0, scale);
  return page.Finish();
}

std::string RenderContactSheet(std::span<const CourseScene> scenes, int num_columns,
                               PictureFormat format) {
  SLALOM_CHECK(!scenes.empty());
  SLALOM_CHECK_GE(num_columns, 1);
  double largest = 0.0;
  for (const CourseScene& scene : scenes) largest = std::max(largest, SideOf(ViewOf(scene)));
  const double scale = ScaleFor(largest, kSheetScale, kSheetSide);
  Size cell;
  for (const CourseScene& scene : scenes) {
    const Size size = SizeOf(ViewOf(scene), scale);
    cell = {std::max(cell.width, size.width), std::max(cell.height, size.height)};
  }
  const auto columns = std::min(scenes.size(), static_cast<std::size_t>(num_columns));
  const std::size_t rows = (scenes.size() + columns - 1) / columns;
  const double cell_pitch = cell.width + kMargin;
  const double row_pitch = cell.height + kTitleHeight + 0.5 * kMargin;
  const std::vector<LegendEntry> legend = LegendOf(scenes);
  constexpr double kEntryWidth = 210.0;
  const double width =
      std::max(static_cast<double>(columns) * cell_pitch + kMargin, kEntryWidth + 2.0 * kMargin);
  const auto per_row =
      std::max<std::size_t>(1, static_cast<std::size_t>((width - 2.0 * kMargin) / kEntryWidth));
  const std::size_t num_entries = legend.size() + 1;  // And the scale bar.
  const std::size_t legend_rows = (num_entries + per_row - 1) / per_row;
  const double legend_top = static_cast<double>(rows) * row_pitch + kMargin;
  Page page({width, legend_top + static_cast<double>(legend_rows) * kLegendRow + kMargin}, format);

  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const double left = kMargin + static_cast<double>(i % columns) * cell_pitch;
    const std::size_t row = i / columns;
    const double top = kMargin + static_cast<double>(row) * row_pitch;
    page.Text(left, top + 0.5 * kTitleHeight, scenes[i].course->name);
    PaintScene(page, scenes[i], ViewOf(scenes[i]), left, top + 0.75 * kTitleHeight, scale);
  }
  for (std::size_t i = 0; i < num_entries; ++i) {
    const double left = kMargin + static_cast<double>(i % per_row) * kEntryWidth;
    const std::size_t row = i / per_row;
    const double middle = legend_top + (static_cast<double>(row) + 0.5) * kLegendRow;
    if (i < legend.size()) {
      PaintEntry(page, legend[i], left, middle);
    } else {
      PaintScaleBar(page, left, middle, scale);
    }
  }
  return page.Finish();
}

}  // namespace slalom::sim
