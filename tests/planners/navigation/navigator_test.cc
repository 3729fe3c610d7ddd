#include "planners/navigation/navigator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

namespace slalom::planners {
namespace {

using testing::ElementsAre;

/// Does as it is told and notes what it sees.
class FakePlanner : public LocalPlanner {
 public:
  void Reset(std::uint64_t seed) override {
    seed_ = seed;
    path_length_ = 0;
    path_was_new_ = false;
    cost_ahead_ = 0;
    X_OR_ = {};
  }
  std::optional<Twist> ComputeCommand(const LocalView& view) override {
    ++num_calls_;
    X_OR_ = view.X_OR;
    velocity_ = view.velocity;
    path_length_ = view.path_O.size();
    path_was_new_ = view.path_is_new;
    cost_ahead_ = view.costmap.cost(view.costmap.CellAt({1.525, 0.025}));
    return command_;
  }

  std::uint64_t seed_ = 0;
  int num_calls_ = 0;
  base::Pose2 X_OR_;
  Twist velocity_;
  std::size_t path_length_ = 0;
  bool path_was_new_ = false;
  int cost_ahead_ = 0;  // 1.5 m ahead of the start.
  std::optional<Twist> command_ = Twist{0.3, 0.1};
};

/// A robot with a scan of 360 beams all round that stands or drives where the test says. Scans
/// enter the maps at once unless the test says otherwise.
class Robot {
 public:
  explicit Robot(NavigationConfig config = {}, double step = 0.05,
                 PlannerNavigationConfig planner_config = {}, double scan_age = 0.0)
      : ranges_(360, 500), step_(step) {
    config.scan_age = scan_age;
    auto planner = std::make_unique<FakePlanner>();
    planner_ = planner.get();
    navigator_ = std::make_unique<Navigator>(
        config, planner_config,
        env::ScanGeometry{.num_beams = 360, .field_of_view = 6.2657, .p_RS = {}, .clip = 5.0}, step,
        std::move(planner));
    navigator_->Reset(pose_, {4.0, 0.0}, 7);
  }

  Twist Step() {
    time_ += step_;
    return navigator_->Step(ranges_, pose_, {});
  }
  /// As `Step`; then turns as commanded.
  Twist StepAndTurn() {
    const Twist command = Step();
    pose_.yaw = base::WrapAngle(pose_.yaw + command.angular * step_);
    return command;
  }
  /// Steps until the state changes or time runs out; what it was is returned with its duration.
  std::string StepWhile(NavigatorState state, double max_time) {
    const double from = time_;
    while (navigator_->state() == state && time_ - from < max_time) Step();
    return std::string(ToString(state)) + " " + std::to_string(std::lround(time_ - from));
  }
  void Look() { navigator_->Look(ranges_, pose_); }
  void SeeNothing() { ranges_.assign(360, 500); }
  void SeeWallAllRound(int range_cm) { ranges_.assign(360, static_cast<std::uint16_t>(range_cm)); }

  FakePlanner& planner() { return *planner_; }
  Navigator& navigator() { return *navigator_; }
  base::Pose2& pose() { return pose_; }
  double time() const { return time_; }

 private:
  std::vector<std::uint16_t> ranges_;
  const double step_;
  base::Pose2 pose_;
  double time_ = 0.0;
  FakePlanner* planner_ = nullptr;
  std::unique_ptr<Navigator> navigator_;
};

TEST(Navigator, PlansThenDrivesThenArrives) {
  Robot robot;
  EXPECT_EQ(robot.planner().seed_, 7u);
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kPlanning);
  EXPECT_EQ(robot.Step(), Twist{}) << "the plan of this cycle is for the next";
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kControlling);
  EXPECT_EQ(robot.Step(), (Twist{0.3, 0.1}));
  EXPECT_TRUE(robot.planner().path_was_new_);
  EXPECT_GT(robot.planner().path_length_, 100u);  // 4 m in steps of 0.025 m.
  robot.pose().p = {3.7, 0.0};
  EXPECT_EQ(robot.Step(), (Twist{0.3, 0.1}));
  robot.pose().p = {3.76, 0.0};
  EXPECT_EQ(robot.Step(), Twist{});
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kArrived);
  EXPECT_EQ(robot.navigator().record().num_cycles, 4);
}

