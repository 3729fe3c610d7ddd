#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry.h"
#include "env/episode.h"

namespace slalom::sim {

/// Directions of the beams of a track's scans: beam k leaves the sensor at angle_min + k
/// angle_step.
struct TrackBeams {
  base::Vec2 p_RS;          ///< The sensor in the robot's frame, [m].
  double angle_min = 0.0;   ///< Angle of the first beam, counter-clockwise from ahead, [rad].
  double angle_step = 0.0;  ///< [rad]

  friend bool operator==(const TrackBeams&, const TrackBeams&) = default;
};

/// Poses of the robot in one episode and, optionally, its scans, for pictures and later study. A
/// value.
struct EpisodeTrack {
  std::string course;  ///< Name of the course.
  env::Outcome outcome = env::Outcome::kRunning;
  std::vector<base::Pose2> poses{};   ///< X_WR at the start and after each control step.
  int episode = 0;                    ///< Number of the episode on its course.
  double step = 0.0;                  ///< Time between poses, [s]; 0 if not known.
  double motion_start = 0.0;          ///< Moving obstacles' clock at the first pose, [s].
  std::vector<int> interventions{};   ///< Poses from which a guard changed the action, in order.
  std::optional<TrackBeams> beams{};  ///< Set if the scans were kept.
  std::vector<std::vector<std::uint16_t>> scans_cm{};  ///< One per pose, alike in size, [cm].

  friend bool operator==(const EpisodeTrack&, const EpisodeTrack&) = default;
};

/// Prints the tracks as JSON lines, one object each, with exact numbers. An object, shown here on
/// several lines:
///
///     {"course": "barn-007", "outcome": "success", "episode": 0, "step_s": 0.2,
///      "motion_start_s": 0, "poses": [[-2.0, 3.0, 1.57], ...], "interventions": [3, 4],
///      "sensor": [0.12, 0], "angle_min_rad": -2.35619, "angle_step_rad": 0.05243,
///      "scans_cm": [[120, 131, ...], ...]}
///
/// An outcome is success, collision, timeout or running. A pose is x [m], y [m], yaw [rad].
/// Interventions are there only if a guard changed actions, and are the numbers of the poses where;
/// the last four keys only if scans were kept. Readers require course, outcome and poses.
std::string PrintEpisodes(std::span<const EpisodeTrack> tracks);

/// Parses the tracks in `text`. Ignores unknown keys and blank lines. Throws `Error` that names
/// `source` and the line if a line is not such an object.
std::vector<EpisodeTrack> ParseEpisodes(std::string_view text, std::string_view source);

/// Reads a file of tracks, or writes one atomically. Both throw `Error` if that fails.
std::vector<EpisodeTrack> ReadEpisodes(const std::filesystem::path& path);
void WriteEpisodes(const std::filesystem::path& path, std::span<const EpisodeTrack> tracks);

}  // namespace slalom::sim
