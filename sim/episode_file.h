#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry.h"
#include "env/episode.h"

namespace slalom::sim {

/// Where the robot was in one episode, for pictures and later study. A value.
struct EpisodeTrack {
  std::string course;  ///< Name of the course.
  env::Outcome outcome = env::Outcome::kRunning;
  std::vector<base::Pose2> poses;  ///< X_WR at the start and after each control step.

  friend bool operator==(const EpisodeTrack&, const EpisodeTrack&) = default;
};

/// The tracks as JSON lines, one object each, numbers exact:
///
///     {"course": "barn-007", "outcome": "success", "poses": [[-2.0, 3.0, 1.57], ...]}
///
/// outcome: success, collision, timeout or running; pose: x [m], y [m], yaw [rad].
std::string PrintEpisodes(std::span<const EpisodeTrack> tracks);

/// The tracks in `text`. Other keys of an object are passed over, blank lines too. Throws `Error`
/// that names `source` and line where a line is not such an object.
std::vector<EpisodeTrack> ParseEpisodes(std::string_view text, std::string_view source);

/// Reads or atomically writes a file of them. Throw `Error` where that fails.
std::vector<EpisodeTrack> ReadEpisodes(const std::filesystem::path& path);
void WriteEpisodes(const std::filesystem::path& path, std::span<const EpisodeTrack> tracks);

}  // namespace slalom::sim