// Commands of 0.05 s that act 0.12 s late, beside a robot that drives them in steps of 0.1 ms.
TEST(Navigator, CommandsForThePlaceWhereTheRobotWillActOnIt) {
  NavigationConfig config;
  config.command_delay = 0.12;
  Robot robot(config);
  const auto command = [](int step) {
    return step < 1 ? Twist{} : Twist{0.4 + 0.1 * (step % 3), 1.5 - 0.7 * (step % 4)};
  };
  constexpr int kSteps = 20, kPerStep = 500, kDelay = 1200;
  std::vector<base::Pose2> poses(1);
  for (int i = 0; i < kSteps * kPerStep + kDelay; ++i) {
    const Twist acting = i < kDelay ? Twist{} : command((i - kDelay) / kPerStep);
    const base::Pose2 X = poses.back();
    poses.push_back(
        {base::Transform(X, {1e-4 * acting.linear, 0.0}), X.yaw + 1e-4 * acting.angular});
  }
  for (int step = 0; step < kSteps; ++step) {
    robot.pose() = poses[step * kPerStep];
    robot.planner().command_ = command(step);
    EXPECT_EQ(robot.Step(), command(step));
    if (step == 0) continue;  // It plans.
    const base::Pose2& expected = poses[step * kPerStep + kDelay];
    EXPECT_NEAR(base::Norm(robot.planner().X_OR_.p - expected.p), 0.0, 1e-4) << step;
    EXPECT_NEAR(robot.planner().X_OR_.yaw, expected.yaw, 1e-9) << step;
    EXPECT_EQ(robot.planner().velocity_, command(step - 1));
  }
}

// A goal 30 m away is beyond the edge of the configured 40 m, 20 m from the start.
TEST(Navigator, EnlargesTheGlobalMapForAFarGoal) {
  Robot robot;
  EXPECT_EQ(robot.navigator().global_costmap().size_x(), 800);
  robot.navigator().Reset({{1.0, 2.0}, 0.3}, {-29.0, 12.0}, 7);
  EXPECT_EQ(robot.navigator().global_costmap().size_x(), 2 * (30 + 5) * 20);
  robot.Step();
  robot.Step();
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kControlling);
  EXPECT_NEAR(base::Norm(robot.navigator().path().back() - base::Vec2{-29.0, 12.0}), 0.0, 0.05);
  robot.navigator().Reset({}, {4.0, 0.0}, 7);
  EXPECT_EQ(robot.navigator().global_costmap().size_x(), 800);
}

TEST(Navigator, GivesUpWithoutAPlan) {
  Robot robot;
  robot.SeeWallAllRound(70);  // Shut in, with room to turn.
  robot.Step();
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kPlanning);
  std::vector<std::string> story;
  for (int i = 0; i < 4; ++i) story.push_back(robot.StepWhile(robot.navigator().state(), 30.0));
  // Patience, clearing in a cycle, patience, a turn that the standing robot never completes.
  EXPECT_THAT(story, ElementsAre("planning 5", "recovering 0", "planning 5", "recovering 30"));
  EXPECT_NEAR(robot.navigator().record().num_turns_in_place, 20 * 30, 1);
  EXPECT_EQ(robot.navigator().record().last_command, (Twist{0.0, 1.57}));
  EXPECT_EQ(robot.navigator().record().num_recoveries, 2);
}

TEST(Navigator, AbortsAfterFourRecoveries) {
  NavigationConfig config;
  config.recovery_rotates = false;
  Robot robot(config);
  robot.SeeWallAllRound(70);
  std::vector<std::string> story;
  while (robot.navigator().state() != NavigatorState::kAborted) {
    story.push_back(robot.StepWhile(robot.navigator().state(), 30.0));
  }
  EXPECT_THAT(story, ElementsAre("planning 5", "recovering 0", "planning 5", "recovering 0",
                                 "planning 5", "recovering 0", "planning 5", "recovering 0",
                                 "planning 5", "recovering 0"));
  EXPECT_EQ(robot.navigator().record().num_recoveries, 4);
  robot.SeeNothing();
  for (int i = 0; i < 100; ++i) EXPECT_EQ(robot.Step(), Twist{});
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kAborted) << "the goal was sent once";
}

