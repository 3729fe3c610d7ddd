#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/config_field.h"
#include "policy/policy.h"
#include "policy/safetensors.h"
#include "replay/batch.h"

namespace slalom::learner {

/// What TD3 is. The defaults are the original's (original-system.md §3.1).
struct Td3Config {
  std::string device = "auto";
  double actor_learning_rate = 1e-5;
  double critic_learning_rate = 2e-5;
  double final_learning_rate_fraction = 1.0;
  int batch_size = 128;
  double gamma = 0.99;
  int n_step = 4;
  double tau = 0.005;
  double target_noise = 0.2;
  double noise_clip = 0.5;
  int policy_delay = 2;
  double reward_scale = 1.0;
  bool mirror = false;
  double average_rate = 0.0;
  bool prioritized = false;
  double importance_exponent = 0.4;
  double divergence_limit = 1e5;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("device", device, base::OneOf{"auto", "cpu", "cuda"}, "",
      "Where the learner computes; auto: a GPU where LibTorch finds one.");
    v("actor_learning_rate", actor_learning_rate, base::Range{0.0, 1.0}, "",
      "Adam's step size for the actor.");
    v("critic_learning_rate", critic_learning_rate, base::Range{0.0, 1.0}, "",
      "Adam's step size for the critics.");
    v("final_learning_rate_fraction", final_learning_rate_fraction, base::Range{0.0, 1.0}, "",
      "Both step sizes fall linearly to this part of themselves at the end of training.");
    v("batch_size", batch_size, base::Range{1, 65536}, "", "Transitions per update.");
    v("gamma", gamma, base::Range{0.0, 1.0}, "", "Discount per control step.");
    v("n_step", n_step, base::Range{1, 100}, "steps", "Longest window of a return.");
    v("tau", tau, base::Range{0.0, 1.0}, "",
      "Rate at which target networks follow, per actor update.");
    v("target_noise", target_noise, base::Range{0.0, 10.0}, "",
      "Standard deviation of the noise on target actions.");
    v("noise_clip", noise_clip, base::Range{0.0, 10.0}, "", "Largest noise on target actions.");
    v("policy_delay", policy_delay, base::Range{1, 100}, "",
      "Critic updates per update of actor and targets.");
    v("reward_scale", reward_scale, base::Range{1e-6, 1e6}, "",
      "What rewards are multiplied by before they are learned from.");
    v("mirror", mirror, "Replace each sample, with probability 1/2, by its mirror image.");
    v("average_rate", average_rate, base::Range{0.0, 1.0}, "",
      "Rate at which the averaged actor follows, per actor update; 0: no averaging. Early on it is "
      "the mean of about the last fifth.");
    v("prioritized", prioritized,
      "Draw transitions in proportion to their last temporal-difference error (Schaul et al. 2016; "
      "alpha is replay_server.priority_exponent).");
    v("importance_exponent", importance_exponent, base::Range{0.0, 1.0}, "",
      "beta of the importance weights, where prioritized.");
    v("divergence_limit", divergence_limit, base::Range{1.0, 1e30}, "",
      "Mean action value, scaled, beyond which training counts as diverged.");
  }
};

/// Means over the updates since the last reading.
struct Td3Stats {
  std::int64_t num_updates = 0;  ///< Critic updates that the means are over.
  double critic_loss = 0.0;      ///< Mean squared error, of one critic.
  double q_mean = 0.0;           ///< Of both critics on the batch, scaled as the rewards.
  double critic_gradient_norm = 0.0;
  double actor_q_mean = 0.0;  ///< Q_1(s, pi(s)): what the actor climbs.
  double actor_gradient_norm = 0.0;
};

/// Twin Delayed Deep Deterministic policy gradient (Fujimoto, van Hoof and Meger 2018, algorithm
/// 1), with n-step returns, mirror images and a weight-averaged actor as options.
/// docs/algorithms.md maps its equations to functions. Thread-compatible: one owner.
class Td3 {
 public:
  /// Networks and noise are drawn from `seed`. Throws `base::Error` where the config cannot be met
  /// (no GPU, sectors that do not divide the beams).
  Td3(const Td3Config& config, const policy::PolicySpec& spec, std::uint64_t seed);
  ~Td3();

  /// Copies what an update needs out of the rows, which may be overwritten after.
  /// Requires: rows sampled as `sample_spec()` says.
  void Load(const replay::SampledRows& rows);

  /// One update from the batch that was loaded. `progress`: part of training that is done, in [0,
  /// 1], for the learning rates. On the CPU: no allocation; on a GPU: no wait for it.
  void Update(double progress);

  /// Both.
  void Update(const replay::SampledRows& rows, double progress) {
    Load(rows);
    Update(progress);
  }

  replay::SampleSpec sample_spec() const;

  /// The new priorities of the last batch's samples: |Q(s, a) - y|, mean of the critics, [B]. Valid
  /// until the next `Update`. Waits for the device. Requires: config.prioritized, one update.
  std::span<const float> Errors();

  /// Reads the statistics and starts new ones. Waits for the device; call it once in many updates.
  Td3Stats ReadStats();

  /// What is wrong with the training, in words for the user: a network with NaN or infinite
  /// weights, or values beyond the limit. Empty while it is well. Waits for the device. Looks at
  /// the last `ReadStats`.
  std::optional<std::string> FindFault() const;
  bool healthy() const { return !FindFault(); }

  /// The actor as it is, or its weights' average (as it is where averaging is off). Version:
  /// updates done.
  policy::PolicySnapshot Snapshot() const;
  policy::PolicySnapshot AveragedSnapshot() const;

  std::int64_t num_updates() const;
  std::string device() const;  ///< "cpu" or "cuda".

  /// Everything that an update depends on: after `LoadState` of what `SaveState` gave, updates go
  /// on bit for bit on the same kind of device. Names begin with "td3.", "actor." or "critics.".
  void SaveState(policy::TensorMap& tensors) const;
  /// Throws `base::Error` where a tensor is missing or of another size.
  void LoadState(const policy::TensorFile& file);

 private:
  struct Parts;

  Td3Config config_;
  policy::PolicySpec spec_;
  std::unique_ptr<Parts> parts_;
};

}  // namespace slalom::learner
