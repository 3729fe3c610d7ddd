#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "planners/guard/shield.h"
#include "planners/navigation/navigator.h"
#include "planners/planner_agent.h"
#include "sim/courses/course_generator.h"
#include "sim/environments.h"

/// Speed of the classical systems on a robot's observations on generated courses of all recipes:
/// `items_per_second` is control cycles/s, map updates/s, plans/s or steps/s as the name says.

namespace slalom::planners {
namespace {

constexpr int kNumCourses = 12;
constexpr int kMaxSteps = 600;  // 30 s at 20 Hz, about an episode of DWA.

/// One robot's senses at one control step.
struct Moment {
  std::vector<std::uint16_t> ranges_cm;
  base::Pose2 X_OR;
  Twist velocity;
  bool first = false;
  base::Vec2 goal_R;
};

/// Records the observations of a system that drives the courses one after the other.
std::vector<Moment> Record(const std::string& name) {
  sim::EnvironmentConfig config;
  config.episode.step = 0.05;
  config.robot.control_rate = 100.0;
  config.episode.max_steps = kMaxSteps;
  sim::CourseEnvironments environments(
      config, sim::MakeScenes(sim::GenerateFreshCourses(1, kNumCourses)), 1, nullptr);
  PlannerAgent agent(name, {}, {}, config.action, config.episode.step, nullptr);
  std::vector<env::Action> actions(1);
  std::vector<env::StepResult> results(1);
  std::vector<Moment> moments;
  for (int course = 0; course < kNumCourses; ++course) {
    environments.Reset(0, {course, 1});
    results[0] = {};
    while (!results[0].ended()) {
      const env::ObservationBatch& o = environments.observations();
      const auto frame = o.frame(0);
      moments.push_back({{frame.ranges_cm.begin(), frame.ranges_cm.end()},
                         o.odometry[0].X_OR,
                         {o.odometry[0].linear, o.odometry[0].angular},
                         o.first[0] != 0,
                         {frame.state[0], frame.state[1]}});
      agent.Act(o, env::NumbersOf(actions));
      environments.Step(env::NumbersOf(actions), results);
    }
  }
  return moments;
}

/// The whole navigation system of one robot, one cycle an iteration.
void BM_ControlCycle(benchmark::State& state, const std::string& name) {
  const std::vector<Moment> moments = Record(name);
  const PlannersConfig config;
  Navigator navigator(config.navigation, NavigationOf(name, config), {}, 0.05,
                      MakeLocalPlanner(name, config));
  std::size_t i = 0;
  for (auto _ : state) {
    const Moment& m = moments[i];
    if (m.first) navigator.Reset(m.X_OR, base::Transform(m.X_OR, m.goal_R), 1);
    benchmark::DoNotOptimize(navigator.Step(m.ranges_cm, m.X_OR, m.velocity));
    i = (i + 1) % moments.size();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(BM_ControlCycle, dwa, "dwa");
BENCHMARK_CAPTURE(BM_ControlCycle, eband, "eband");
BENCHMARK_CAPTURE(BM_ControlCycle, teb, "teb");
BENCHMARK_CAPTURE(BM_ControlCycle, mppi, "mppi");

void BM_MapUpdate(benchmark::State& state, const ObstacleMapConfig& config) {
  static const std::vector<Moment> moments = Record("dwa");
  ObstacleMap map(config, PaddedFootprint(FootprintConfig{}));
  const env::ScanProjector projector({});
  env::ScanRays rays;
  std::size_t i = 0;
  for (auto _ : state) {
    const Moment& m = moments[i];
    if (m.first) map.Reset(m.X_OR.p);
    projector.Project(m.ranges_cm, m.X_OR, rays);
    benchmark::DoNotOptimize(map.Update(rays, m.X_OR));
    i = (i + 1) % moments.size();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(BM_MapUpdate, local, ObstacleMapConfig{});
BENCHMARK_CAPTURE(BM_MapUpdate, global, ObstacleMapConfig{.num_cells = 800, .rolling = false});

/// A plan on the global map per control cycle, without map updates. `anew`: each plan starts from
/// nothing.
void BM_Plan(benchmark::State& state, bool anew) {
  static const std::vector<Moment> moments = Record("dwa");
  ObstacleMap map({.num_cells = 800, .rolling = false}, PaddedFootprint(FootprintConfig{}));
  GlobalPlanner planner;
  const env::ScanProjector projector({});
  env::ScanRays rays;
  base::Vec2 goal_O;
  std::size_t i = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const Moment& m = moments[i];
    if (m.first) {
      map.Reset(m.X_OR.p);
      goal_O = base::Transform(m.X_OR, m.goal_R);
    }
    if (m.first || anew) planner.Reset();
    CellWindow changed;
    if (i % 2 == 0) {
      projector.Project(m.ranges_cm, m.X_OR, rays);
      changed = map.Update(rays, m.X_OR);
    }
    state.ResumeTiming();
    benchmark::DoNotOptimize(planner.Plan(map.costmap(), changed, m.X_OR.p, goal_O).size());
    i = (i + 1) % moments.size();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(BM_Plan, as_navigator, false);
BENCHMARK_CAPTURE(BM_Plan, from_nothing, true);

/// A step of the shield at 5 Hz. `full_speed`: the command is always full speed ahead, so that few
/// steps end with the first look; else it is what the robot does. `worst_us`: the longest step.
void BM_Shield(benchmark::State& state, bool full_speed) {
  static const std::vector<Moment> moments = Record("mppi");
  Shield shield({.shield = true}, {}, {}, {}, 0.2);
  double worst = 0.0;
  int num_changed = 0;
  std::size_t i = 0;
  for (auto _ : state) {
    const Moment& m = moments[i];
    if (m.first) shield.Reset();
    const auto begin = std::chrono::steady_clock::now();
    shield.See(m.ranges_cm, {m.X_OR, m.velocity.linear, m.velocity.angular});
    num_changed += shield.Choose(full_speed ? Twist{2.0, 0.0} : m.velocity).changed;
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
    worst = std::max(worst, took.count());
    i = (i + 1) % moments.size();
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["worst_us"] = worst;
  state.counters["changed"] = static_cast<double>(num_changed) / state.iterations();
}
BENCHMARK_CAPTURE(BM_Shield, as_driven, false);
BENCHMARK_CAPTURE(BM_Shield, full_speed, true);

}  // namespace
}  // namespace slalom::planners