TEST(Navigator, RecoversWhereThePlannerHasNoCommand) {
  NavigationConfig config;
  config.recovery_rotates = false;
  Robot robot(config);
  robot.planner().command_ = std::nullopt;
  robot.Step();
  // Each failure goes back to planning, which succeeds at once; patience counts from the start.
  while (robot.navigator().state() != NavigatorState::kRecovering && robot.time() < 60.0) {
    EXPECT_EQ(robot.Step(), Twist{});
  }
  EXPECT_NEAR(robot.time(), 15.0, 0.2);
  EXPECT_EQ(robot.navigator().record().num_failed_plans, 0);
  EXPECT_GT(robot.navigator().record().num_failed_commands, 100);
  robot.planner().command_ = Twist{0.2, 0.0};
  robot.Step();
  robot.Step();
  robot.Step();
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kControlling);
  // A command starts patience anew and the recoveries with it.
  robot.planner().command_ = std::nullopt;
  while (robot.navigator().state() != NavigatorState::kAborted && robot.time() < 60.0) robot.Step();
  EXPECT_NEAR(robot.time(), 30.0, 1.5);
  EXPECT_EQ(robot.navigator().record().num_recoveries, 1 + 4);
}

TEST(Navigator, SendsTheGoalAnew) {
  NavigationConfig config;
  config.recovery_rotates = false;
  config.goal_resend_rate = 0.5;
  Robot robot(config);
  robot.SeeWallAllRound(70);
  for (int i = 0; i < 20 * 40; ++i) robot.Step();
  EXPECT_EQ(robot.navigator().state(), NavigatorState::kPlanning) << "patience never runs out";
  EXPECT_EQ(robot.navigator().record().num_recoveries, 0);
  config.goal_resend_rate = 1.0 / 40.0;
  Robot slow(config);
  slow.SeeWallAllRound(70);
  while (slow.navigator().state() != NavigatorState::kAborted) slow.Step();
  EXPECT_NEAR(slow.time(), 25.0, 1.0);
  while (slow.navigator().state() == NavigatorState::kAborted) slow.Step();
  EXPECT_NEAR(slow.time(), 40.0, 0.1);
  // All recoveries once more.
  while (slow.navigator().state() != NavigatorState::kAborted) slow.Step();
  EXPECT_NEAR(slow.time(), 65.0, 1.0);
  EXPECT_EQ(slow.navigator().record().num_recoveries, 2 * 4);
  config.goal_resend_rate = 0.5;
  config.controller_patience = 5.0;
  Robot idle(config);
  idle.planner().command_ = std::nullopt;
  for (int i = 0; i < 20 * 20; ++i) idle.Step();
  EXPECT_GT(idle.navigator().record().num_failed_commands, 100);
  EXPECT_EQ(idle.navigator().record().num_recoveries, 0) << "patience never runs out";
}

TEST(Navigator, APlanStartsTheRecoveriesFromTheFirst) {
  NavigationConfig config;
  config.recovery_rotates = false;
  Robot robot(config);
  const auto step_until = [&](const auto& condition) {
    while (!condition() && robot.time() < 100.0) robot.Step();
  };
  robot.SeeWallAllRound(70);
  step_until([&] { return robot.navigator().record().num_recoveries == 2; });
  robot.SeeWallAllRound(280);  // Too far to be marked, and all before it is cleared.
  step_until([&] { return robot.navigator().state() == NavigatorState::kControlling; });
  robot.SeeWallAllRound(70);
  for (int i = 0; i < 20 * 10; ++i) robot.Step();  // Drives by the last plan.
  robot.planner().command_ = std::nullopt;
  robot.Step();
  EXPECT_EQ(robot.StepWhile(NavigatorState::kPlanning, 30.0), "planning 5");
  step_until([&] { return robot.navigator().state() == NavigatorState::kAborted; });
  EXPECT_EQ(robot.navigator().record().num_recoveries, 2 + 4);
}

