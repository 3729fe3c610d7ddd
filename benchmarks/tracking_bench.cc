#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "env/sensing/obstacle_tracker.h"
#include "planners/guard/shield.h"
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
      env::ObstacleTracker tracker(walk.geometry(), test::ScanWalk::kStep);
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

/// The shield's step besides, for a robot that is told to go on as it walks: `worst_us` is the
/// longest, and `changed` the share of the steps that end with another command.
void Evade(benchmark::State& state, const std::string& courses) {
  const sim::CourseSet set = sim::ResolveCourses(courses, std::nullopt, 1);
  std::int64_t num_scans = 0, num_changed = 0;
  double worst = 0.0;
  for (auto _ : state) {
    state.PauseTiming();
    for (const auto& course : set.courses) {
      test::ScanWalk walk(*course, 1);
      env::ObstacleTracker tracker(walk.geometry(), test::ScanWalk::kStep);
      Shield shield({.shield = true, .tracking = true}, {}, walk.geometry(), {},
                    test::ScanWalk::kStep);
      while (walk.Step()) {
        tracker.Update(walk.ranges_cm(), walk.odometry());
        state.ResumeTiming();
        const auto begin = std::chrono::steady_clock::now();
        shield.See(walk.ranges_cm(), {walk.odometry(), 1.25, 0.0}, tracker.tracks());
        num_changed += shield.Choose({1.25, 0.0}).changed;
        const std::chrono::duration<double, std::micro> took =
            std::chrono::steady_clock::now() - begin;
        state.PauseTiming();
        worst = std::max(worst, took.count());
        ++num_scans;
      }
    }
    state.ResumeTiming();
  }
  state.SetItemsProcessed(num_scans);
  state.counters["worst_us"] = worst;
  state.counters["changed"] = static_cast<double>(num_changed) / static_cast<double>(num_scans);
}

BENCHMARK_CAPTURE(TrackObstacles, boxes, "generated-box:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, walls, "generated-wall:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, crowds, "generated-crowds:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, cylinders, "generated-cylinders:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, static, "generated:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, rooms, "generated-rooms:4711:20");
BENCHMARK_CAPTURE(TrackObstacles, halls, "generated-halls:4711:20");

BENCHMARK_CAPTURE(Evade, boxes, "generated-box:4711:20");
BENCHMARK_CAPTURE(Evade, crowds, "generated-crowds:4711:20");
BENCHMARK_CAPTURE(Evade, static, "generated:4711:20");

}  // namespace
}  // namespace slalom::planners
