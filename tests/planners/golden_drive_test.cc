// One number for everything that a planner computes: the same in debug and release, from run to
// run.

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/config_field.h"
#include "planners/guard/guarded_agent.h"
#include "planners/navigation/navigator.h"
#include "planners/planner_registry.h"

namespace slalom::planners {
namespace {

using Posts = std::vector<base::Vec2>;  ///< Centres of posts of 0.1 m radius, [m].

/// Posts on the way from (0, 0) to (8, 0).
const Posts kSlalom = {{1.5, 0.2}, {2.2, -0.9}, {3.0, 0.9},  {3.4, -0.3},
                       {4.4, 0.1}, {4.9, 1.1},  {5.6, -0.6}, {6.3, 0.5}};

/// Posts all round, with room to turn in the middle, and those of the slalom.
Posts ShutInAt(base::Vec2 p_O) {
  Posts posts = kSlalom;
  for (int i = 0; i < 32; ++i) {
    const auto [s, c] = base::SinCos(i * base::kPi / 16);
    posts.push_back(p_O + base::Vec2{0.8 * c, 0.8 * s});
  }
  return posts;
}

/// Ranges to the posts, [cm].
std::vector<std::uint16_t> Scan(const env::ScanGeometry& geometry, const Posts& posts,
                                const base::Pose2& X_OR) {
  const base::Vec2 sensor_O = base::Transform(X_OR, geometry.p_RS);
  std::vector<std::uint16_t> ranges;
  for (int beam = 0; beam < geometry.num_beams; ++beam) {
    const double angle =
        X_OR.yaw +
        geometry.field_of_view * (static_cast<double>(beam) / (geometry.num_beams - 1) - 0.5);
    const auto [s, c] = base::SinCos(angle);
    double range = geometry.clip;
    for (const base::Vec2 post : posts) {
      const base::Vec2 d = post - sensor_O;
      const double along = base::Dot(d, {c, s}), across = base::Cross(d, {c, s});
      const double half_chord2 = 0.01 - across * across;
      if (along > 0.0 && half_chord2 > 0.0) range = std::min(range, along - std::sqrt(half_chord2));
    }
    ranges.push_back(static_cast<std::uint16_t>(std::lround(100.0 * range)));
  }
  return ranges;
}

void Move(const Twist& velocity, double step, base::Pose2& X_OR) {
  const auto [s, c] = base::SinCos(X_OR.yaw);
  X_OR.p = X_OR.p + step * velocity.linear * base::Vec2{c, s};
  X_OR.yaw = base::WrapAngle(X_OR.yaw + step * velocity.angular);
}

class Hash {
 public:
  void Add(std::uint64_t value) { hash_ = (hash_ ^ value) * 0x100000001b3u; }
  void Add(double value) { Add(std::bit_cast<std::uint64_t>(value)); }
  void Add(const Twist& twist) {
    Add(twist.linear);
    Add(twist.angular);
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

/// Moves every number off its default, so that what is left out by default takes part.
struct Shift {
  template <class... Rest>
  void operator()(const char*, double& value, const base::Range& range, Rest&&...) {
    value = std::clamp(value == 0.0 ? 0.1 : 1.1 * value, range.min, range.max);
  }
  template <class... Rest>
  void operator()(const char*, int& value, const base::Range& range, Rest&&...) {
    value = std::clamp(value + 1, static_cast<int>(range.min), static_cast<int>(range.max));
  }
  template <class... Rest>
  void operator()(const char*, bool&, Rest&&...) {}
  template <class Config>
  void Section(const char*, Config& config, const char*) {
    config.Visit(*this);
  }
};

PlannersConfig Settings(bool shifted) {
  PlannersConfig config;
  if (shifted) {
    Shift shift;
    config.Visit(shift);
    config.navigation.planner_patience = config.navigation.controller_patience = 1.0;
    config.navigation.recovery_clears = true;
  }
  config.mppi.batch_size = 100;
  return config;
}

/// Hash of two episodes: back through the slalom, heading where angles are cut; and shut in for a
/// while, on the way there.
std::uint64_t DriveAndHash(const std::string& name, bool shifted) {
  const PlannersConfig config = Settings(shifted);
  const env::ScanGeometry geometry{.num_beams = 360};
  Navigator navigator(config.navigation, NavigationOf(name, config), geometry, 0.05,
                      MakeLocalPlanner(name, config));
  Hash hash;
  const auto drive = [&](const base::Pose2& start, base::Vec2 goal_O, int num_steps,
                         const auto& posts_at) {
    base::Pose2 X_OR = start;
    Twist velocity;
    navigator.Reset(X_OR, goal_O, 1);
    for (int step = 0; step < num_steps; ++step) {
      velocity = navigator.Step(Scan(geometry, posts_at(step), X_OR), X_OR, velocity);
      Move(velocity, 0.05, X_OR);
      hash.Add(velocity);
      hash.Add(static_cast<std::uint64_t>(navigator.state()));
      if (step % 50 != 49) continue;
      for (const Costmap* map : {&navigator.local_costmap(), &navigator.global_costmap()}) {
        for (const std::uint8_t cost : map->costs()) hash.Add(std::uint64_t{cost});
      }
      for (const base::Vec2 p_O : navigator.path()) hash.Add(p_O.x + 10.0 * p_O.y);
    }
    const NavigatorRecord& record = navigator.record();
    for (const int count :
         {record.num_cycles, record.num_failed_plans, record.num_failed_commands,
          record.num_recoveries, record.num_backwards, record.num_turns_in_place}) {
      hash.Add(static_cast<std::uint64_t>(count));
    }
    return base::Norm(X_OR.p - start.p);
  };
  EXPECT_GT(
      drive({{8.0, 0.0}, base::kPi}, {0.0, 0.0}, 200, [](int) -> const Posts& { return kSlalom; }),
      1.5)
      << name << " drives";
  const Posts shut_in = ShutInAt({0.0, 0.0});
  drive({}, {8.0, 0.0}, 200,
        [&](int step) -> const Posts& { return step < 130 ? shut_in : kSlalom; });
  return hash.value();
}

/// Heads for the goal that it sees, and knows no obstacles.
class GreedyAgent : public env::Agent {
 public:
  void Act(const env::ObservationBatch& observations, std::span<float> numbers) override {
    for (int i = 0; i < observations.batch_size; ++i) {
      const std::span<const float> state = observations.frame(i).state;
      const double side = std::atan2(state[1], state[0]);
      env::AsActions(numbers)[i] =
          env::ActionBounds{}.Normalise(std::abs(side) < 0.8 ? 1.0 : 0.2, 2.0 * side);
    }
  }
};

/// Hash of what a guard lets two robots do in two episodes each, which begin at different times.
/// One is shut in for a while.
std::uint64_t GuardAndHash(bool shifted) {
  const double step = 0.2;
  GuardConfig config{.shield = true,
                     .memory = 2.0,
                     .waypoints = true,
                     .waypoint_after = 2.0,
                     .rescue_after = 1.0,
                     .rescue_time = 1.0};
  GuardedRobot robot{.model = {.pyramid = true, .least_delay = 0.1, .delay = 0.3},
                     .scan = {.num_beams = 360},
                     .step = step};
  if (shifted) {
    Shift shift;
    config.Visit(shift);
    robot.model.slips = false;
    robot.model.least_delay = robot.model.delay = 0.0;
  }
  const PlannersConfig planners = Settings(shifted);
  robot.guide = {planners.navigation, NavigationOf("mppi", planners),
                 [planners] { return MakeLocalPlanner("mppi", planners); }};
  GuardedAgent agent(std::make_unique<GreedyAgent>(), config, robot);
  const base::Pose2 starts[] = {{}, {{8.0, 0.0}, base::kPi}};
  const base::Vec2 goals_O[] = {{8.0, 0.0}, {0.0, 0.0}};
  const Posts shut_in = ShutInAt({2.5, 0.0});
  base::Pose2 poses[2];
  Twist velocities[2];
  env::ObservationBatch observations;
  observations.Resize(2, robot.scan.num_beams);
  std::vector<env::Action> actions(2);
  Hash hash;
  for (int time = 0; time < 120; ++time) {
    for (int i = 0; i < 2; ++i) {
      observations.ended[i] = i == 1 && time == 69;
      observations.first[i] = time == 0 || time == (i == 0 ? 60 : 70);
      if (observations.first[i] != 0) poses[i] = starts[i], velocities[i] = {};
      const bool is_shut_in = i == 0 && time > 10 && time < 40;
      std::ranges::copy(Scan(robot.scan, is_shut_in ? shut_in : kSlalom, poses[i]),
                        observations.mutable_ranges(i).begin());
      observations.odometry[i] = {poses[i], velocities[i].linear, velocities[i].angular};
      const base::Vec2 goal_R = base::InverseTransform(poses[i], goals_O[i]);
      observations.mutable_state(i)[0] = static_cast<float>(goal_R.x);
      observations.mutable_state(i)[1] = static_cast<float>(goal_R.y);
    }
    agent.Act(observations, env::NumbersOf(actions));
    for (int i = 0; i < 2; ++i) {
      velocities[i] = {robot.bounds.linear_mps(actions[i]), robot.bounds.angular_radps(actions[i])};
      for (int k = 0; k < 10; ++k) Move(velocities[i], 0.1 * step, poses[i]);
      hash.Add(velocities[i]);
      hash.Add(std::uint64_t{agent.Intervened(i)});
    }
  }
  for (int i = 0; i < 2; ++i) {
    for (const char c : agent.Status(i)) hash.Add(static_cast<std::uint64_t>(c));
  }
  return hash.value();
}

// The numbers are those of this code, not of ROS; a change of behaviour changes them.
class GoldenDrive : public testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(Planners, GoldenDrive, testing::ValuesIn(PlannerNames()),
                         [](const auto& planner) { return planner.param; });

TEST_P(GoldenDrive, IsTheSame) {
  const std::map<std::string, std::pair<std::uint64_t, std::uint64_t>> golden = {
      {"dwa", {8832375249614843109u, 3761370439888981024u}},
      {"eband", {14540332205118598684u, 14767188972111750473u}},
      {"teb", {10783952608236391358u, 9433844246125549579u}},
      {"mppi", {13625435609586943533u, 7121635459860964028u}}};
  const auto [by_default, shifted] = golden.at(GetParam());
  EXPECT_EQ(DriveAndHash(GetParam(), false), by_default);
  EXPECT_EQ(DriveAndHash(GetParam(), true), shifted);
}

TEST(GoldenGuard, IsTheSame) {
  EXPECT_EQ(GuardAndHash(false), 7432728475682696776u);
  EXPECT_EQ(GuardAndHash(true), 3507845572090872861u);
}

}  // namespace
}  // namespace slalom::planners