TEST(Navigator, TurnsRoundTwiceBeforeItGivesUp) {
  Robot robot;
  robot.SeeWallAllRound(70);
  double turned = 0.0;
  while (robot.navigator().state() != NavigatorState::kAborted && robot.time() < 100.0) {
    turned += 0.05 * robot.StepAndTurn().angular;
  }
  EXPECT_NEAR(turned, 2 * 2.0 * base::kPi, 2 * 0.157 + 1e-9);
  EXPECT_EQ(robot.navigator().record().num_recoveries, 4);
  // A goal that is sent again in the midst of a turn does not end it.
  NavigationConfig config;
  config.goal_resend_rate = 1.0 / 12.0;
  Robot told_again(config);
  told_again.SeeWallAllRound(70);
  for (turned = 0.0; told_again.time() < 16.0;) turned += 0.05 * told_again.StepAndTurn().angular;
  EXPECT_NEAR(turned, 2.0 * base::kPi, 0.157 + 1e-9);
}

TEST(Navigator, StopsWithoutCommands) {
  NavigationConfig config;
  config.goal_resend_rate = 10.0;
  Robot robot(config);
  for (int i = 0; i < 20; ++i) robot.Step();
  ASSERT_EQ(robot.Step(), (Twist{0.3, 0.1}));
  robot.SeeWallAllRound(70);  // From now on there is no plan; each new goal asks for one.
  int num_moving = 0;
  while (robot.Step() != Twist{}) ASSERT_LT(++num_moving, 100);
  EXPECT_NEAR(num_moving, 5, 1);  // 0.25 s on the last command.
  for (int i = 0; i < 20; ++i) EXPECT_EQ(robot.Step(), Twist{});
}

TEST(Navigator, ClearsItsMapsIfToldTo) {
  for (const bool clears : {false, true}) {
    NavigationConfig config;
    config.recovery_rotates = false;
    config.recovery_clears = clears;
    Robot robot(config);
    robot.SeeWallAllRound(200);
    robot.Step();
    robot.SeeWallAllRound(70);
    while (robot.navigator().state() != NavigatorState::kRecovering) robot.Step();
    const auto count = [&](double from, double to) {
      int num = 0;
      for (const Costmap* map :
           {&robot.navigator().local_costmap(), &robot.navigator().global_costmap()}) {
        for (int y = 0; y < map->size_y(); ++y) {
          for (int x = 0; x < map->size_x(); ++x) {
            const base::Vec2 p = map->CentreOf({x, y});
            const double size = std::max(std::fabs(p.x), std::fabs(p.y));
            num += map->cost({x, y}) == kLethalCost && size >= from && size < to;
          }
        }
      }
      return num;
    };
    const int near = count(0.0, 1.4), far = count(1.6, 9.0);
    EXPECT_GT(near, 100);
    EXPECT_GT(far, 100);
    robot.Step();
    EXPECT_EQ(count(0.0, 1.4), near);  // The square of 3 m is kept.
    EXPECT_EQ(count(1.6, 9.0), clears ? 0 : far);
    for (const int range_cm : {120, 70}) {
      robot.SeeWallAllRound(range_cm);
      robot.Step();
    }
    const int between = count(1.0, 1.4);
    EXPECT_GT(between, 50);
    while (robot.navigator().record().num_recoveries < 3) robot.Step();
    EXPECT_EQ(count(1.0, 1.4), clears ? 0 : between);  // The second clearing's is of 1.84 m.
    EXPECT_GT(count(0.0, 0.9), 100);
    // Nothing but the clearing opens a way.
    Robot shut_in(config);
    shut_in.SeeWallAllRound(200);
    shut_in.Step();
    shut_in.SeeNothing();
    EXPECT_EQ(shut_in.StepWhile(NavigatorState::kPlanning, 30.0), "planning 5");
    for (int i = 0; i < 3; ++i) shut_in.Step();
    EXPECT_EQ(shut_in.navigator().state(),
              clears ? NavigatorState::kControlling : NavigatorState::kPlanning);
  }
}

