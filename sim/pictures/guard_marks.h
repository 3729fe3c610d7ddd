#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "sim/courses/episode_file.h"

/// Where a guard changed the robot's actions: rings on the line of a drive, in all pictures.

namespace slalom::sim {

/// What the marks are, in the few words that a picture has room for.
inline constexpr std::string_view kGuardMarksMeaning = "guard changed the action";

/// The poses that have a mark: those of `track.interventions`, without those that are nearer than
/// `spacing` [m] to the mark before, which would hide it.
std::vector<std::size_t> GuardMarks(const EpisodeTrack& track, double spacing);

}  // namespace slalom::sim
