#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "base/random.h"
#include "learner/constraint.h"
#include "learner/learner_config.h"
#include "learner/learner_stats.h"
#include "learner/minibatch.h"
#include "policy/policy.h"
#include "policy/safetensors.h"

namespace slalom::learner {

/// What an algorithm is made with; all of it outlives the algorithm.
struct AlgorithmContext {
  const LearnerConfig& config;
  const policy::PolicySpec& spec;
  int frame_size = 0;      ///< F
  std::uint64_t seed = 0;  ///< Of the learner: each stream of random numbers derives its own.
  base::Random& initial_weights;
  Minibatch& minibatch;    ///< Where every update finds its transitions.
  Totals& totals;          ///< Where it leaves its figures.
  Constraint* constraint;  ///< Null: none.
};

/// The update rule of one off-policy method, with the networks that it trains. Thread-compatible.
class Algorithm {
 public:
  virtual ~Algorithm() = default;

  /// One update from the context's minibatch, which it may overwrite (the actions). `rate`: what
  /// its learning rates are multiplied by. On the CPU: no allocation; on a GPU: no wait for it.
  virtual void Update(double rate) = 0;

  /// |Q(s, a) - y| of the last minibatch, mean of the critics, [B]. Requires: config.prioritized.
  virtual const at::Tensor& td_errors() const = 0;

  virtual int num_critics() const = 0;
  virtual const at::Tensor& actor_parameters() const = 0;    ///< [P]
  virtual const at::Tensor& average_parameters() const = 0;  ///< [P], averaged where that is on.
  virtual const at::Tensor& critic_parameters() const = 0;   ///< [K * P]

  /// Actions in the minibatch's next states, without noise, for those who imagine what comes next:
  /// the target actor's where there is one (TD3, DDPG), else the current policy's mode (SAC).
  /// Overwritten by the next call. [B, A]
  virtual const at::Tensor& ActNext() = 0;

  /// Adds the figures that are no means (the temperature).
  virtual void Describe(LearnerStats& /*stats*/) const {}

  /// Networks, optimisers and random streams.
  virtual void SaveState(policy::TensorMap& tensors) const = 0;
  virtual void LoadState(const policy::TensorFile& file) = 0;
};

/// The algorithm that `context.config.algorithm` names, out of the registry in algorithm.cc.
std::unique_ptr<Algorithm> MakeAlgorithm(const AlgorithmContext& context);

/// How the algorithm's policy chooses actions: part of every policy that it makes.
policy::ActionDistribution DistributionOf(const LearnerConfig& config);

}  // namespace slalom::learner
