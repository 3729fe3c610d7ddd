#include "sim/episode_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <variant>

#include "base/error.h"
#include "base/file.h"

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

bool IsPose(const json& value) {
  if (!value.is_array() || value.size() != 3) return false;
  for (const json& number : value) {
    if (!number.is_number() || !(std::abs(number.get<double>()) <= 1e5)) return false;
  }
  return true;
}

/// The track of one line, or what is wrong with it.
std::variant<EpisodeTrack, std::string> ParseLine(std::string_view line) {
  const json object = json::parse(line, nullptr, /*allow_exceptions=*/false);
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
  EpisodeTrack track{course->get<std::string>(), *outcome, {}};
  for (const json& pose : *poses) {
    if (!IsPose(pose)) return "a pose that is not three numbers [x, y, yaw]";
    track.poses.push_back({{pose[0].get<double>(), pose[1].get<double>()}, pose[2].get<double>()});
  }
  return track;
}

}  // namespace

std::string PrintEpisodes(std::span<const EpisodeTrack> tracks) {
  std::string text;
  auto out = std::back_inserter(text);
  for (const EpisodeTrack& track : tracks) {
    fmt::format_to(out, "{{\"course\": {}, \"outcome\": \"{}\", \"poses\": [",
                   json(track.course).dump(), ToString(track.outcome));
    for (std::size_t i = 0; i < track.poses.size(); ++i) {
      const base::Pose2& pose = track.poses[i];
      fmt::format_to(out, "{}[{}, {}, {}]", i == 0 ? "" : ", ", pose.p.x, pose.p.y, pose.yaw);
    }
    text += "]}\n";
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
      throw base::Error(fmt::format("{}:{}: not an episode: {}", source, line_number, *what));
    }
    tracks.push_back(std::get<EpisodeTrack>(std::move(parsed)));
  }
  return tracks;
}

std::vector<EpisodeTrack> ReadEpisodes(const std::filesystem::path& path) {
  return ParseEpisodes(base::ReadFile(path), path.string());
}

void WriteEpisodes(const std::filesystem::path& path, std::span<const EpisodeTrack> tracks) {
  base::WriteFileAtomically(path, PrintEpisodes(tracks));
}

}  // namespace slalom::sim
