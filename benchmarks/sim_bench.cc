#include <benchmark/benchmark.h>
#include <box2d/box2d.h>

#include <algorithm>
#include <memory>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "sim/courses/course_generator.h"
#include "sim/courses/dynamic_generator.h"
#include "sim/environments.h"

/// Simulator speed: whole environment steps, and its parts beside a stock Box2D program.
/// `items_per_second` is environment steps/s, scans/s or control steps/s as the name says.

namespace slalom::sim {
namespace {

constexpr int kNumCourses = 96;
constexpr int kBatch = 64;

const std::vector<std::shared_ptr<const Scene>>& StaticScenes() {
  static const std::vector<std::shared_ptr<const Scene>> scenes =
      MakeScenes(GenerateFreshCourses(1, kNumCourses));
  return scenes;
}

EnvironmentConfig BenchConfig() {
  EnvironmentConfig config;
  config.episode.start_position_jitter = 0.05;
  config.episode.start_yaw_jitter = 0.05;
  return config;
}

/// Steers towards the goal and away from the nearer side, so that episodes reach all parts of the
/// field.
env::Action Steer(const env::FrameView& frame, base::Random& random) {
  const int num_beams = static_cast<int>(frame.ranges_cm.size());
  int left = 500, right = 500;
  for (int i = num_beams / 4; i < 3 * num_beams / 4; i += 8) {
    int& side = i < num_beams / 2 ? right : left;
    side = std::min<int>(side, frame.ranges_cm[i]);
  }
  const float goal = std::clamp(frame.state[1] / std::max(frame.state[0], 0.5f), -1.0f, 1.0f);
  const float away = static_cast<float>(left - right) / static_cast<float>(left + right + 1);
  const float nearest = static_cast<float>(std::min(left, right));
  return {std::clamp(nearest / 100.0f - 0.4f, -0.2f, 0.8f),
          std::clamp(0.3f * goal + 0.8f * away + static_cast<float>(random.Uniform(-0.2, 0.2)),
                     -1.0f, 1.0f)};
}

/// Poses met in driving with `Steer`, for the benchmarks of single parts.
struct MetPose {
  const Scene* scene;
  base::Pose2 X_WR;
};

std::vector<MetPose> DrivenPoses() {
  CourseEnvironments environments(BenchConfig(), StaticScenes(), kNumCourses, nullptr);
  base::Random random(2);
  std::vector<env::Action> actions(kNumCourses);
  std::vector<env::StepResult> results(kNumCourses);
  std::vector<MetPose> poses;
  for (int i = 0; i < kNumCourses; ++i) environments.Reset(i, {i, static_cast<std::uint64_t>(i)});
  for (int step = 0; step < 40; ++step) {
    for (int i = 0; i < kNumCourses; ++i) {
      poses.push_back({StaticScenes()[i].get(), environments.robot_pose(i)});
      actions[i] = Steer(environments.observations().frame(i), random);
    }
    environments.Step(env::NumbersOf(actions), results);
    for (int i = 0; i < kNumCourses; ++i) {
      if (results[i].ended()) environments.Reset(i, {i, random.NextU64()});
    }
  }
  return poses;
}

void StepEnvironments(benchmark::State& state, const EnvironmentConfig& config,
                      Robot::Stepping stepping,
                      const std::vector<std::shared_ptr<const Scene>>& scenes = StaticScenes()) {
  base::ParallelFor parallel(static_cast<int>(state.range(0)));
  CourseEnvironments environments(config, scenes, kBatch, &parallel, MakeRobots(stepping));
  std::vector<base::Random> random;  // One for each environment: threads share nothing.
  for (int i = 0; i < kBatch; ++i)
    random.emplace_back(base::DeriveSeed(3, "environment", {static_cast<std::uint64_t>(i)}));
  std::vector<env::Action> actions(kBatch);
  std::vector<env::StepResult> results(kBatch);
  const auto reset = [&](int i) {
    environments.Reset(i,
                       {static_cast<int>(random[i].UniformInt(kNumCourses)), random[i].NextU64()});
  };
  for (int i = 0; i < kBatch; ++i) reset(i);
  std::int64_t collisions = 0;
  for (auto _ : state) {
    parallel.For(kBatch / 8, [&](int group) {
      for (int i = 8 * group; i < 8 * group + 8; ++i) {
        if (results[i].ended()) reset(i);
        actions[i] = Steer(environments.observations().frame(i), random[i]);
      }
    });
    environments.Step(env::NumbersOf(actions), results);
    for (const env::StepResult& result : results) {
      collisions += result.outcome == env::Outcome::kCollision;
    }
  }
  state.SetItemsProcessed(state.iterations() * kBatch);
  state.counters["collisions_per_1000_steps"] =
      1000.0 * static_cast<double>(collisions) / static_cast<double>(state.iterations() * kBatch);
}

/// 1, 2, 4 ... threads, and as many as the machine has cores.
void UpToAllCores(benchmark::internal::Benchmark* bench) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  for (int threads = 1; threads < cores; threads *= 2) bench->Arg(threads);
  bench->Arg(std::max(cores, 1));
}

/// All of it: body at 50 Hz, 720 beams, noise, resets and a steering rule. Argument: threads, which
/// share all of this.
void BM_EnvironmentSteps(benchmark::State& state) {
  StepEnvironments(state, BenchConfig(), Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_EnvironmentSteps)->Apply(UpToAllCores)->UseRealTime();

/// With the other laws of friction.
void BM_EnvironmentStepsPyramid(benchmark::State& state) {
  EnvironmentConfig config = BenchConfig();
  config.robot.friction = FrictionLaw::kPyramid;
  StepEnvironments(state, config, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_EnvironmentStepsPyramid)->Arg(1)->UseRealTime();

void BM_EnvironmentStepsGazebo(benchmark::State& state) {
  EnvironmentConfig config = BenchConfig();
  config.robot.friction = FrictionLaw::kGazebo;
  StepEnvironments(state, config, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_EnvironmentStepsGazebo)->Apply(UpToAllCores)->UseRealTime();

/// With delay, friction, noise and mounting drawn for each episode, robots of three laws together.
void BM_EnvironmentStepsRandomized(benchmark::State& state) {
  EnvironmentConfig config = BenchConfig();
  config.randomize = {{"lidar.noise_std", {"[0.0, 0.04]", ""}},
                      {"lidar.offset_x", {"[-0.1, 0.12]", ""}},
                      {"robot.command_delay", {"[0.0, 0.12]", ""}},
                      {"robot.friction", {"['cone', 'pyramid', 'gazebo']", ""}},
                      {"robot.wheel_friction", {"[0.3, 0.7]", ""}}};
  StepEnvironments(state, config, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_EnvironmentStepsRandomized)->Arg(1)->UseRealTime();

/// With the ideal drive.
void BM_EnvironmentStepsIdealDrive(benchmark::State& state) {
  EnvironmentConfig config = BenchConfig();
  config.robot.drive = sim::DriveKind::kIdeal;
  StepEnvironments(state, config, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_EnvironmentStepsIdealDrive)->Arg(1)->UseRealTime();

/// Among moving obstacles.
void BM_EnvironmentStepsDynamicBox(benchmark::State& state) {
  StepEnvironments(state, BenchConfig(), Robot::Stepping::kBox2dInContact,
                   MakeScenes(GenerateFreshBoxCourses(1, kNumCourses)));
}
BENCHMARK(BM_EnvironmentStepsDynamicBox)->Arg(1)->UseRealTime();

void BM_EnvironmentStepsDynamicWall(benchmark::State& state) {
  StepEnvironments(state, BenchConfig(), Robot::Stepping::kBox2dInContact,
                   MakeScenes(GenerateFreshWallCourses(1, kNumCourses)));
}
BENCHMARK(BM_EnvironmentStepsDynamicWall)->Arg(1)->UseRealTime();

/// With two beams, which is without LiDAR (the steering rule then steers by the goal alone).
void BM_EnvironmentStepsWithoutLidar(benchmark::State& state) {
  EnvironmentConfig config = BenchConfig();
  config.lidar.num_beams = 2;
  StepEnvironments(state, config, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_EnvironmentStepsWithoutLidar)->Arg(1)->Arg(2)->UseRealTime();

/// With every rigid-body step done by Box2D: the same results.
void BM_EnvironmentStepsBox2dAlways(benchmark::State& state) {
  StepEnvironments(state, BenchConfig(), Robot::Stepping::kBox2dAlways);
}
BENCHMARK(BM_EnvironmentStepsBox2dAlways)->Arg(1)->UseRealTime();

void BM_LidarScans(benchmark::State& state) {
  const std::vector<MetPose> poses = DrivenPoses();
  const EnvironmentConfig config;
  const Lidar lidar(config.lidar, config.observation.range_clip);
  base::Random noise(4);
  std::vector<std::uint16_t> ranges(config.lidar.num_beams);
  std::size_t i = 0;
  for (auto _ : state) {
    const MetPose& pose = poses[i++ % poses.size()];
    lidar.Scan(pose.scene->collision_map(), pose.X_WR, noise, ranges);
    benchmark::DoNotOptimize(ranges.data());
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_LidarScans);

/// A world as a program without a LiDAR of its own uses it: 720 calls of b2World::RayCast a scan,
/// no noise.
class StockWorld {
 public:
  explicit StockWorld(const Course& course) : world_(b2Vec2(0.0f, 0.0f)) {
    b2BodyDef definition;
    b2Body* const body = world_.CreateBody(&definition);
    for (const Circle& circle : course.circles) {
      b2CircleShape shape;
      shape.m_p.Set(static_cast<float>(circle.p_W.x), static_cast<float>(circle.p_W.y));
      shape.m_radius = static_cast<float>(circle.radius);
      body->CreateFixture(&shape, 0.0f);
    }
    world_.Step(0.0f, 1, 1);
  }

  float Cast(b2Vec2 from, b2Vec2 to) const {
    NearestHit nearest;
    world_.RayCast(&nearest, from, to);
    return nearest.fraction;
  }

 private:
  struct NearestHit : b2RayCastCallback {
    float ReportFixture(b2Fixture*, const b2Vec2&, const b2Vec2&, float hit) override {
      fraction = hit;
      return hit;
    }
    float fraction = 1.0f;
  };

  b2World world_;
};

void BM_StockBox2dScans(benchmark::State& state) {
  const std::vector<MetPose> poses = DrivenPoses();
  std::vector<std::unique_ptr<StockWorld>> worlds(kNumCourses);
  for (int i = 0; i < kNumCourses; ++i) {
    worlds[i] = std::make_unique<StockWorld>(StaticScenes()[i]->course());
  }
  const EnvironmentConfig config;
  const Lidar lidar(config.lidar, config.observation.range_clip);
  const double reach = config.observation.range_clip;
  std::vector<float> ranges(config.lidar.num_beams);
  std::size_t i = 0;
  for (auto _ : state) {
    const std::size_t index = i++ % poses.size();
    const base::Pose2& X_WR = poses[index].X_WR;
    const base::Vec2 from = base::Transform(X_WR, {config.lidar.offset_x, 0.0});
    const b2Vec2 start(static_cast<float>(from.x), static_cast<float>(from.y));
    for (int beam = 0; beam < config.lidar.num_beams; ++beam) {
      const auto [s, c] = base::SinCos(X_WR.yaw + lidar.beam_angle(beam));
      const b2Vec2 end(static_cast<float>(from.x + reach * c),
                       static_cast<float>(from.y + reach * s));
      ranges[beam] = worlds[index % kNumCourses]->Cast(start, end);
    }
    benchmark::DoNotOptimize(ranges.data());
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_StockBox2dScans);

/// Body and drive alone, eight robots together, on one course, without collision's resets. Items
/// are control steps.
void DriveOnly(benchmark::State& state, FrictionLaw law, Robot::Stepping stepping) {
  EnvironmentConfig config;
  config.robot.friction = law;
  const Scene& scene = *StaticScenes().front();
  std::vector<Robot> robots(SkidLanes::kSize, Robot(config.robot, NumSubsteps(config), stepping));
  for (Robot& robot : robots) robot.Reset(scene.course().start);
  base::Random random(5);
  std::vector<Robot::Order> orders(robots.size());
  for (auto _ : state) {
    for (std::size_t i = 0; i < robots.size(); ++i) {
      if (orders[i].touched) robots[i].Reset(scene.course().start);
      orders[i] = {.robot = &robots[i],
                   .scene = &scene,
                   .linear = random.Uniform(-1.0, 2.0),
                   .angular = random.Uniform(-3.0, 3.0)};
    }
    robots.front().DriveTogether(orders);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(robots.size()));
}
void BM_Drive(benchmark::State& state) {
  DriveOnly(state, FrictionLaw::kCone, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_Drive);
void BM_DrivePyramid(benchmark::State& state) {
  DriveOnly(state, FrictionLaw::kPyramid, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_DrivePyramid);
void BM_DriveGazebo(benchmark::State& state) {
  DriveOnly(state, FrictionLaw::kGazebo, Robot::Stepping::kBox2dInContact);
}
BENCHMARK(BM_DriveGazebo);
void BM_DriveBox2dAlways(benchmark::State& state) {
  DriveOnly(state, FrictionLaw::kCone, Robot::Stepping::kBox2dAlways);
}
BENCHMARK(BM_DriveBox2dAlways);

}  // namespace
}  // namespace slalom::sim
