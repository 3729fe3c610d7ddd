#include "eval/report/report_page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "eval/report/comparison.h"
#include "eval/report/difficulty_bins.h"
#include "eval/report/drawn_bins.h"
#include "eval/report/embedded_page.h"
#include "eval/report/paired_comparison.h"
#include "eval/report/setting_differences.h"
#include "sim/courses/motion.h"

namespace slalom::eval {

extern const std::string_view kReportPage;  // An embedded page.

namespace {

using Json = nlohmann::json;

constexpr double kLengthResolution = 0.001;  // [m]
constexpr double kAngleResolution = 0.0002;  // [rad]
constexpr double kFrameTime = 0.1;           // Time between frames if the page has room, [s].
// Limits of the whole page; beyond them frames are further apart.
constexpr double kMaxTrackFrames = 250000;
constexpr double kMaxScanBytes = 1500000;
constexpr double kMaxMotionFrames = 150000;

Json Packed(const std::vector<double>& numbers, double resolution) {
  const PackedNumbers packed = PackNumbers(numbers, resolution);
  return {packed.scale, packed.base64};
}

char Letter(env::Outcome outcome) {
  switch (outcome) {
    case env::Outcome::kSuccess:
      return 'S';
    case env::Outcome::kCollision:
      return 'C';
    default:
      return 'T';
  }
}

// ---- Courses

/// One round of a moving obstacle: poses at even times, the last of them just before the round is
/// over, so that a jump lies between two rounds.
Json MotionJson(const sim::MovingObstacle& obstacle, double frame_time) {
  const sim::Motion motion(obstacle);
  const int num_frames = std::max(2, static_cast<int>(std::ceil(motion.period() / frame_time)) + 1);
  std::vector<double> points;
  std::vector<double> yaws;
  for (int k = 0; k < num_frames; ++k) {
    const double time =
        std::min(k * motion.period() / (num_frames - 1), motion.period() * (1.0 - 1e-9));
    const base::Pose2 X_WB = motion.At(time).X_WB;
    points.insert(points.end(), {X_WB.p.x, X_WB.p.y});
    yaws.push_back(X_WB.yaw);
  }
  return {{"radius", obstacle.radius},
          {"half", {obstacle.half_size.x, obstacle.half_size.y}},
          {"period", motion.period()},
          {"points", Packed(points, kLengthResolution)},
          {"yaws", Packed(yaws, kAngleResolution)}};
}

Json CourseJson(const sim::Course& course, double frame_time) {
  std::vector<double> circles;
  std::vector<double> boxes;
  std::vector<double> path;
  for (const sim::Circle& circle : course.circles) {
    circles.insert(circles.end(), {circle.p_W.x, circle.p_W.y, circle.radius});
  }
  for (const sim::Box& box : course.boxes) {
    boxes.insert(boxes.end(), {box.X_WB.p.x, box.X_WB.p.y, base::WrapAngle(box.X_WB.yaw),
                               box.half_size.x, box.half_size.y});
  }
  for (const base::Vec2& p_W : course.reference_path_W) path.insert(path.end(), {p_W.x, p_W.y});
  Json json = {{"name", course.name},
               {"start", {course.start.p.x, course.start.p.y, course.start.yaw}},
               {"goal", {course.goal_W.x, course.goal_W.y}},
               {"bounds",
                {course.bounds.min_W.x, course.bounds.min_W.y, course.bounds.max_W.x,
                 course.bounds.max_W.y}},
               {"circles", Packed(circles, kLengthResolution)},
               {"boxes", Packed(boxes, kLengthResolution)},
               {"path", Packed(path, kLengthResolution)},
               {"length", sim::ReferenceLength(course)},
               {"moving", Json::array()}};
  for (const sim::MovingObstacle& obstacle : course.moving) {
    json["moving"].push_back(MotionJson(obstacle, frame_time));
  }
  return json;
}

double MotionFrameTime(std::span<const Result> results, std::span<const ResultGroup> groups) {
  double num_frames = 0.0;
  for (const ResultGroup& group : groups) {
    for (const auto& course : results[group.results.front()].course_set_data.courses) {
      for (const sim::MovingObstacle& obstacle : course->moving) {
        num_frames += sim::Motion(obstacle).period() / kFrameTime;
      }
    }
  }
  return kFrameTime * std::max(1.0, num_frames / kMaxMotionFrames);
}

Json MeasuresJson(const ResultGroup& group, std::span<const Result> results) {
  Json json = Json::array();
  for (const CourseMeasure& measure :
       MeasureCourses(results[group.results.front()].course_set_data)) {
    const std::vector<CourseBin> bins = BinCourses(measure);
    if (bins.empty()) continue;
    Json bins_json = Json::array();
    for (const CourseBin& bin : bins) {
      Json rates = Json::array();
      for (const std::size_t r : group.results) {
        rates.push_back(JsonOf(SuccessInBin(results[r], bin)));
      }
      bins_json.push_back({{"low", bin.low},
                           {"high", bin.high},
                           {"courses", bin.courses.size()},
                           {"rates", std::move(rates)}});
    }
    json.push_back({{"key", measure.key},
                    {"name", measure.name},
                    {"unit", measure.unit},
                    {"bins", std::move(bins_json)}});
  }
  return json;
}

/// Every two results of a group, the earlier minus the later.
Json PairsJson(const ResultGroup& group, std::span<const Result> results) {
  Json json = Json::array();
  for (std::size_t i = 0; i < group.results.size(); ++i) {
    for (std::size_t j = i + 1; j < group.results.size(); ++j) {
      const auto [first, second] = std::pair(group.results[i], group.results[j]);
      const PairedComparison pair = CompareInPairs(results[first], results[second]);
      json.push_back({{"first", first},
                      {"second", second},
                      {"same_starts", pair.same_starts},
                      {"traversal_courses", pair.num_traversal_courses},
                      {"success_rate", JsonOf(pair.success_rate)},
                      {"traversal_time_s", JsonOf(pair.traversal_time)},
                      {"barn_score", JsonOf(pair.barn_score)}});
    }
  }
  return json;
}

Json GroupJson(const ResultGroup& group, std::span<const Result> results,
               std::span<const std::string> labels, double frame_time) {
  const Result& first = results[group.results.front()];
  Json courses = Json::array();
  for (const auto& course : first.course_set_data.courses) {
    courses.push_back(CourseJson(*course, frame_time));
  }
  return {{"title", group.title},
          {"results", group.results},
          {"courses", std::move(courses)},
          {"measures", MeasuresJson(group, results)},
          {"drawn", JsonOf(BinByDrawnFields(results, group))},
          {"pairs", PairsJson(group, results)},
          {"settings", JsonOf(FindSettingDifferences(results, AgentsOf(group, labels)))}};
}

// ---- Tracks

/// How many control steps lie between two frames of a track on the page.
struct Thinning {
  double track_frame_time = kFrameTime;
  double scan_frame_time = kFrameTime;

