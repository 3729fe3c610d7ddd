#pragma once

#include <string>
#include <string_view>

#include "base/config_field.h"

namespace slalom::learner {

/// What the config needs to know of an algorithm.
struct AlgorithmTraits {
  std::string_view name;   ///< The value of `learner.algorithm`.
  bool is_stochastic;      ///< Its policy draws actions from a Gaussian.
  bool is_taught = false;  ///< It learns from teachers' actions (actor/teachers.h), not rewards.
};

/// All algorithms. learner/algorithm.cc says how each is made.
inline constexpr AlgorithmTraits kAlgorithms[] = {
    {"td3", false}, {"ddpg", false}, {"sac", true}, {"tqc", true}, {"distillation", false, true}};

/// The choices for `LearnerConfig::algorithm`: the names above.
base::OneOf AlgorithmChoices();

/// Where the learner computes.
enum class DeviceChoice { kAuto, kCpu, kCuda };
inline base::OneOf EnumNames(DeviceChoice) { return {"auto", "cpu", "cuda"}; }

/// The algorithm and its parameters. The defaults are the original's TD3 (docs/original-system.md,
/// sections 3.1 and 3.2).
struct LearnerConfig {
  std::string algorithm = "td3";
  std::string from;
  DeviceChoice device = DeviceChoice::kAuto;
  int threads = 1;
  double actor_learning_rate = 1e-5;
  double critic_learning_rate = 2e-5;
  double final_learning_rate_fraction = 1.0;
  int batch_size = 128;
  double gamma = 0.99;
  int n_step = 4;
  int extra_discount_steps = 0;
  double tau = 0.005;
  double target_noise = 0.2;
  double noise_clip = 0.5;
  int policy_delay = 2;
  double preactivation_penalty = 0.0;
  double temperature = 0.2;
  double temperature_learning_rate = 3e-4;
  double target_entropy = -2.0;
  double log_std_min = -5.0;
  double log_std_max = 2.0;
  double reward_scale = 1.0;
  bool mirror = false;
  double average_rate = 0.0;
  bool prioritized = false;
  double importance_exponent = 0.4;
  double divergence_limit = 1e5;
  int quantile_critics = 5;
  int quantiles = 25;
  int dropped_quantiles = 2;

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf for_td3{"algorithm", {"td3"}}, for_sac{"algorithm", {"sac", "tqc"}},
        for_tqc{"algorithm", {"tqc"}};
    v("algorithm", algorithm, AlgorithmChoices(), "", "The update rule (docs/algorithms.md).");
    v("from", from,
      "Policy file whose actor training starts from: the actor, its target network and its average "
      "have these weights, and all else starts new. The policy needs the observation, network, "
      "actions and kind of distribution of the run (docs/training.md). Empty: random weights.");
    v("device", device, "Where the learner computes. auto: on a GPU if LibTorch finds one.");
    v("threads", threads, base::Range{1, 16}, "",
      "Threads that compute an update: each takes some of a minibatch's rows, then some of the "
      "parameters. All numbers above 1 give the same bits; 1 sums in another order. Two critics "
      "keep up to four threads busy, and an actor two. TQC hardly gains (docs/training.md). "
      "Deterministic runs use one thread, as do GPUs and networks with dropout.");
    v("actor_learning_rate", actor_learning_rate, base::Range{0.0, 1.0}, "",
      "Adam's learning rate for the actor.");
    v("critic_learning_rate", critic_learning_rate, base::Range{0.0, 1.0}, "",
      "Adam's learning rate for the critics.");
    v("final_learning_rate_fraction", final_learning_rate_fraction, base::Range{0.0, 1.0}, "",
      "Both learning rates fall linearly, from their full values at the start of training to this "
      "fraction of them at its limit (run.max_steps, run.max_seconds). A run that is resumed with "
      "a larger limit goes on with the rates of its new share of the limit, which are higher.");
    v("batch_size", batch_size, base::Range{1, 65536}, "", "Transitions per update.");
    v("gamma", gamma, base::Range{0.0, 1.0}, "", "Discount per control step.");
    v("n_step", n_step, base::Range{1, 100}, "steps",
      "Most steps whose rewards an n-step return sums.");
    v("extra_discount_steps", extra_discount_steps, base::Range{0, 10}, "steps",
      "The value after an n-step window is discounted by this many steps more than the window has. "
      "The original's code: 1 (docs/original-system.md, section 3.4, F2).");
    v("tau", tau, base::Range{0.0, 1.0}, "",
      "Rate at which the target networks follow the trained networks (Polyak averaging), per actor "
      "update.");
    v("target_noise", target_noise, base::Range{0.0, 10.0}, "",
      "Standard deviation of the noise on target actions.", for_td3);
    v("noise_clip", noise_clip, base::Range{0.0, 10.0}, "",
      "The noise on target actions is clipped to this.", for_td3);
    v("policy_delay", policy_delay, base::Range{1, 100}, "",
      "Critic updates per update of the actor and the target networks.", for_td3);
    v("preactivation_penalty", preactivation_penalty, base::Range{0.0, 100.0}, "",
      "Weight of the squared inputs of tanh in the actor's loss, so that the actor does not get "
      "stuck at the largest actions (docs/networks.md).",
      base::ReadIf{"algorithm", {"td3", "ddpg", "distillation"}});
    v("temperature", temperature, base::Range{1e-6, 1e3}, "",
      "Initial temperature, that is, weight of the entropy.", for_sac);
    v("temperature_learning_rate", temperature_learning_rate, base::Range{0.0, 1.0}, "",
      "Adam's learning rate for the logarithm of the temperature. 0: the temperature is constant.",
      for_sac);
    v("target_entropy", target_entropy, base::Range{-100.0, 100.0}, "nats",
      "Entropy of the policy that adapting the temperature aims at.", for_sac);
    v("log_std_min", log_std_min, base::Range{-20.0, 2.0}, "",
      "Smallest logarithm of the policy's standard deviation, before tanh. The original's: -1.",
      for_sac);
    v("log_std_max", log_std_max, base::Range{-20.0, 5.0}, "",
      "Largest logarithm of that standard deviation. The original's: 1.", for_sac);
    v("reward_scale", reward_scale, base::Range{1e-6, 1e6}, "",
      "Rewards are multiplied by this before they are learned from.");
    v("mirror", mirror,
      "Replace each sample, with probability 1/2, by its mirror image (left and right swapped).");
    v("average_rate", average_rate, base::Range{0.0, 1.0}, "",
      "Rate of the Polyak average of the actor's weights, per actor update. Early in training, the "
      "average covers about the last fifth of the updates. 0: no averaging.");
    v("prioritized", prioritized,
      "Draw transitions in proportion to their last temporal-difference error (Schaul et al. 2016; "
      "alpha is replay_server.priority_exponent).",
      base::ReadIf{"algorithm", {"td3", "ddpg", "sac", "tqc"}});
    v("importance_exponent", importance_exponent, base::Range{0.0, 1.0}, "",
      "Exponent beta of the importance weights.", base::ReadIf{"prioritized"});
    v("divergence_limit", divergence_limit, base::Range{1.0, 1e30}, "",
      "Mean action value, in scaled rewards, beyond which training counts as diverged.");
    v("quantile_critics", quantile_critics, base::Range{1, 20}, "", "Number of critics.", for_tqc);
    v("quantiles", quantiles, base::Range{1, 200}, "",
      "Quantiles of the return that a critic gives.", for_tqc);
    v("dropped_quantiles", dropped_quantiles, base::Range{0, 199}, "",
      "Largest quantiles per critic that targets leave out; must be less than quantiles.", for_tqc);
  }
};

