#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "base/random.h"
#include "env/environment.h"

namespace slalom::testing {

/// Gymnasium's Pendulum-v1: no scan, a state of three numbers (cosine, sine and speed of the
/// angle), an action of one, the torque.
class Pendulum : public env::BatchEnvironment {
 public:
  static constexpr int kSteps = 200;  ///< Of an episode.

  explicit Pendulum(int batch_size) : running_(batch_size) {
    observations_.Resize(batch_size, 0, 3);
  }

  int batch_size() const override { return observations_.batch_size; }
  int num_courses() const override { return 1; }
  env::StepShape shape() const override { return {0, 3, 1}; }
  const env::ObservationBatch& observations() const override { return observations_; }
  base::Pose2 robot_pose(int) const override { return {}; }
  double motion_time(int) const override { return 0.0; }

  void Reset(int i, const env::EpisodeSpec& spec) override {
    base::Random random(spec.seed);
    running_[i] = {random.Uniform(-base::kPi, base::kPi), random.Uniform(-1.0, 1.0), 0};
    Observe(i);
  }

  void Step(std::span<const float> actions, std::span<env::StepResult> results) override {
    for (int i = 0; i < batch_size(); ++i) {
      State& state = running_[i];
      if (state.step == kSteps) continue;
      const double torque = 2.0 * std::clamp(static_cast<double>(actions[i]), -1.0, 1.0);
      const double angle = std::remainder(state.angle, 2.0 * base::kPi);
      const double cost = angle * angle + 0.1 * state.speed * state.speed + 0.001 * torque * torque;
      state.speed =
          std::clamp(state.speed + (15.0 * std::sin(state.angle) + 3.0 * torque) * 0.05, -8.0, 8.0);
      state.angle += state.speed * 0.05;
      const bool ended = ++state.step == kSteps;
      results[i] = {.reward = static_cast<float>(-cost),
                    .outcome = ended ? env::Outcome::kTimeout : env::Outcome::kRunning};
      Observe(i);
    }
  }

 private:
  struct State {
    double angle = 0.0;  // From upright, [rad].
    double speed = 0.0;  // [rad/s]
    int step = kSteps;
  };

  void Observe(int i) {
    const State& state = running_[i];
    const std::span<float> out = observations_.mutable_state(i);
    out[0] = static_cast<float>(std::cos(state.angle));
    out[1] = static_cast<float>(std::sin(state.angle));
    out[2] = static_cast<float>(state.speed);
    observations_.first[i] = state.step == 0 ? 1 : 0;
    observations_.ended[i] = state.step == kSteps ? 1 : 0;
  }

  std::vector<State> running_;
  env::ObservationBatch observations_;
};

}  // namespace slalom::testing
