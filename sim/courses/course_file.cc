#include "sim/courses/course_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/split.h"
#include "sim/courses/course_check.h"

namespace slalom::sim {
namespace {

constexpr std::string_view kMagic = "slalom-courses";
constexpr std::string_view kChecksum = "checksum";
constexpr int kFixedVersion = 1;   // Fixed obstacles only.
constexpr int kMovingVersion = 2;  // And moving ones.

std::string_view ToString(Playback playback) {
  return playback == Playback::kLoop ? "loop" : "ping-pong";
}

void PrintMoving(const MovingObstacle& obstacle, std::string& text) {
  auto out = std::back_inserter(text);
  if (obstacle.radius > 0.0) {
    fmt::format_to(out, "moving cylinder {} {}\n", obstacle.radius, ToString(obstacle.playback));
  } else {
    fmt::format_to(out, "moving box {} {} {}\n", obstacle.half_size.x, obstacle.half_size.y,
                   ToString(obstacle.playback));
  }
  for (const KeyFrame& frame : obstacle.key_frames) {
    fmt::format_to(out, "key {} {} {} {}\n", frame.time, frame.X_WB.p.x, frame.X_WB.p.y,
                   frame.X_WB.yaw);
  }
}

void PrintCourse(const Course& course, std::string& text) {
  auto out = std::back_inserter(text);
  fmt::format_to(out, "course {}\n", course.name);
  fmt::format_to(out, "start {} {} {}\n", course.start.p.x, course.start.p.y, course.start.yaw);
  fmt::format_to(out, "goal {} {}\n", course.goal_W.x, course.goal_W.y);
  const Bounds& bounds = course.bounds;
  fmt::format_to(out, "bounds {} {} {} {}\n", bounds.min_W.x, bounds.min_W.y, bounds.max_W.x,
                 bounds.max_W.y);
  if (course.difficulty) {
    const Difficulty& d = *course.difficulty;
    fmt::format_to(out, "difficulty {} {} {} {} {}\n", d.distance_to_obstacle, d.visibility,
                   d.dispersion, d.characteristic_dimension, d.tortuosity);
  }
  for (const Circle& c : course.circles) {
    fmt::format_to(out, "circle {} {} {}\n", c.p_W.x, c.p_W.y, c.radius);
  }
  for (const Box& box : course.boxes) {
    fmt::format_to(out, "box {} {} {} {} {}\n", box.X_WB.p.x, box.X_WB.p.y, box.X_WB.yaw,
                   box.half_size.x, box.half_size.y);
  }
  for (const MovingObstacle& obstacle : course.moving) PrintMoving(obstacle, text);
  for (const base::Vec2& p : course.reference_path_W) fmt::format_to(out, "path {} {}\n", p.x, p.y);
  text += "end\n";
}

/// Words of a line, separated by blanks, up to a '#'.
std::vector<std::string_view> SplitWords(std::string_view line) {
  line = line.substr(0, line.find('#'));
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos) return words;
    line.remove_prefix(begin);
    const std::size_t end = std::min(line.find_first_of(" \t\r"), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

/// Reads one file, line by line; every `Fail` names the line.
class Parser {
 public:
  Parser(std::string_view text, std::string_view source, const std::filesystem::path& directory,
         OutsideBounds outside)
      : text_(text), source_(source), directory_(directory), outside_(outside) {}

  CourseSet Run() {
    ReadHeader();
    while (!ended_) ReadLine();
    return std::move(set_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw base::Error("{}:{}: {}", source_, line_number_, what);
  }

  /// The next line without its end; the file must hold one.
  std::string_view TakeLine() {
    ++line_number_;
    std::size_t end = text_.find('\n', position_);
    if (end == std::string_view::npos) {
      // The last line may lack its end.
      end = text_.size();
      const auto words = SplitWords(text_.substr(position_));
      if (words.empty() || words[0] != kChecksum) {
        Fail("the file ends before its \"checksum\" line; it was cut short");
      }
    }
    const std::string_view line = text_.substr(position_, end - position_);
    line_start_ = position_;
    position_ = std::min(end + 1, text_.size());
    return line;
  }

  void ReadHeader() {
    base::ThrowIf(text_.empty(), "{}: the file is empty", source_);
    if (!text_.starts_with(kMagic)) {
      line_number_ = 1;
      Fail("not a Slalom course file; expected \"slalom-courses 1\" or \"slalom-courses 2\"");
    }
    const auto words = SplitWords(TakeLine());
    if (words.size() != 2 || words[0] != kMagic || (words[1] != "1" && words[1] != "2")) {
      Fail(
          "unknown version of the course format; expected \"slalom-courses 1\" or "
          "\"slalom-courses 2\"");
    }
    version_ = words[1] == "1" ? kFixedVersion : kMovingVersion;
  }

  void ReadLine() {
    const std::string_view line = TakeLine();
    const auto words = SplitWords(line);
    if (words.empty()) return;
    const std::string_view key = words[0];
    const std::span<const std::string_view> values = std::span(words).subspan(1);
    if (key == kChecksum) {
      ReadChecksum(values);
    } else if (course_) {
      ReadCourseLine(key, values);
    } else if (key == "set") {
      if (!set_.courses.empty() || !set_.name.empty()) Fail("\"set\" must come once, first");
      set_.name = ReadName(values);
    } else if (key == "file") {
      ReadNamedFile(values);
    } else if (key == "course") {
      course_.emplace();
      course_->name = ReadName(values);
      seen_.clear();
      obstacles_.clear();
    } else {
      Fail(fmt::format(
          "found \"{}\" where \"set\", \"course\", \"file\" or \"checksum\" is expected", key));
    }
  }

  void ReadCourseLine(std::string_view key, std::span<const std::string_view> values) {
    Course& course = *course_;
    if (key != "key") FinishMoving();
    if (key == "end") {
      if (!values.empty()) Fail("\"end\" stands alone");
      for (const std::string_view part : {"start", "goal", "bounds"}) {
        if (!seen_.contains(part)) {
          Fail(fmt::format("course {} has no \"{}\" line", course.name, part));
        }
      }
      RequireInside(course);
      AddCourse(std::make_shared<const Course>(std::move(course)));
      course_.reset();
    } else if (key == "start") {
      const auto v = ReadOnce<3>(key, values, "x y yaw");
      course.start = {{v[0], v[1]}, v[2]};
    } else if (key == "goal") {
      const auto v = ReadOnce<2>(key, values, "x y");
      course.goal_W = {v[0], v[1]};
    } else if (key == "bounds") {
      const auto v = ReadOnce<4>(key, values, "min_x min_y max_x max_y");
      if (!(v[0] < v[2] && v[1] < v[3])) Fail("the smaller corner of the bounds must come first");
      course.bounds = {{v[0], v[1]}, {v[2], v[3]}};
    } else if (key == "difficulty") {
      const auto v = ReadOnce<5>(
          key, values,
          "distance_to_obstacle visibility dispersion characteristic_dimension tortuosity");
      course.difficulty = Difficulty{v[0], v[1], v[2], v[3], v[4]};
    } else if (key == "circle") {
      const auto v = ReadNumbers<3>(key, values, "x y radius");
      if (!(v[2] > 0.0)) Fail("the radius of a circle must be above 0");
      const Circle circle{{v[0], v[1]}, v[2]};
      course.circles.push_back(circle);
      NoteObstacle(key, values, Including({circle.p_W, circle.p_W}, circle));
    } else if (key == "box") {
      const auto v = ReadNumbers<5>(key, values, "x y yaw half_x half_y");
      if (!(v[3] > 0.0 && v[4] > 0.0)) Fail("the half sizes of a box must be above 0");
      const Box box{{{v[0], v[1]}, v[2]}, {v[3], v[4]}};
      course.boxes.push_back(box);
      NoteObstacle(key, values, Including({box.X_WB.p, box.X_WB.p}, box));
    } else if (key == "moving") {
      ReadMoving(values);
    } else if (key == "key") {
      if (!in_moving_) Fail("a \"key\" line must follow a \"moving\" line or another \"key\" line");
      const auto v = ReadNumbers<4>(key, values, "time x y yaw");
      MovingObstacle& obstacle = course.moving.back();
      obstacle.key_frames.push_back({v[0], {{v[1], v[2]}, v[3]}});
      if (const auto why = WhyBadKeyFrame(obstacle, obstacle.key_frames.size() - 1)) Fail(*why);
    } else if (key == "path") {
      const auto v = ReadNumbers<2>(key, values, "x y");
      course.reference_path_W.push_back({v[0], v[1]});
    } else {
      Fail(
          fmt::format("unknown line \"{}\" in course {}; expected start, goal, bounds, difficulty, "
                      "circle, box, moving, key, path or end",
                      key, course.name));
    }
  }

  /// Remembers an obstacle's line until the bounds are known. `extent`: its smallest bounds.
  void NoteObstacle(std::string_view key, std::span<const std::string_view> values,
                    const Bounds& extent) {
    if (outside_ == OutsideBounds::kAllow) return;
    obstacles_.push_back({line_number_, fmt::format("{} {}", key, fmt::join(values, " ")), extent});
  }

  void RequireInside(const Course& course) {
    const Bounds& bounds = course.bounds;
    for (const auto& [line, text, extent] : obstacles_) {
      const bool is_inside = extent.min_W.x < bounds.max_W.x && extent.max_W.x > bounds.min_W.x &&
                             extent.min_W.y < bounds.max_W.y && extent.max_W.y > bounds.min_W.y;
      if (is_inside) continue;
      line_number_ = line;
      Fail(fmt::format(
          "\"{}\" is wholly outside the bounds of course {}, expected it inside x = {} "
          "to {} and y = {} to {}, at least in part",
          text, course.name, bounds.min_W.x, bounds.max_W.x, bounds.min_W.y, bounds.max_W.y));
    }
  }

  void ReadMoving(std::span<const std::string_view> values) {
    if (version_ < kMovingVersion) {
      Fail("version 1 of the format has no moving obstacles; begin the file with slalom-courses 2");
    }
    MovingObstacle obstacle;
    if (!values.empty() && values[0] == "cylinder") {
      obstacle.playback = TakePlayback(values);
      obstacle.radius = ReadNumbers<1>("moving cylinder", values.subspan(1), "radius")[0];
      if (!(obstacle.radius > 0.0)) Fail("the radius of a moving cylinder must be above 0");
    } else if (!values.empty() && values[0] == "box") {
      obstacle.playback = TakePlayback(values);
      const auto v = ReadNumbers<2>("moving box", values.subspan(1), "half_x half_y");
      if (!(v[0] > 0.0 && v[1] > 0.0)) Fail("the half sizes of a moving box must be above 0");
      obstacle.half_size = {v[0], v[1]};
    } else {
      Fail("\"moving\" is followed by \"cylinder\" or \"box\"");
    }
    course_->moving.push_back(std::move(obstacle));
    in_moving_ = true;
    moving_line_ = line_number_;
  }

  /// The last word of a "moving" line, which is taken off `values`.
  Playback TakePlayback(std::span<const std::string_view>& values) const {
    const std::string_view word = values.back();
    values = values.first(values.size() - 1);
    if (word == ToString(Playback::kLoop)) return Playback::kLoop;
    if (word == ToString(Playback::kPingPong)) return Playback::kPingPong;
    Fail(fmt::format("a \"moving\" line ends in \"loop\" or \"ping-pong\", found \"{}\"", word));
  }

  /// The key frames of the obstacle that was begun, if one was, are all there.
  void FinishMoving() {
    if (!in_moving_) return;
    in_moving_ = false;
    const std::size_t num_frames = course_->moving.back().key_frames.size();
    if (num_frames < 2) {
      line_number_ = moving_line_;
      Fail(fmt::format("this moving obstacle has {} \"key\" line{}, expected 2 or more", num_frames,
                       num_frames == 1 ? "" : "s"));
    }
  }

  std::string ReadName(std::span<const std::string_view> values) const {
    if (values.size() != 1 || !IsCourseName(values[0])) {
      Fail("expected one name of letters, digits, '-', '_' and '.'");
    }
    return std::string(values[0]);
  }

  template <std::size_t N>
  std::array<double, N> ReadNumbers(std::string_view key, std::span<const std::string_view> values,
                                    std::string_view meaning) const {
    if (values.size() != N) {
      Fail(fmt::format("\"{}\" takes {} numbers ({}), found {}", key, N, meaning, values.size()));
    }
    std::array<double, N> numbers{};
    for (std::size_t i = 0; i < N; ++i) {
      numbers[i] = base::ParseNumber<double>(values[i]).value_or(NAN);
      if (!(std::abs(numbers[i]) <= 1e5)) {
        Fail(fmt::format("\"{}\" is not a number between -1e5 and 1e5", values[i]));
      }
    }
    return numbers;
  }

  template <std::size_t N>
  std::array<double, N> ReadOnce(std::string_view key, std::span<const std::string_view> values,
                                 std::string_view meaning) {
    if (!seen_.insert(std::string(key)).second) {
      Fail(fmt::format("course {} has a second \"{}\" line", course_->name, key));
    }
    return ReadNumbers<N>(key, values, meaning);
  }

  void ReadNamedFile(std::span<const std::string_view> values) {
    if (values.size() != 1) Fail("\"file\" takes one path without blanks");
    const std::filesystem::path path = directory_ / values[0];
    const CourseSet named = ParseNamedFile(path);
    if (named.courses.size() != 1) {
      Fail(fmt::format("{} holds {} courses; a file named by a set holds one", path.string(),
                       named.courses.size()));
    }
    AddCourse(named.courses.front());
  }

  CourseSet ParseNamedFile(const std::filesystem::path& path) const {
    if (is_named_) Fail("a file that a set names must hold its course itself");
    const std::string text = base::ReadTextFile(path);
    const std::string source = path.string();
    Parser parser(text, source, path.parent_path(), outside_);
    parser.is_named_ = true;
    return parser.Run();
  }

  void AddCourse(std::shared_ptr<const Course> course) {
    if (!names_.insert(course->name).second) {
      Fail(fmt::format("a second course is named {}", course->name));
    }
    set_.courses.push_back(std::move(course));
  }

  void ReadChecksum(std::span<const std::string_view> values) {
    if (course_) Fail(fmt::format("course {} has no \"end\" line", course_->name));
    const std::string expected =
        fmt::format("{:016x}", base::Checksum(text_.substr(0, line_start_)));
    if (values.size() != 1) Fail("\"checksum\" takes 16 hexadecimal digits or \"none\"");
    if (values[0] != expected && values[0] != "none") {
      Fail(
          fmt::format("the checksum is {}, but the text above it has {}: the file was damaged or "
                      "edited (after an edit by hand, write \"checksum none\")",
                      values[0], expected));
    }
    if (position_ != text_.size()) Fail("there is text after the \"checksum\" line");
    ended_ = true;
  }

  const std::string_view text_;
  const std::string_view source_;
  const std::filesystem::path directory_;
  const OutsideBounds outside_;
  bool is_named_ = false;  // By another file's "file" line.
  std::size_t position_ = 0;
  std::size_t line_start_ = 0;
  int line_number_ = 0;
  int version_ = kFixedVersion;
  bool ended_ = false;
  struct ObstacleLine {
    int number = 0;
    std::string text;
    Bounds extent;
  };
  std::vector<ObstacleLine> obstacles_;       // Of `course_`, if `outside_` refuses some.
  std::optional<Course> course_;              // Between "course" and "end".
  bool in_moving_ = false;                    // Key lines may follow: for course_->moving.back().
  int moving_line_ = 0;                       // Line on which that obstacle began.
  std::set<std::string, std::less<>> seen_;   // Lines of `course_` that may stand only once.
  std::set<std::string, std::less<>> names_;  // Names of the courses in `set_`.
  CourseSet set_;
};

}  // namespace

std::string PrintCourseSet(const CourseSet& set, std::string_view remark) {
  const bool has_moving = std::any_of(set.courses.begin(), set.courses.end(),
                                      [](const auto& course) { return !course->moving.empty(); });
  std::string text = fmt::format("{} {}\n", kMagic, has_moving ? kMovingVersion : kFixedVersion);
  if (!remark.empty()) text += fmt::format("# {}\n", remark);
  if (!set.name.empty()) text += fmt::format("set {}\n", set.name);
  for (const auto& course : set.courses) PrintCourse(*course, text);
  const std::uint64_t checksum = base::Checksum(text);
  text += fmt::format("checksum {:016x}\n", checksum);
  return text;
}

CourseSet ParseCourseSet(std::string_view text, std::string_view source,
                         const std::filesystem::path& directory, OutsideBounds outside) {
  return Parser(text, source, directory, outside).Run();
}

CourseSet ReadCourseSet(const std::filesystem::path& path, OutsideBounds outside) {
  const std::string text = base::ReadTextFile(path);
  CourseSet set = ParseCourseSet(text, path.string(), path.parent_path(), outside);
  if (set.name.empty()) set.name = path.stem().string();
  return set;
}

void WriteCourseSet(const std::filesystem::path& path, const CourseSet& set,
                    std::string_view remark) {
  base::WriteFileAtomically(path, PrintCourseSet(set, remark));
}

bool IsCourseName(std::string_view name) {
  constexpr std::string_view kAllowed =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.";
  return !name.empty() && name.size() <= 100 && name.front() != '.' &&
         name.find_first_not_of(kAllowed) == std::string_view::npos;
}

}  // namespace slalom::sim
