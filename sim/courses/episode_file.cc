#include "sim/courses/episode_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <variant>

#include "base/error.h"
#include "base/file.h"
#include "base/json.h"

namespace slalom::sim {
namespace {

using nlohmann::json;

std::optional<env::Outcome> ParseOutcome(const std::string& text) {
  for (const env::Outcome outcome : {env::Outcome::kRunning, env::Outcome::kSuccess,
                                     env::Outcome::kCollision, env::Outcome::kTimeout}) {
    if (text == ToString(outcome)) return outcome;
  }
  return std::nullopt;
}

bool IsNumber(const json& value) {
  return value.is_number() && std::abs(value.get<double>()) <= 1e5;
}

/// Turns -0 into 0, because zeros are printed as integers, which have no negative zero.
double Number(const json& value) { return value.get<double>() + 0.0; }

bool IsNumbers(const json& value, std::size_t count) {
  return value.is_array() && value.size() == count &&
         std::all_of(value.begin(), value.end(), IsNumber);
}

bool IsScan(const json& value) {
  return value.is_array() && std::all_of(value.begin(), value.end(), [](const json& range) {
           return range.is_number_unsigned() && range.get<std::uint64_t>() <= 65535;
         });
}

/// Reads the number `key` into `value` if there is one. Returns false if it is not such a number.
bool ReadNumber(const json& object, const char* key, double& value) {
  const auto it = object.find(key);
  if (it == object.end()) return true;
  if (!IsNumber(*it)) return false;
  value = Number(*it);
  return true;
}

/// Reads the optional keys of a track. Returns what is wrong with them, or an empty text.
std::string ReadOptionalKeys(const json& object, EpisodeTrack& track) {
  double episode = 0.0;
  for (const auto& [key, value] : {std::pair{"episode", &episode},
                                   {"step_s", &track.step},
                                   {"motion_start_s", &track.motion_start}}) {
    if (!ReadNumber(object, key, *value) || *value < 0.0) {
      return fmt::format("a \"{}\" that is not a number from 0 to 100000", key);
    }
  }
  track.episode = static_cast<int>(episode);
  if (const auto list = object.find("interventions"); list != object.end()) {
    const auto is_pose = [&](const json& number) {
      return number.is_number_unsigned() && number.get<std::uint64_t>() < track.poses.size();
    };
    if (!list->is_array() || !std::ranges::all_of(*list, is_pose)) {
      return "\"interventions\" that are not a list of numbers of poses";
    }
    track.interventions = list->get<std::vector<int>>();
  }
  const auto scans = object.find("scans_cm");
  if (scans == object.end()) return "";
  if (!scans->is_array() || scans->size() != track.poses.size()) {
    return "\"scans_cm\" that are not one list for each pose";
  }
  const auto sensor = object.find("sensor");
  track.beams.emplace();
  if (sensor == object.end() || !IsNumbers(*sensor, 2) || !object.contains("angle_min_rad") ||
      !object.contains("angle_step_rad") ||
      !ReadNumber(object, "angle_min_rad", track.beams->angle_min) ||
      !ReadNumber(object, "angle_step_rad", track.beams->angle_step)) {
    return "scans without a \"sensor\" of two numbers and the beams' angles";
  }
  track.beams->p_RS = {Number((*sensor)[0]), Number((*sensor)[1])};
  for (const json& scan : *scans) {
    if (!IsScan(scan) || scan.size() != scans->front().size()) {
      return "a scan that is not a list of ranges in cm, as long as the first";
    }
    track.scans_cm.push_back(scan.get<std::vector<std::uint16_t>>());
  }
  return "";
}

/// Parses the track of one line, or returns what is wrong with it.
std::variant<EpisodeTrack, std::string> ParseLine(std::string_view line) {
  const json object = base::ParseJson(line);
  if (!object.is_object()) return "not a JSON object";
  const auto course = object.find("course");
  if (course == object.end() || !course->is_string()) return "no \"course\" with a name";
  const auto outcome_text = object.find("outcome");
  if (outcome_text == object.end() || !outcome_text->is_string())
    return "no \"outcome\" with a text";
  const auto outcome = ParseOutcome(outcome_text->get<std::string>());
  if (!outcome) return "an \"outcome\" that is not success, collision, timeout or running";
  const auto poses = object.find("poses");
  if (poses == object.end() || !poses->is_array()) return "no \"poses\" with a list";
  EpisodeTrack track{course->get<std::string>(), *outcome};
  for (const json& pose : *poses) {
    if (!IsNumbers(pose, 3)) return "a pose that is not three numbers [x, y, yaw]";
    track.poses.push_back({{Number(pose[0]), Number(pose[1])}, Number(pose[2])});
  }
  if (std::string fault = ReadOptionalKeys(object, track); !fault.empty()) return fault;
  return track;
}

void PrintScans(const EpisodeTrack& track, std::string& text) {
  const TrackBeams& beams = *track.beams;
  auto out = std::back_inserter(text);
  fmt::format_to(out,
                 ", \"sensor\": [{}, {}], \"angle_min_rad\": {}, \"angle_step_rad\": {}, "
                 "\"scans_cm\": [",
                 beams.p_RS.x, beams.p_RS.y, beams.angle_min, beams.angle_step);
  for (std::size_t i = 0; i < track.scans_cm.size(); ++i) {
    fmt::format_to(out, "{}[{}]", i == 0 ? "" : ", ", fmt::join(track.scans_cm[i], ","));
  }
  text += "]";
}

}  // namespace

std::string PrintEpisodes(std::span<const EpisodeTrack> tracks) {
  std::string text;
  auto out = std::back_inserter(text);
  for (const EpisodeTrack& track : tracks) {
    fmt::format_to(out,
                   "{{\"course\": {}, \"outcome\": \"{}\", \"episode\": {}, \"step_s\": {}, "
                   "\"motion_start_s\": {}, \"poses\": [",
                   json(track.course).dump(), ToString(track.outcome), track.episode, track.step,
                   track.motion_start);
    for (std::size_t i = 0; i < track.poses.size(); ++i) {
      const base::Pose2& pose = track.poses[i];
      fmt::format_to(out, "{}[{}, {}, {}]", i == 0 ? "" : ", ", pose.p.x, pose.p.y, pose.yaw);
    }
    text += "]";
    if (!track.interventions.empty()) {
      fmt::format_to(out, ", \"interventions\": [{}]", fmt::join(track.interventions, ","));
    }
    if (track.beams) PrintScans(track, text);
    text += "}\n";
  }
  return text;
}

std::vector<EpisodeTrack> ParseEpisodes(std::string_view text, std::string_view source) {
  std::vector<EpisodeTrack> tracks;
  for (int line_number = 1; !text.empty(); ++line_number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    auto parsed = ParseLine(line);
    if (const auto* what = std::get_if<std::string>(&parsed)) {
      throw base::Error("{}:{}: not an episode: {}", source, line_number, *what);
    }
    tracks.push_back(std::get<EpisodeTrack>(std::move(parsed)));
  }
  return tracks;
}

std::vector<EpisodeTrack> ReadEpisodes(const std::filesystem::path& path) {
  return ParseEpisodes(base::ReadTextFile(path), path.string());
}

void WriteEpisodes(const std::filesystem::path& path, std::span<const EpisodeTrack> tracks) {
  base::WriteFileAtomically(path, PrintEpisodes(tracks));
}

}  // namespace slalom::sim
