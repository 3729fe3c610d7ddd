#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "planners/tracking/obstacle_tracker.h"
#include "sim/courses/course_sets.h"
#include "tests/support/scan_walk.h"
#include "tests/support/seen_obstacles.h"

/// Tracking on walks beside the truth: `items_per_second` is scans/s. An obstacle counts if at
/// least five beams hit it in three scans in turn. `missed` and `false` are shares of such
/// obstacles, and of tracks; the counters besides are mean errors of the place of the others, [m],
/// of their velocity, and of what standing still would say in place of it, [m/s].

namespace slalom::planners {
namespace {

void TrackObstacles(benchmark::State& state, const std::string& courses) {
  const sim::CourseSet set = sim::ResolveCourses(courses, std::nullopt, 1);
  test::TrackingErrors errors;
  std::int64_t num_scans = 0;
  for (auto _ : state) {
    state.PauseTiming();
    errors = {};
    for (const auto& course : set.courses) {
      test::ScanWalk walk(*course, 1);
      ObstacleTracker tracker(walk.geometry(), test::ScanWalk::kStep);
      test::SeenObstacles seen(walk);
      while (walk.Step()) {
        state.ResumeTiming();
        tracker.Update(walk.ranges_cm(), walk.odometry());
        state.PauseTiming();
        ++num_scans;
        seen.Look();
        errors.Add(seen, walk, tracker.tracks());
      }
    }
    state.ResumeTiming();
  }
  state.SetItemsProcessed(num_scans);
  state.counters["missed"] = errors.num_missed / errors.num_obstacles;
  state.counters["false"] = errors.num_false / errors.num_tracks;
  state.counters["tracks"] = errors.num_tracks / static_cast<double>(num_scans);
  state.counters["place_m"] = errors.place / errors.num_found;
  state.counters["velocity_mps"] = errors.velocity / errors.num_found;
  state.counters["speed_mps"] = errors.speed / errors.num_found;
}

BENCHMARK_CAPTURE(TrackObstacles, boxes, "generated-box:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, walls, "generated-wall:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, crowds, "generated-crowds:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, cylinders, "generated-cylinders:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, static, "generated:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, rooms, "generated-rooms:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, halls, "generated-halls:4711:20");

}  // namespace
}  // namespace slalom::planners
