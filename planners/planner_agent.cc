#include "planners/planner_agent.h"

#include <fmt/format.h>

#include <atomic>

#include "base/check.h"

namespace slalom::planners {

PlannerAgent::PlannerAgent(const std::string& name, const PlannersConfig& config,
                           const env::ScanGeometry& geometry, const env::ActionBounds& bounds,
                           double step, base::ParallelFor* parallel)
    : name_(name),
      config_(config),
      geometry_(geometry),
      bounds_(bounds),
      step_(step),
      parallel_(parallel) {
  NavigationOf(name, config);  // Throws if there is no such planner.
}

PlannerAgent::~PlannerAgent() = default;

void PlannerAgent::Act(const env::ObservationBatch& observations, std::span<float> numbers) {
  const std::span<env::Action> actions = env::AsActions(numbers);
  SLALOM_CHECK_EQ(observations.num_beams, geometry_.num_beams);
  SLALOM_CHECK_EQ(actions.size(), static_cast<std::size_t>(observations.batch_size));
  if (navigators_.size() != actions.size()) {
    for (const std::uint8_t first : observations.first) SLALOM_CHECK(first != 0);
    navigators_.resize(actions.size());
    for (auto& navigator : navigators_) navigator = MakeNavigator();
  }
  // Each thread takes the next one when it is free: a plan takes far longer than a command.
  std::atomic<int> next{0};
  const auto act_on_next = [&](int) {
    for (int i; (i = next++) < observations.batch_size;) {
      ActOne(i, observations, actions[static_cast<std::size_t>(i)]);
    }
  };
  if (parallel_ == nullptr) {
    act_on_next(0);
  } else {
    parallel_->For(parallel_->num_threads(), act_on_next);
  }
}

std::string PlannerAgent::Status(int i) const {
  const Navigator& navigator = *navigators_[static_cast<std::size_t>(i)];
  const NavigatorRecord& r = navigator.record();
  return fmt::format(
      "{} v={:.2f} w={:.2f} recoveries={} no_plan={} no_command={} backwards={} turns={} cycles={}",
      ToString(navigator.state()), r.last_command.linear, r.last_command.angular, r.num_recoveries,
      r.num_failed_plans, r.num_failed_commands, r.num_backwards, r.num_turns_in_place,
      r.num_cycles);
}

void PlannerAgent::ActOne(int i, const env::ObservationBatch& observations, env::Action& action) {
  if (observations.ended[i] != 0) return;
  Navigator& navigator = *navigators_[i];
  const env::FrameView frame = observations.frame(i);
  const env::Odometry& odometry = observations.odometry[i];
  const base::Pose2 X_CO{{}, config_.navigation.start_heading};
  const base::Pose2 X_CR{base::Transform(X_CO, odometry.X_OR.p),
                         base::WrapAngle(X_CO.yaw + odometry.X_OR.yaw)};
  if (observations.first[i] != 0) {
    const base::Vec2 goal_R{frame.state[0], frame.state[1]};
    navigator.Reset(X_CR, base::Transform(X_CR, goal_R), frame.Checksum());
  }
  const Twist command = navigator.Step(frame.ranges_cm, X_CR, {odometry.linear, odometry.angular});
  action = bounds_.Normalise(command.linear, command.angular);
}

std::unique_ptr<Navigator> PlannerAgent::MakeNavigator() const {
  return std::make_unique<Navigator>(config_.navigation, NavigationOf(name_, config_), geometry_,
                                     step_, MakeLocalPlanner(name_, config_));
}

}  // namespace slalom::planners
