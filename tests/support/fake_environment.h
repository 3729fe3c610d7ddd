#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "base/check.h"
#include "base/random.h"
#include "env/agent.h"
#include "env/environment.h"

namespace slalom::testing {

/// An environment whose every number is a plain function of (spec, actions so far), for tests of
/// what drives environments.
///
/// An episode lasts `1 + seed % max_length` steps. Its outcome is drawn from the seed: success with
/// the probability `success_probability[course]`, else a collision or a timeout with equal chance.
/// A step of the robot goes linear x 1 m along x and angular x 1 m along y and is rewarded with
/// linear + angular. Ranges are random numbers of (seed, step, position), so a frame betrays
/// everything that led to it.
class FakeEnvironment : public env::BatchEnvironment {
 public:
  FakeEnvironment(int batch_size, std::vector<double> success_probability, int max_length = 30,
                  int num_beams = 8)
      : success_probability_(std::move(success_probability)),
        max_length_(max_length),
        episodes_(batch_size) {
    observations_.Resize(batch_size, num_beams);
  }

  int batch_size() const override { return observations_.batch_size; }
  int num_courses() const override { return static_cast<int>(success_probability_.size()); }

  void Reset(int i, const env::EpisodeSpec& spec) override {
    SLALOM_CHECK_LT(spec.course, num_courses());
    episodes_[i] = {spec, {}, 0, true};
    observations_.ended[i] = 0;
    WriteFrame(i, env::Action{});
    specs_.push_back(spec);
  }

  void Step(std::span<const float> numbers, std::span<env::StepResult> results) override {
    const auto actions = env::AsActions(numbers);
    for (int i = 0; i < batch_size(); ++i) {
      Running& episode = episodes_[i];
      if (!episode.running) continue;
      ++episode.num_steps;
      episode.p_W = episode.p_W + base::Vec2{actions[i].linear, actions[i].angular};
      const env::Outcome outcome = episode.num_steps == Length(episode.spec)
                                       ? LastOutcome(episode.spec)
                                       : env::Outcome::kRunning;
      results[i] = {actions[i].linear + actions[i].angular,
                    outcome == env::Outcome::kCollision ? 1.0f : 0.0f, outcome};
      episode.running = outcome == env::Outcome::kRunning;
      observations_.ended[i] = episode.running ? 0 : 1;
      WriteFrame(i, actions[i]);
    }
  }

  const env::ObservationBatch& observations() const override { return observations_; }
  double motion_time(int i) const override {
    return static_cast<double>(episodes_[i].spec.seed % 1000) + episodes_[i].num_steps;
  }
  base::Pose2 robot_pose(int i) const override { return {episodes_[i].p_W, 0.0}; }

  int Length(const env::EpisodeSpec& spec) const {
    return 1 + static_cast<int>(spec.seed % static_cast<std::uint64_t>(max_length_));
  }
  env::Outcome LastOutcome(const env::EpisodeSpec& spec) const {
    base::Random random(spec.seed);
    if (random.Uniform() < success_probability_[spec.course]) return env::Outcome::kSuccess;
    return random.Uniform() < 0.5 ? env::Outcome::kCollision : env::Outcome::kTimeout;
  }
  /// Every episode begun so far, in order.
  const std::vector<env::EpisodeSpec>& specs() const { return specs_; }

 private:
  struct Running {
    env::EpisodeSpec spec;
    base::Vec2 p_W;
    int num_steps = 0;
    bool running = false;
  };

  void WriteFrame(int i, const env::Action& action) {
    const Running& episode = episodes_[i];
    base::Random random(base::DeriveSeed(
        episode.spec.seed, "frame",
        {static_cast<std::uint64_t>(episode.spec.course),
         static_cast<std::uint64_t>(episode.num_steps),
         static_cast<std::uint64_t>(std::llround(1e6 * (episode.p_W.x + 1e3 * episode.p_W.y)))}));
    for (auto& range : observations_.mutable_ranges(i)) {
      range = static_cast<std::uint16_t>(20 + random.UniformInt(480));
    }
    const auto state = observations_.mutable_state(i);
    state[0] = static_cast<float>(episode.p_W.x);
    state[1] = static_cast<float>(episode.p_W.y);
    state[2] = action.linear;
    state[3] = action.angular;
    observations_.first[i] = episode.num_steps == 0 ? 1 : 0;
  }

  const std::vector<double> success_probability_;
  const int max_length_;
  std::vector<Running> episodes_;
  env::ObservationBatch observations_;
  std::vector<env::EpisodeSpec> specs_;
};

/// An agent with a memory: it acts on the sum of all ranges that it saw in the running episode, so
/// it errs at once where frames are lost, doubled or mixed up, or where `first` is wrong.
class SummingAgent : public env::Agent {
 public:
  explicit SummingAgent(int batch_size) : sums_(batch_size) {}

  void Act(const env::ObservationBatch& observations, std::span<float> numbers) override {
    const auto actions = env::AsActions(numbers);
    for (int i = 0; i < observations.batch_size; ++i) {
      if (observations.first[i] != 0) sums_[i] = 0;
      for (const std::uint16_t range : observations.frame(i).ranges_cm) sums_[i] += range;
      actions[i].linear = 0.02f * static_cast<float>(sums_[i] % 97) - 0.96f;
      actions[i].angular = 0.02f * static_cast<float>(sums_[i] % 89) - 0.88f;
    }
  }

  std::string Status(int i) const override { return std::to_string(sums_[i]); }
  bool Intervened(int i) const override { return sums_[i] % 3 == 0; }

 private:
  std::vector<std::uint64_t> sums_;
};

/// Commands the same action always.
class ConstantAgent : public env::Agent {
 public:
  explicit ConstantAgent(env::Action action) : action_(action) {}
  void Act(const env::ObservationBatch&, std::span<float> actions) override {
    std::ranges::fill(env::AsActions(actions), action_);
  }

 private:
  const env::Action action_;
};

}  // namespace slalom::testing
