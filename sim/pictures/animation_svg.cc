#include "sim/pictures/animation_svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "sim/courses/course_check.h"
#include "sim/pictures/guard_marks.h"

namespace slalom::sim {
namespace {

constexpr double kTolerance = 0.4;      // [pixels]
constexpr double kScanInterval = 0.2;   // Time between two scans that are shown, [s].
constexpr std::size_t kMaxBeams = 60;   // Beams of a scan that is shown.
constexpr double kGoalTolerance = 0.4;  // [m]
constexpr double kMarkRadius = 2.0;     // Of a guard's mark, [pixels].
constexpr double kLineHeight = 16.0;    // Height of the clock's line, [pixels].

constexpr std::string_view kStyle =
    ":root{color-scheme:light dark}"
    "svg{--paper:#fff;--rim:#d5dbe2;--floor:#f1f4f6;--ink:#262b33;--muted:#66707c;--wall:#434d5c;"
    "--end:#2163d4;--robot:#2163d4;--nose:#fff;--moving:#b9641f;--success:#129969;"
    "--collision:#d63026;--timeout:#d98e0b;--running:#7f5cb8}"
    "@media(prefers-color-scheme:dark){svg{--paper:#0d1117;--rim:#30363d;--floor:#191f27;"
    "--ink:#e6edf3;--muted:#98a2ae;--wall:#8a96a6;--end:#5b9bff;--robot:#5b9bff;--nose:#0d1117;"
    "--moving:#e08b45;--success:#35c28f;--collision:#ff6b60;--timeout:#f0b03f;--running:#b694ee}}"
    "text{font:12px system-ui,-apple-system,'Segoe UI',Helvetica,Arial,sans-serif;"
    "fill:var(--muted)}"
    ".paper{fill:var(--paper);stroke:var(--rim)}.floor{fill:var(--floor)}"
    ".wall{fill:var(--wall);stroke:var(--wall);stroke-width:0}"
    ".dots{fill:none;stroke:var(--wall);stroke-linecap:round}"
    ".goal{fill:var(--end);fill-opacity:.14;stroke:var(--end)}.spot{fill:var(--end)}"
    ".path{fill:none;stroke:var(--muted);stroke-opacity:.6;stroke-dasharray:4 4}"
    ".trail{fill:none;stroke:var(--robot);stroke-opacity:.7;stroke-width:2;stroke-linejoin:round}"
    ".robot{fill:var(--robot);stroke:var(--nose);stroke-width:.7}.nose{fill:var(--nose)}"
    ".moving{fill:var(--moving)}.scan{fill:var(--robot);fill-opacity:.13}"
    ".success{fill:var(--success)}.collision{fill:var(--collision)}"
    ".timeout{fill:var(--timeout)}.running{fill:var(--running)}"
    ".caption{font-weight:600}.bar{fill:var(--rim)}.done{fill:var(--robot)}";

/// A number with up to `digits` places, as short as it goes.
std::string Short(double value, int digits) {
  std::string text = fmt::format("{:.{}f}", value, digits);
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  if (text == "-0") return "0";
  if (text.starts_with("0.")) text.erase(0, 1);
  if (text.starts_with("-0.")) text.erase(1, 1);
  return text;
}

std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

/// A text cut to a width, [pixels], as far as that can be said without its font.
std::string Fitted(const std::string& text, double width) {
  constexpr double kMeanWidth = 6.3;
  const auto room = static_cast<std::size_t>(std::max(3.0, width / kMeanWidth));
  return text.size() <= room ? text : text.substr(0, room - 1) + "\u2026";
}

/// A point of the page, [pixels].
struct Point {
  double x = 0.0;
  double y = 0.0;
};

/// Writes one animation.
class Writer {
 public:
  explicit Writer(const Animation& animation)
      : animation_(animation), speed_(animation.options.speed), loop_(animation.loop_time()) {}

  std::string Print() {
    Add("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
        "{1}\" role=\"img\">\n<title>A robot drives: ",
        animation_.width, animation_.height);
    for (std::size_t i = 0; i < animation_.panels.size(); ++i) {
      Add("{}{}, {}", i == 0 ? "" : "; ", Escaped(animation_.panels[i].title),
          CaptionOf(animation_.panels[i]));
    }
    Add("</title>\n<style>{}</style>\n<rect class=\"paper\" x=\".5\" y=\".5\" width=\"{}\" "
        "height=\"{}\" rx=\"8\"/>\n",
        kStyle, animation_.width - 1.0, animation_.height - 1.0);
    for (std::size_t i = 0; i < animation_.panels.size(); ++i) AddPanel(i);
    AddClock();
    return text_ + "</svg>\n";
  }

