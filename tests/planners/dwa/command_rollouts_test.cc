#include "planners/dwa/command_rollouts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"

namespace slalom::planners {
namespace {

double Approach(double wanted, double now, double most) {
  return wanted >= now ? std::min(wanted, now + most) : std::max(wanted, now - most);
}

/// The rule of the header, for one command.
std::vector<base::Pose2> SlowRollout(const DwaConfig& config, base::Pose2 X_OR, Twist velocity,
                                     Twist command) {
  const double poses =
      std::max(std::fabs(command.linear) * config.sim_time / config.sim_granularity,
               std::fabs(command.angular) / config.angular_sim_granularity);
  const int num_poses = std::max(1, static_cast<int>(std::lround(poses)));
  const double dt = config.sim_time / num_poses;
  std::vector<base::Pose2> rollout = {X_OR};
  while (std::ssize(rollout) < num_poses) {
    velocity.linear = Approach(command.linear, velocity.linear, config.acceleration * dt);
    velocity.angular = Approach(command.angular, velocity.angular, config.turn_acceleration * dt);
    const auto [s, c] = base::SinCos(X_OR.yaw);
    X_OR.p = X_OR.p + (velocity.linear * dt) * base::Vec2{c, s};
    X_OR.yaw += velocity.angular * dt;
    rollout.push_back(X_OR);
  }
  return rollout;
}

// Bit for bit, in any number of commands, in one object again and again.
TEST(CommandRollouts, FollowTheSlowRule) {
  base::Random random(1);
  CommandRollouts rollouts;
  for (const int num_commands : {1, 7, 8, 9, 120, 3}) {
    DwaConfig config;
    config.acceleration = random.Uniform(0.1, 10.0);
    config.turn_acceleration = random.Uniform(0.1, 20.0);
    const base::Pose2 X_OR{{random.Uniform(-9.0, 9.0), random.Uniform(-9.0, 9.0)},
                           random.Uniform(-3.2, 3.2)};
    const Twist velocity{random.Uniform(-1.0, 1.0), random.Uniform(-2.0, 2.0)};
    std::vector<Twist> commands;
    for (int i = 0; i < num_commands; ++i) {
      commands.push_back({random.Uniform(-0.5, 1.0), random.Uniform(-8.0, 8.0)});
    }
    commands.front() = {0.0, 0.0};  // One pose.
    rollouts.Simulate(config, X_OR, velocity, commands);
    for (std::size_t i = 0; i < commands.size(); ++i) {
      const std::vector<base::Pose2> expected = SlowRollout(config, X_OR, velocity, commands[i]);
      ASSERT_EQ(rollouts.num_poses(i), std::ssize(expected));
      for (int k = 0; k < rollouts.num_poses(i); ++k) {
        const CommandRollouts::Pose pose = rollouts.pose(i, k);
        const base::SinCosResult heading = base::SinCos(expected[k].yaw);
        ASSERT_EQ(pose.X_OR, expected[k]) << "command " << i << ", pose " << k;
        ASSERT_EQ(pose.heading.sin, heading.sin);
        ASSERT_EQ(pose.heading.cos, heading.cos);
      }
    }
  }
}

}  // namespace
}  // namespace slalom::planners
