#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>

#include "planners/localisation/scan_matcher.h"
#include "sim/courses/course_sets.h"
#include "tests/support/scan_walk.h"

/// Scan matching on walks of up to `way` metres under the drift of configs/real-robot.toml:
/// `items_per_second` is scans/s, and the counters are mean errors of the pose at the end, [m] and
/// [rad], over eight walks on each course.

namespace slalom::planners {
namespace {

void Match(benchmark::State& state, const std::string& courses) {
  constexpr int kNumWalks = 8;
  const auto way = static_cast<double>(state.range(0));
  const sim::CourseSet set = sim::ResolveCourses(courses, std::nullopt, 1);
  double odometry = 0.0, matched = 0.0, odometry_turn = 0.0, matched_turn = 0.0, num_walks = 0.0;
  std::int64_t num_scans = 0;
  for (auto _ : state) {
    state.PauseTiming();
    odometry = matched = odometry_turn = matched_turn = num_walks = 0.0;
    for (const auto& course : set.courses) {
      for (int seed = 0; seed < kNumWalks; ++seed) {
        test::ScanWalk walk(*course, seed);
        ScanMatcher matcher(walk.geometry());
        base::Pose2 found;
        while (walk.way() < way && walk.Step()) {
          state.ResumeTiming();
          found = matcher.Match(walk.ranges_cm(), walk.odometry());
          state.PauseTiming();
          ++num_scans;
        }
        const base::Pose2 truth = walk.truth();
        odometry += base::Norm(walk.odometry().p - truth.p);
        matched += base::Norm(found.p - truth.p);
        odometry_turn += std::abs(base::WrapAngle(walk.odometry().yaw - truth.yaw));
        matched_turn += std::abs(base::WrapAngle(found.yaw - truth.yaw));
        ++num_walks;
      }
    }
    state.ResumeTiming();
  }
  state.SetItemsProcessed(num_scans);
  state.counters["odometry_m"] = odometry / num_walks;
  state.counters["matched_m"] = matched / num_walks;
  state.counters["odometry_rad"] = odometry_turn / num_walks;
  state.counters["matched_rad"] = matched_turn / num_walks;
}

BENCHMARK_CAPTURE(Match, real_world_3, "real-world-3")->ArgName("way")->Arg(10)->Arg(20)->Arg(32);
BENCHMARK_CAPTURE(Match, static, "generated:4711:20")->ArgName("way")->Arg(100);
BENCHMARK_CAPTURE(Match, rooms, "generated-rooms:4711:20")->ArgName("way")->Arg(100);
BENCHMARK_CAPTURE(Match, halls, "generated-halls:4711:20")->ArgName("way")->Arg(100);
BENCHMARK_CAPTURE(Match, crowds, "generated-crowds:4711:20")->ArgName("way")->Arg(100);
BENCHMARK_CAPTURE(Match, cylinders, "generated-cylinders:4711:20")->ArgName("way")->Arg(100);

}  // namespace
}  // namespace slalom::planners