 private:
  template <class... Values>
  void Add(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }

  Point At(base::Vec2 p_W) const {
    const double scale = animation_.scale;
    return {scale * (p_W.x - place_->view.min_W.x), scale * (place_->view.max_W.y - p_W.y)};
  }

  /// "x y", [pixels].
  std::string PointText(base::Vec2 p_W) const {
    const Point point = At(p_W);
    return Short(point.x, 1) + " " + Short(point.y, 1);
  }

  static std::string Degrees(double yaw) { return Short(-180.0 / base::kPi * yaw, 1); }

  /// The part of a round that has gone by at a time of the drive, [s].
  double Fraction(double time) const { return std::min(1.0, time / (speed_ * loop_)); }

  /// keyTimes, values, duration of an animation that keeps its last value to the end of the round.
  std::string Timing(const std::vector<double>& times, const std::vector<std::string>& values) {
    std::string key_times;
    std::string all_values;
    for (std::size_t i = 0; i < times.size(); ++i) {
      key_times += Short(Fraction(times[i]), 5) + ";";
      all_values += values[i] + ";";
    }
    return fmt::format(" dur=\"{}s\" repeatCount=\"indefinite\" keyTimes=\"{}1\" values=\"{}{}\"/>",
                       Short(loop_, 3), key_times, all_values, values.back());
  }

  /// Hidden until `time` of the drive, [s]. Without animation it is seen.
  std::string AppearsAt(double time) {
    return fmt::format("<animate attributeName=\"opacity\" calcMode=\"discrete\"{}",
                       Timing({0.0, time}, {"0", "1"}));
  }

  /// A group that moves as the keys say, with `shape` in it, which lies around the origin and looks
  /// to the right. Without animation it stands at the last of them.
  void AddMoving(const std::vector<PoseKey>& keys, std::string_view shape) {
    std::vector<double> times;
    std::vector<std::string> points;
    std::vector<std::string> angles;
    for (const PoseKey& key : keys) {
      times.push_back(key.time);
      points.push_back(PointText(key.pose.p));
      angles.push_back(Degrees(key.pose.yaw));
    }
    const auto varies = [](const std::vector<std::string>& values) {
      return std::any_of(values.begin(), values.end(),
                         [&](const std::string& value) { return value != values.front(); });
    };
    Add("<g transform=\"translate({})\">", points.back());
    if (varies(points)) {
      Add("<animateTransform attributeName=\"transform\" type=\"translate\"{}",
          Timing(times, points));
    }
    Add("<g transform=\"rotate({})\">", angles.back());
    if (varies(angles)) {
      Add("<animateTransform attributeName=\"transform\" type=\"rotate\"{}", Timing(times, angles));
    }
    Add("{}</g></g>\n", shape);
  }

  std::string BoxShape(const char* style, base::Vec2 half_size) const {
    const double x = animation_.scale * half_size.x;
    const double y = animation_.scale * half_size.y;
    return fmt::format("<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>", style,
                       Short(-x, 1), Short(-y, 1), Short(2.0 * x, 1), Short(2.0 * y, 1));
  }

  void AddPanel(std::size_t number) {
    const AnimationPanel& panel = animation_.panels[number];
    const PanelPlace& place = animation_.places[number];
    place_ = &place;
    const double middle = place.left + 0.5 * place.width;
    Add("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", Short(middle, 1),
        Short(place.top - 7.0, 1), Escaped(Fitted(panel.title, place.width + kPanelMargin)));
    Add("<clipPath id=\"c{}\"><rect width=\"{}\" height=\"{}\" rx=\"3\"/></clipPath>\n", number,
        Short(place.width, 1), Short(place.height, 1));
    Add("<g transform=\"translate({} {})\" clip-path=\"url(#c{})\">\n<rect class=\"floor\" "
        "width=\"{}\" height=\"{}\"/>\n",
        Short(place.left, 1), Short(place.top, 1), number, Short(place.width, 1),
        Short(place.height, 1));
    AddCourse(*panel.course);
    const double tolerance = kTolerance / animation_.scale;
    for (const EpisodeTrack& track : panel.tracks) {
      if (animation_.options.shows_scans && track.beams) AddScans(track);
    }
    for (const EpisodeTrack& track : panel.tracks) AddTrack(track, KeysOf(track, tolerance));
    // Above the robots, so that a small one that hits is seen.
    for (const MovingObstacle& obstacle : panel.course->moving) {
      const auto keys =
          KeysOf(obstacle, panel.tracks.front().motion_start, DurationOf(panel), tolerance);
      AddMoving(keys, obstacle.radius > 0.0
                          ? fmt::format("<circle class=\"moving\" r=\"{}\"/>",
                                        Short(animation_.scale * obstacle.radius, 1))
                          : BoxShape("moving", obstacle.half_size));
    }
    Add("</g>\n");
    const std::string_view style =
        panel.tracks.size() == 1 ? ToString(panel.tracks.front().outcome) : "count";
    Add("<text class=\"caption {}\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}{}</text>\n", style,
        Short(middle, 1), Short(place.top + place.height + 15.0, 1),
        Escaped(Fitted(CaptionOf(panel), place.width + kPanelMargin)),
        AppearsAt(DurationOf(panel)));
  }

