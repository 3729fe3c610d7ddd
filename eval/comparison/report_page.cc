#include "eval/comparison/report_page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "eval/comparison/printers.h"
#include "eval/report/difficulty_bins.h"
#include "eval/report/embedded_page.h"
#include "eval/report/result_group.h"
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
  return outcome == env::Outcome::kSuccess ? 'S' : outcome == env::Outcome::kCollision ? 'C' : 'T';
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

/// `agents`: those of the group.
Json MeasuresJson(std::span<const Result> results, std::span<const AgentResults> agents) {
  Json json = Json::array();
  const Result& first = results[agents.front().results.front()];
  for (const CourseMeasure& measure : MeasureCourses(first.course_set_data)) {
    const std::vector<CourseBin> bins = BinCourses(measure);
    if (bins.empty()) continue;
    Json bins_json = Json::array();
    for (const CourseBin& bin : bins) {
      Json rates = Json::array();
      for (const AgentResults& agent : agents) {
        rates.push_back(JsonOf(SuccessInBin(results, agent, bin)));
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
  if (!track.interventions.empty()) {
    std::set<std::size_t> guarded;  // Frames.
    for (const int i : track.interventions) guarded.insert(static_cast<std::size_t>(i) / stride);
    json["guarded"] = Packed({guarded.begin(), guarded.end()}, 1.0);
  }
  return json;
}

// ---- Results

std::string JoinedOnce(const std::set<std::string>& texts) {
  std::string joined;
  for (const std::string& text : texts) joined += (joined.empty() ? "" : ", ") + text;
  return joined;
}

/// The episodes of an agent. Those of its seeds follow each other on each course.
Json EpisodesJson(std::span<const Result> results, const AgentResults& agent,
                  const Thinning& thinning) {
  const Result& first = results[agent.results.front()];
  std::vector<std::string> outcomes(first.courses.size());
  std::vector<std::vector<long>> times(first.courses.size());
  std::map<std::string_view, std::size_t> course_of;
  for (std::size_t c = 0; c < first.courses.size(); ++c) course_of[first.courses[c].name] = c;
  Json tracks = Json::array();
  std::set<std::string> sources;
  std::set<std::string> commits;
  for (const std::size_t r : agent.results) {
    for (const sim::EpisodeTrack& track : results[r].tracks) {
      const std::size_t course = course_of.at(track.course);
      Json json = TrackJson(track, course, thinning);
      json["episode"] = track.episode + static_cast<int>(outcomes[course].size());
      tracks.push_back(std::move(json));
    }
    for (std::size_t c = 0; c < first.courses.size(); ++c) {
      for (const ResultEpisode& episode : results[r].courses[c].episodes) {
        outcomes[c] += Letter(episode.outcome);
        times[c].push_back(std::lround(100.0 * episode.time));
      }
    }
    sources.insert(results[r].source);
    commits.insert(results[r].commit);
  }
  Json json = {{"label", agent.label},
               {"kind", first.kind},
               {"source", JoinedOnce(sources)},
               {"commit", JoinedOnce(commits)},
               {"robot", {first.robot_length, first.robot_width}},
               {"outcomes", outcomes},
               {"times_cs", times},
               {"tracks", std::move(tracks)}};
  for (const std::size_t r : agent.results) {
    const auto& overlap = results[r].training_overlap;
    if (!overlap || overlap->num_courses == 0) continue;
    json["training_overlap"] = {{"courses", overlap->num_courses},
                                {"of", overlap->num_scored},
                                {"trained_on", overlap->trained_on}};
  }
  return json;
}

}  // namespace

std::string ReportPageData(const Comparison& comparison) {
  const std::span<const Result> results = comparison.results;
  const std::vector<ResultGroup> groups = GroupByCourses(results);
  const Thinning thinning = MakeThinning(results);
  const double frame_time = MotionFrameTime(results, groups);
  Json data = {{"protocol", ProtocolSentence(results.front())},
               {"time_limit", Json::parse(results.front().protocol.at("time_limit_s"))},
               {"goal_tolerance", Json::parse(results.front().protocol.at("goal_tolerance_m"))},
               {"num_evaluations", results.size()},
               {"quantities", QuantitiesJson()},
               {"thresholds", ProfileThresholds()},
               {"results", Json::array()},
               {"groups", Json::array()}};
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const std::vector<AgentResults> agents = AgentsIn(groups[g], comparison.agents);
    Json group = JsonOf(comparison.groups[g]);
    group["results"] = Json::array();
    for (const AgentResults& agent : agents) {
      group["results"].push_back(data["results"].size());
      data["results"].push_back(EpisodesJson(results, agent, thinning));
    }
    group["courses"] = Json::array();
    for (const auto& course : results[groups[g].results.front()].course_set_data.courses) {
      group["courses"].push_back(CourseJson(*course, frame_time));
    }
    group["measures"] = MeasuresJson(results, agents);
    data["groups"].push_back(std::move(group));
  }
  return JsonForPage(data);
}

std::string ReportPage(const Comparison& comparison) {
  return FillPage(kReportPage, ReportPageData(comparison));
}

void WriteReport(const Comparison& comparison, const std::filesystem::path& directory) {
  base::MakeDirectories(directory);
  base::WriteFileAtomically(directory / "report.md", MarkdownOf(comparison.groups));
  base::WriteFileAtomically(directory / "report.csv", FiguresCsv(comparison.groups));
  base::WriteFileAtomically(directory / "report-pairs.csv", PairsCsv(comparison.groups));
  base::WriteFileAtomically(directory / "report.html", ReportPage(comparison));
}

}  // namespace slalom::eval
