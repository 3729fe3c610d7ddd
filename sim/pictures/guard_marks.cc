#include "sim/pictures/guard_marks.h"

#include "base/geometry.h"

namespace slalom::sim {

std::vector<std::size_t> GuardMarks(const EpisodeTrack& track, double spacing) {
  std::vector<std::size_t> marks;
  for (const int number : track.interventions) {
    const auto i = static_cast<std::size_t>(number);
    if (!marks.empty() && base::Norm(track.poses[i].p - track.poses[marks.back()].p) < spacing) {
      continue;
    }
    marks.push_back(i);
  }
  return marks;
}

}  // namespace slalom::sim