  void AddCourse(const Course& course) {
    const Point goal = At(course.goal_W);
    Add("<circle class=\"goal\" cx=\"{0}\" cy=\"{1}\" r=\"{2}\"/><circle class=\"spot\" "
        "cx=\"{0}\" cy=\"{1}\" r=\"2\"/>\n",
        Short(goal.x, 1), Short(goal.y, 1), Short(animation_.scale * kGoalTolerance, 1));
    std::string path;
    for (const base::Vec2& p : course.reference_path_W) path += PointText(p) + " ";
    Add("<path class=\"path\" d=\"M{}L{}{}\"/>\n", PointText(course.start.p), path,
        PointText(course.goal_W));
    // Cylinders of one radius are dots of one thick line.
    std::map<double, std::string> dots;
    for (const Circle& circle : course.circles) {
      dots[circle.radius] += fmt::format("M{}h0", PointText(circle.p_W));
    }
    for (const auto& [radius, d] : dots) {
      Add("<path class=\"dots\" stroke-width=\"{}\" d=\"{}\"/>\n",
          Short(2.0 * animation_.scale * radius, 2), d);
    }
    std::string boxes;
    for (const Box& box : course.boxes) {
      const auto corner = [&](double x, double y) {
        return PointText(base::Transform(box.X_WB, {x * box.half_size.x, y * box.half_size.y}));
      };
      boxes +=
          fmt::format("M{}L{} {} {}z", corner(1, 1), corner(-1, 1), corner(-1, -1), corner(1, -1));
    }
    if (!boxes.empty()) Add("<path class=\"wall\" d=\"{}\"/>\n", boxes);
  }

  void AddTrack(const EpisodeTrack& track, const std::vector<PoseKey>& keys) {
    AddTrail(keys);
    AddGuardMarks(track);
    const double end = DurationOf(track);
    const std::string_view outcome = ToString(track.outcome);
    std::string shape = BoxShape("robot", {0.5 * kRobotLength, 0.5 * kRobotWidth}) +
                        fmt::format("<g class=\"{}\">{}{}</g>", outcome, AppearsAt(end),
                                    BoxShape("result", {0.5 * kRobotLength, 0.5 * kRobotWidth}));
    const double scale = animation_.scale;
    shape += fmt::format("<path class=\"nose\" d=\"M{} 0L{} {}V{}z\"/>", Short(0.16 * scale, 1),
                         Short(-0.04 * scale, 1), Short(0.11 * scale, 1), Short(-0.11 * scale, 1));
    AddMoving(keys, shape);
  }

  /// The line grows behind the robot: a single dash, whose offset goes down as the way driven goes
  /// up.
  void AddTrail(const std::vector<PoseKey>& keys) {
    std::string points;
    std::vector<double> times;
    std::vector<double> lengths = {0.0};
    for (std::size_t i = 0; i < keys.size(); ++i) {
      times.push_back(keys[i].time);
      points += PointText(keys[i].pose.p) + " ";
      if (i > 0) {
        lengths.push_back(lengths.back() + base::Norm(keys[i].pose.p - keys[i - 1].pose.p));
      }
    }
    if (!(lengths.back() > 0.0)) return;
    std::vector<std::string> offsets;
    offsets.reserve(lengths.size());
    for (const double length : lengths) {
      offsets.push_back(Short(1000.0 * (1.0 - length / lengths.back()), 0));
    }
    Add("<path class=\"trail\" d=\"M{}\" pathLength=\"1000\" stroke-dasharray=\"1000 "
        "2000\"><animate "
        "attributeName=\"stroke-dashoffset\"{}</path>\n",
        points, Timing(times, offsets));
  }