TEST(Navigator, KnowsWhatItHasLookedAtAndSeenBetweenTwoPlans) {
  Robot robot;
  robot.SeeWallAllRound(152);
  robot.Look();
  robot.SeeNothing();
  robot.Step();
  robot.Step();
  for (const Costmap* map :
       {&robot.navigator().local_costmap(), &robot.navigator().global_costmap()}) {
    EXPECT_EQ(map->cost(map->CellAt({1.525, 0.025})), kLethalCost);
  }
  NavigationConfig config;
  config.planner_rate = 1.0;
  Robot slow(config);
  for (int i = 0; i < 21; ++i) {
    if (i == 4) slow.SeeWallAllRound(200);
    if (i == 8) slow.SeeNothing();
    slow.Step();
  }
  EXPECT_EQ(slow.navigator().record().num_failed_plans, 1);
}

// In steps of a cycle, the maps get a scan of the step before, and the planner the maps of the step
// before that.
TEST(Navigator, ActsOnWhatTheMapsWereACycleAgo) {
  for (const auto& [scan_age, step, late] :
       {std::tuple{0.05, 0.05, 2}, {0.0, 0.05, 1}, {0.05, 0.2, 0}}) {
    Robot robot({}, step, {}, scan_age);
    robot.Step();
    robot.Step();
    ASSERT_EQ(robot.navigator().state(), NavigatorState::kControlling);
    robot.SeeWallAllRound(152);
    for (int i = 0; i <= late; ++i) {
      EXPECT_EQ(robot.planner().cost_ahead_, kFreeCost) << scan_age << " " << step << " " << i;
      robot.Step();
    }
    EXPECT_EQ(robot.planner().cost_ahead_, kLethalCost) << scan_age << " " << step;
  }
}

TEST(Navigator, KeepsItsRates) {
  NavigationConfig config;
  PlannerNavigationConfig planner_config;
  planner_config.control_rate = 5.0;
  Robot robot(config, 0.05, planner_config);
  for (int i = 0; i < 40; ++i) robot.Step();
  EXPECT_EQ(robot.planner().num_calls_, 9) << "10 cycles in 2 s, of which the first plans";
  Robot fast(config, 0.2, {});  // The steps are longer than a cycle: one each.
  for (int i = 0; i < 10; ++i) fast.Step();
  EXPECT_EQ(fast.planner().num_calls_, 9);
}

TEST(Navigator, DropsThePassedPartOfThePlan) {
  NavigationConfig config;
  config.planner_rate = 0.5;
  Robot robot(config);
  robot.Step();
  robot.Step();
  const std::size_t before = robot.planner().path_length_;
  robot.pose().p = {2.0, 0.0};
  robot.Step();
  EXPECT_FALSE(robot.planner().path_was_new_);
  // Points less than 1 m behind stay.
  const std::size_t after = robot.planner().path_length_;
  EXPECT_NEAR(static_cast<double>(before - after), 40.0, 2.0);
  robot.pose().p = {0.5, 0.0};
  robot.Step();
  EXPECT_EQ(robot.planner().path_length_, after) << "and what is dropped does not come back";
}