/// The traits of `config.algorithm`.
const AlgorithmTraits& TraitsOf(const LearnerConfig& config);

/// How the multiplier of the constraint is set.
enum class ConstraintKind { kNone, kLagrangian, kFixed };
inline base::OneOf EnumNames(ConstraintKind) { return {"none", "lagrangian", "fixed"}; }

/// A constraint on the cost of an episode: how often the robot collides (the paper's section on
/// safe RL; docs/original-system.md, section 4), or what an environment of one's own counts.
struct ConstraintConfig {
  ConstraintKind kind = ConstraintKind::kNone;
  double limit = 0.1;
  double multiplier = 0.0;
  double multiplier_max = 100.0;
  double learning_rate = 0.002;
  double proportional_gain = 0.0;
  double derivative_gain = 0.0;
  double learning_starts = 0.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf for_lagrangian{"kind", {"lagrangian"}};
    v("kind", kind,
      "none: no constraint. lagrangian: a multiplier that rises while the policy's episodes cost "
      "more than the limit (dual ascent). fixed: a constant multiplier, as in the original's "
      "code.");
    v("limit", limit, base::Range{0.0, 1e9}, "cost/episode",
      "Cost that is allowed per training episode, on average, with exploration noise. On courses a "
      "step with a collision costs 1.",
      for_lagrangian);
    v("multiplier", multiplier, base::Range{0.0, 1e6}, "",
      "The multiplier, lambda, at the start; if the kind is \"fixed\", throughout (the original's: "
      "2, 5 or 10).");
    v("multiplier_max", multiplier_max, base::Range{0.0, 1e6}, "", "Largest lambda.",
      for_lagrangian);
    v("learning_rate", learning_rate, base::Range{0.0, 100.0}, "",
      "Integral gain: how much lambda moves per finished episode and unit of violation.",
      for_lagrangian);
    v("proportional_gain", proportional_gain, base::Range{0.0, 1e6}, "",
      "Proportional gain: this times the violation is added to lambda (PID-Lagrangian, Stooke et "
      "al. 2020).",
      for_lagrangian);
    v("derivative_gain", derivative_gain, base::Range{0.0, 1e6}, "",
      "Derivative gain: this times the rise in cost since lambda last moved is added, too; a "
      "fall adds nothing.",
      for_lagrangian);
    v("learning_starts", learning_starts, base::Range{0.0, 1e9}, "episodes",
      "Finished episodes before lambda starts to move.", for_lagrangian);
  }
};

}  // namespace slalom::learner