  void AddGuardMarks(const EpisodeTrack& track) {
    if (track.interventions.empty()) return;
    Add("<g style=\"fill:var(--paper);stroke:var(--robot);stroke-width:1.2\">");
    for (const std::size_t i : GuardMarks(track, 2.0 * kMarkRadius / animation_.scale)) {
      const Point point = At(track.poses[i].p);
      Add("<circle cx=\"{}\" cy=\"{}\" r=\"{}\">{}</circle>", Short(point.x, 1), Short(point.y, 1),
          kMarkRadius, AppearsAt(track.step * static_cast<double>(i)));
    }
    Add("</g>\n");
  }

  void AddScans(const EpisodeTrack& track) {
    const TrackBeams& beams = *track.beams;
    const std::size_t pose_stride =
        std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(kScanInterval / track.step)));
    std::vector<double> times;
    std::vector<std::string> polygons;
    for (std::size_t i = 0; i < track.poses.size(); i += pose_stride) {
      const base::Pose2& X_WR = track.poses[i];
      const auto& scan = track.scans_cm[i];
      const std::size_t stride = (scan.size() + kMaxBeams - 1) / kMaxBeams;
      std::string points = PointText(base::Transform(X_WR, beams.p_RS));
      for (std::size_t k = 0; k < scan.size(); k += stride) {
        const double angle = beams.angle_min + static_cast<double>(k) * beams.angle_step;
        const auto [sin, cos] = base::SinCos(angle);
        const double range = 0.01 * scan[k];
        const base::Vec2 p_R = beams.p_RS + base::Vec2{range * cos, range * sin};
        points += ' ';
        points += PointText(base::Transform(X_WR, p_R));
      }
      times.push_back(track.step * static_cast<double>(i));
      polygons.push_back(std::move(points));
    }
    times.push_back(std::max(DurationOf(track), times.back()));
    polygons.emplace_back("0 0");  // Nothing: the drive is over.
    Add("<polygon class=\"scan\"><animate attributeName=\"points\" calcMode=\"discrete\"{}"
        "</polygon>\n",
        Timing(times, polygons));
  }

  /// A bar that fills up, and the seconds driven: a strip of numbers behind a window.
  void AddClock() {
    const double top = animation_.height - kAnimationFooter;
    const double bar = animation_.width - 2.0 * kPanelMargin - 90.0;
    const auto rect = [&](const char* style, const std::string& inner) {
      Add("<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"3\" rx=\"1.5\">{}</rect>\n",
          style, kPanelMargin, Short(top + 7.0, 1), Short(bar, 1), inner);
    };
    rect("bar", "");
    rect("done", fmt::format("<animate attributeName=\"width\"{}",
                             Timing({0.0, animation_.drive_time}, {"0", Short(bar, 1)})));
    Add("<clipPath id=\"clock\"><rect width=\"80\" height=\"{}\"/></clipPath>\n<g "
        "transform=\"translate({} {})\" clip-path=\"url(#clock)\"><text transform=\"translate(0 "
        "{})\">",
        kLineHeight, Short(animation_.width - kPanelMargin - 80.0, 1), Short(top, 1),
        Short(-kLineHeight * std::floor(animation_.drive_time), 0));
    const int seconds = static_cast<int>(animation_.drive_time);
    std::vector<double> times;
    std::vector<std::string> offsets;
    std::string lines;
    for (int s = 0; s <= seconds; ++s) {
      times.push_back(s);
      offsets.push_back(fmt::format("0 {}", Short(-kLineHeight * s, 0)));
      lines += fmt::format("<tspan x=\"80\" y=\"{}\" text-anchor=\"end\">{} s{}</tspan>",
                           Short(kLineHeight * s + 12.0, 0), s,
                           speed_ == 1.0 ? "" : fmt::format(", {:g} x", speed_));
    }
    Add("<animateTransform attributeName=\"transform\" type=\"translate\" calcMode=\"discrete\"{}"
        "{}</text></g>\n",
        Timing(times, offsets), lines);
  }

  const Animation& animation_;
  const double speed_;
  const double loop_;
  const PanelPlace* place_ = nullptr;  ///< Place of the panel that is written.
  std::string text_;
};

}  // namespace

std::string PrintAnimationSvg(const Animation& animation) { return Writer(animation).Print(); }

}  // namespace slalom::sim
