#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <memory>

#include "base/random.h"
#include "learner/constraint.h"
#include "learner/learner_stats.h"
#include "learner/minibatch.h"
#include "policy/nn/safetensors.h"
#include "policy/policy.h"

namespace slalom::learner {

/// The parts that an algorithm is constructed from. They must outlive the algorithm.
struct AlgorithmContext {
  const LearnerConfig& config;
  const policy::PolicySpec& spec;
  std::uint64_t seed = 0;  ///< The learner's seed; each random stream derives its own from it.
  base::Random& initial_weights;
  Minibatch& minibatch;    ///< Holds the transitions of each update.
  Totals& totals;          ///< Collects the statistics of each update.
  Constraint* constraint;  ///< Null if there is none.
};

/// The update rule of one off-policy method, with the networks that it trains. Thread-compatible.
class Algorithm {
 public:
  virtual ~Algorithm() = default;

  /// Does one update from the context's minibatch, which the totals have counted. All learning
  /// rates are multiplied by `rate`. Does not wait for a GPU. TD3, DDPG and SAC allocate nothing on
  /// the CPU.
  ///
  /// An update does more than take steps on its losses. These duties are easy to forget, because
  /// nothing checks them:
  /// - It calls `Totals::CountActorUpdate` before each step of the actor, because averages depend
  ///   on it, and adds the figures that metrics report to the totals (`Total`).
  /// - With config.prioritized, it multiplies each transition's loss of the critics by
  ///   `Minibatch::weight` and writes `td_errors`.
  /// - With a constraint, it calls `Constraint::UpdateCritics` and adds `Constraint::Penalty` to
  ///   the actor's loss.
  virtual void Update(double rate) = 0;

  /// The absolute TD errors |Q(s, a) - y| of the last minibatch, averaged over the critics, [B].
  /// Requires: config.prioritized.
  virtual const at::Tensor& td_errors() const = 0;

  virtual int num_critics() const = 0;                     ///< 0 if it learns from no rewards.
  virtual const at::Tensor& actor_parameters() const = 0;  ///< [P]
  /// The averaged actor's parameters, or the actor's own if averaging is off, [P].
  virtual const at::Tensor& average_parameters() const = 0;
  virtual const at::Tensor& critic_parameters() const = 0;  ///< [K * P]

  /// Returns noise-free actions for the minibatch's next states, [B, A], as model rollouts need
  /// them: the target actor's if there is one (TD3, DDPG), else the current policy's mode (SAC).
  /// The next call overwrites them.
  virtual const at::Tensor& ActNext() = 0;

  /// Fills in the statistics that are not means over updates, such as SAC's temperature.
  virtual void Describe(LearnerStats& /*stats*/) const {}

  /// Gives the actor, its target network if it has one, and its average these weights, [P]. To be
  /// called before the first update.
  virtual void StartFrom(const at::Tensor& actor_parameters) = 0;

  /// Saves and restores networks, optimisers and random streams.
  virtual void SaveState(nn::TensorMap& tensors) const = 0;
  virtual void LoadState(const nn::TensorFile& file) = 0;
};

std::unique_ptr<Algorithm> MakeTd3(const AlgorithmContext& context);
std::unique_ptr<Algorithm> MakeDdpg(const AlgorithmContext& context);
std::unique_ptr<Algorithm> MakeSac(const AlgorithmContext& context);
std::unique_ptr<Algorithm> MakeTqc(const AlgorithmContext& context);
std::unique_ptr<Algorithm> MakeDistillation(const AlgorithmContext& context);

/// The averaged actor's rate for the n-th actor update, which was just counted. It is at least
/// 5 / (5 + n), so that the average soon forgets the untrained weights. 0 if averaging is off.
double PolicyAverageRate(const LearnerConfig& config, const Totals& totals);

/// Makes the algorithm that `context.config.algorithm` names.
std::unique_ptr<Algorithm> MakeAlgorithm(const AlgorithmContext& context);

}  // namespace slalom::learner