// Whatever the first episode ended in, the second is like that of a new navigator.
TEST(Navigator, ForgetsTheEpisodeBefore) {
  for (const double duration : {0.0, 0.3, 3.0, 5.5, 11.0, 20.0, 40.0}) {
    for (const bool has_plan : {false, true}) {
      NavigationConfig config;
      config.controller_patience = 5.0;
      config.command_delay = has_plan ? 0.12 : 0.0;
      const double scan_age = has_plan ? 0.0 : 0.1;
      Robot used(config, 0.05, {}, scan_age), fresh(config, 0.05, {}, scan_age);
      if (!has_plan) used.SeeWallAllRound(70);
      while (used.time() < duration) {
        if (used.time() > 0.2) used.planner().command_ = std::nullopt;
        if (used.time() > 0.1) used.pose().p.x = 1.5;  // So it leaves a part of its plan behind.
        used.StepAndTurn();
      }
      used.SeeNothing();
      used.planner().command_ = Twist{0.3, 0.1};
      for (Robot* robot : {&used, &fresh}) {
        robot->pose() = {{0.5, 0.2}, 0.4};
        robot->navigator().Reset(robot->pose(), {3.0, 1.0}, 8);
        EXPECT_TRUE(robot->navigator().path().empty());
        EXPECT_EQ(robot->navigator().global_costmap().origin(), (base::Vec2{0.5 - 20, 0.2 - 20}));
      }
      const auto same_maps = [&] {
        const Navigator &a = used.navigator(), &b = fresh.navigator();
        return std::ranges::equal(a.local_costmap().costs(), b.local_costmap().costs()) &&
               a.local_costmap().origin() == b.local_costmap().origin() &&
               std::ranges::equal(a.global_costmap().costs(), b.global_costmap().costs());
      };
      EXPECT_TRUE(same_maps()) << duration;
      // Drives, then has no plan, recovers, drives again, and then has no command.
      for (int i = 0; i < 20 * 22; ++i) {
        for (Robot* robot : {&used, &fresh}) {
          if (i == 10) robot->SeeWallAllRound(70);
          if (i == 20 * 12) robot->SeeNothing();
          if (i == 20 * 14) robot->planner().command_ = std::nullopt;
        }
        const Twist expected = fresh.StepAndTurn();
        ASSERT_EQ(used.StepAndTurn(), expected) << duration << " " << has_plan << ", step " << i;
        ASSERT_EQ(used.navigator().state(), fresh.navigator().state()) << i;
        ASSERT_EQ(used.planner().path_length_, fresh.planner().path_length_) << i;
        ASSERT_EQ(used.planner().path_was_new_, fresh.planner().path_was_new_) << i;
        ASSERT_EQ(used.planner().cost_ahead_, fresh.planner().cost_ahead_) << i;
        ASSERT_EQ(used.planner().X_OR_, fresh.planner().X_OR_) << i;
        if (i % 20 == 0) ASSERT_TRUE(same_maps()) << i;
      }
      const NavigatorRecord &a = used.navigator().record(), &b = fresh.navigator().record();
      EXPECT_EQ(std::tie(a.num_cycles, a.num_failed_plans, a.num_failed_commands, a.num_recoveries,
                         a.num_backwards, a.num_turns_in_place),
                std::tie(b.num_cycles, b.num_failed_plans, b.num_failed_commands, b.num_recoveries,
                         b.num_backwards, b.num_turns_in_place));
    }
  }
}

TEST(RotateRecovery, TurnsOnceRound) {
  const NavigationConfig config;
  const PaddedFootprint footprint(config.footprint);
  const Costmap map(60, 60, 0.05, {-1.5, -1.5});
  for (const double start : {0.0, 2.0, -3.0}) {
    RotateRecovery recovery(start);
    double yaw = start;
    int num_cycles = 0;
    while (const auto rate =
               recovery.TurnRate(config, footprint, map, {{}, base::WrapAngle(yaw)})) {
      EXPECT_GE(*rate, 0.314);
      EXPECT_LE(*rate, 1.57);
      yaw += *rate * 0.05;
      ASSERT_LT(++num_cycles, 200);
    }
    EXPECT_NEAR(yaw - start, 2.0 * base::kPi, 0.157 + 1e-9);
  }
}

TEST(RotateRecovery, DoesNotSlowDownHalfWay) {
  const NavigationConfig config;
  const PaddedFootprint footprint(config.footprint);
  const Costmap map(60, 60, 0.05, {-1.5, -1.5});
  RotateRecovery recovery(0.0);
  EXPECT_EQ(recovery.TurnRate(config, footprint, map, {{}, base::kPi - 0.02}),
            config.recovery_max_turn_rate);
}

TEST(RotateRecovery, DoesNotTurnIntoObstacles) {
  const NavigationConfig config;
  const PaddedFootprint footprint(config.footprint);
  for (const double yaw : {0.0, base::kPi / 2, base::kPi, -base::kPi / 2}) {
    Costmap map(60, 60, 0.05, {-1.5, -1.5});
    // Free now; a corner will come by.
    map.set_cost(map.CellAt(base::Transform({{0.01, 0.01}, yaw}, {0.0, 0.38})), kLethalCost);
    RotateRecovery recovery(base::WrapAngle(yaw - 0.01));
    EXPECT_EQ(recovery.TurnRate(config, footprint, map, {{}, base::WrapAngle(yaw + 0.01)}),
              std::nullopt)
        << yaw;
  }
}

}  // namespace
}  // namespace slalom::planners
