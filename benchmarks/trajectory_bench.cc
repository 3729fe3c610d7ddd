#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "planners/mppi/mppi.h"
#include "planners/teb/teb.h"
#include "sim/courses/course_generator.h"

/// Control cycles per second of the local planners that optimise trajectories, each in the middle
/// of generated courses, on one core.

namespace slalom::planners {
namespace {

constexpr int kNumViews = 12;

/// A moment of driving through a course, as the navigator would show it.
struct Moment {
  Costmap costmap;
  std::vector<base::Vec2> path;
  base::Pose2 X_OR;
};

/// The robot a third of the way along the course's reference path, all cylinders known.
Moment MakeMoment(const sim::Course& course) {
  const auto& way = course.reference_path_W;
  const std::size_t at = way.size() / 3;
  const base::Vec2 p = way[at];
  const base::Vec2 ahead = way[at + 3] - p;
  Moment moment{Costmap(200, 200, 0.05, p - base::Vec2{5.0, 5.0}),
                {way.begin() + static_cast<std::ptrdiff_t>(at), way.end()},
                {p, std::atan2(ahead.y, ahead.x)}};
  for (int y = 0; y < moment.costmap.size_y(); ++y) {
    for (int x = 0; x < moment.costmap.size_x(); ++x) {
      const base::Vec2 centre = moment.costmap.CentreOf({x, y});
      for (const sim::Circle& circle : course.circles) {
        if (base::Norm(circle.p_W - centre) < circle.radius) {
          moment.costmap.set_cost({x, y}, kLethalCost);
        }
      }
    }
  }
  return moment;
}

const std::vector<Moment>& Moments() {
  static const std::vector<Moment> moments = [] {
    std::vector<Moment> made;
    for (const auto& course : sim::GenerateFreshCourses(1, kNumViews).courses) {
      made.push_back(MakeMoment(*course));
    }
    return made;
  }();
  return moments;
}

void RunCycles(benchmark::State& state, LocalPlanner& planner) {
  planner.Reset(1);
  std::size_t i = 0;
  std::int64_t num_commands = 0;
  for (auto _ : state) {
    const Moment& moment = Moments()[i++ / 20 % kNumViews];
    const LocalView view{moment.X_OR, {0.5, 0.0}, moment.costmap,
                         moment.path, false,      moment.path.back()};
    num_commands += planner.ComputeCommand(view).has_value();
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["commands_per_cycle"] =
      static_cast<double>(num_commands) / static_cast<double>(state.iterations());
}

/// Arguments: rollouts, steps of a rollout. Nav2's are 1000 of 56.
void BM_MppiCycles(benchmark::State& state) {
  MppiConfig config;
  config.batch_size = static_cast<int>(state.range(0));
  config.num_steps = static_cast<int>(state.range(1));
  MppiPlanner planner(config);
  RunCycles(state, planner);
}
BENCHMARK(BM_MppiCycles)
    ->Args({1000, 30})
    ->Args({1000, 56})
    ->Args({2000, 56})
    ->Unit(benchmark::kMillisecond);

/// Argument: homotopy classes at most.
void BM_TebCycles(benchmark::State& state) {
  TebConfig config;
  config.homotopy.max_classes = static_cast<int>(state.range(0));
  TebPlanner planner(config);
  RunCycles(state, planner);
}
BENCHMARK(BM_TebCycles)->Arg(1)->Arg(4)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace slalom::planners
