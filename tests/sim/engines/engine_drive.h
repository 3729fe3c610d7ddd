#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "sim/engines/physics.h"
#include "sim/environments.h"
#include "sim/robot.h"
#include "sim/scene.h"

namespace slalom::test {

/// Why a test of this physics cannot run here; empty: it can.
inline std::string ReasonToSkip(const std::string& physics) {
  const auto& known = engines::KnownPhysics();
  const auto info = std::ranges::find(known, physics, &engines::PhysicsInfo::name);
  if (info->is_built_in) return "";
  return std::string(info->package) + " was not installed when this was built";
}

/// One robot of a physics on one course.
class EngineDrive {
 public:
  explicit EngineDrive(const std::string& physics, const sim::EnvironmentConfig& config = {},
                       sim::Course course = {})
      : step_(config.episode.step) {
    course.name = "test";
    scenes_ = {sim::MakeScene(std::make_shared<const sim::Course>(std::move(course)))};
    const sim::Physics found = engines::FindPhysics(physics);
    body_ = found.make_bodies ? std::move(found.make_bodies(config, scenes_, 1).front())
                              : std::make_unique<sim::Robot>(config.robot, NumSubsteps(config));
    Reset({});
  }

  void Reset(const base::Pose2& X_WR, std::uint64_t seed = 1) {
    body_->Reset(X_WR, seed);
    time_ = 0.0;
  }

  /// Drives for one control step. Returns whether it touched anything.
  bool Drive(double linear, double angular) {
    const bool touched = body_->Drive(linear, angular, *scenes_[0], time_);
    time_ += step_;
    return touched;
  }

  /// Drives for that many control steps. Returns whether it touched anything.
  bool Drive(double linear, double angular, int num_steps) {
    bool touched = false;
    for (int i = 0; i < num_steps; ++i) touched = Drive(linear, angular) || touched;
    return touched;
  }

  base::Pose2 pose() const { return body_->pose(); }
  const sim::BodyState& body() const { return body_->body(); }
  double speed_ahead() const {
    const auto [s, c] = base::SinCos(body().yaw);
    return c * body().vx + s * body().vy;
  }
  double time() const { return time_; }

 private:
  const double step_;  // [s]
  std::vector<std::shared_ptr<const sim::Scene>> scenes_;
  std::unique_ptr<sim::RobotBody> body_;
  double time_ = 0.0;  // [s]
};

}  // namespace slalom::test