  int Stride(const sim::EpisodeTrack& track) const {
    const double time = track.beams ? scan_frame_time : track_frame_time;
    return std::max(1, static_cast<int>(std::ceil(time / track.step - 1e-6)));
  }
};

Thinning MakeThinning(std::span<const Result> results) {
  double track_frames = 0.0;
  double scan_bytes = 0.0;
  for (const Result& result : results) {
    for (const sim::EpisodeTrack& track : result.tracks) {
      const double frames = track.poses.size() / std::max(1.0, kFrameTime / track.step);
      track_frames += frames;
      if (track.beams) scan_bytes += frames * static_cast<double>(track.scans_cm.front().size());
    }
  }
  Thinning thinning;
  thinning.track_frame_time *= std::max(1.0, track_frames / kMaxTrackFrames);
  thinning.scan_frame_time =
      std::max(thinning.track_frame_time, kFrameTime * std::max(1.0, scan_bytes / kMaxScanBytes));
  return thinning;
}

Json ScansJson(const sim::EpisodeTrack& track, const std::vector<std::size_t>& frames) {
  std::uint16_t longest_cm = 1;
  for (const std::size_t i : frames) {
    for (const std::uint16_t range_cm : track.scans_cm[i])
      longest_cm = std::max(longest_cm, range_cm);
  }
  std::vector<std::uint8_t> bytes;
  for (const std::size_t i : frames) {
    for (const std::uint16_t range_cm : track.scans_cm[i]) {
      bytes.push_back(static_cast<std::uint8_t>((range_cm * 255 + longest_cm / 2) / longest_cm));
    }
  }
  return {{"sensor", {track.beams->p_RS.x, track.beams->p_RS.y}},
          {"angle_min", track.beams->angle_min},
          {"angle_step", track.beams->angle_step},
          {"beams", track.scans_cm.front().size()},
          {"longest", 0.01 * longest_cm},
          {"ranges", Base64(bytes)}};
}

Json TrackJson(const sim::EpisodeTrack& track, std::size_t course, const Thinning& thinning) {
  const auto stride = static_cast<std::size_t>(thinning.Stride(track));
  const std::size_t last = track.poses.size() - 1;
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < last; i += stride) frames.push_back(i);
  frames.push_back(last);
  std::vector<double> points;
  std::vector<double> yaws;
  for (const std::size_t i : frames) {
    points.insert(points.end(), {track.poses[i].p.x, track.poses[i].p.y});
    yaws.push_back(base::WrapAngle(track.poses[i].yaw));
  }
  Json json = {{"course", course},
               {"episode", track.episode},
               {"outcome", std::string(1, Letter(track.outcome))},
               {"frame_time", track.step * static_cast<double>(stride)},
               {"duration", track.step * static_cast<double>(last)},
               {"motion_start", track.motion_start},
               {"points", Packed(points, kLengthResolution)},
               {"yaws", Packed(yaws, kAngleResolution)}};
  if (track.beams) json["scans"] = ScansJson(track, frames);
  return json;
}

// ---- Results

Json FiguresJson(const Figures& set) {
  return {{"success_rate", JsonOf(set.success_rate)},
          {"collision_rate", JsonOf(set.collision_rate)},
          {"timeout_rate", JsonOf(set.timeout_rate)},
          {"contact_rate", JsonOf(set.contact_rate)},
          {"traversal_time_s", JsonOf(set.traversal_time)},
          {"survival_time_s", JsonOf(set.survival_time)},
          {"barn_score", JsonOf(set.barn_score)}};
}

Json ResultJson(const Result& result, const std::string& label, const Thinning& thinning) {
  std::map<std::string_view, std::size_t> course_of;
  Json outcomes = Json::array();
  Json times = Json::array();
  for (std::size_t c = 0; c < result.courses.size(); ++c) {
    course_of[result.courses[c].name] = c;
    std::string letters;
    Json course_times = Json::array();
    for (const ResultEpisode& episode : result.courses[c].episodes) {
      letters += Letter(episode.outcome);
      course_times.push_back(std::lround(100.0 * episode.time));
    }
    outcomes.push_back(letters);
    times.push_back(std::move(course_times));
  }
  Json tracks = Json::array();
  for (const sim::EpisodeTrack& track : result.tracks) {
    tracks.push_back(TrackJson(track, course_of.at(track.course), thinning));
  }
  Json json = {{"label", label},
               {"kind", result.kind},
               {"source", result.source},
               {"commit", result.commit},
               {"episodes", result.set.num_episodes},
               {"robot", {result.robot_length, result.robot_width}},
               {"figures", FiguresJson(result.set)},
               {"outcomes", std::move(outcomes)},
               {"times_cs", std::move(times)},
               {"tracks", std::move(tracks)}};
  if (const auto& overlap = result.training_overlap; overlap && overlap->num_courses > 0) {
    json["training_overlap"] = {{"courses", overlap->num_courses},
                                {"of", overlap->num_scored},
                                {"trained_on", overlap->trained_on}};
  }
  return json;
}

}  // namespace

std::string ReportPageData(std::span<const Result> results) {
  const std::vector<std::string> labels = Labels(results);
  const std::vector<ResultGroup> groups = GroupByCourses(results);
  const Thinning thinning = MakeThinning(results);
  const double frame_time = MotionFrameTime(results, groups);
  Json data = {{"protocol", ProtocolSentence(results.front())},
               {"collision_ends", results.front().collision_ends()},
               {"time_limit", Json::parse(results.front().protocol.at("time_limit_s"))},
               {"goal_tolerance", Json::parse(results.front().protocol.at("goal_tolerance_m"))},
               {"results", Json::array()},
               {"groups", Json::array()}};
  for (std::size_t r = 0; r < results.size(); ++r) {
    data["results"].push_back(ResultJson(results[r], labels[r], thinning));
  }
  for (const ResultGroup& group : groups) {
    data["groups"].push_back(GroupJson(group, results, labels, frame_time));
  }
  return JsonForPage(data);
}

std::string ReportPage(std::span<const Result> results) {
  return FillPage(kReportPage, ReportPageData(results));
}

}  // namespace slalom::eval
