#pragma once

#include <span>
#include <vector>

#include "base/random.h"
#include "env/action.h"

/// The arithmetic of planning by samples, without networks. Shapes: `S` action sequences, `T` steps
/// of the horizon.

namespace slalom::policy {

/// A plan: the mean action of each of the next T steps, and the deviation of samples from it.
struct ActionPlan {
  explicit ActionPlan(int horizon) : mean(horizon), deviation(horizon) {}

  std::vector<env::Action> mean;       ///< [T]
  std::vector<env::Action> deviation;  ///< [T]
};

/// S action sequences with their returns and weights. Allocates on construction only.
struct ActionSamples {
  ActionSamples(int horizon, int size);

  /// The actions of all sequences in step `t`, [S].
  std::span<env::Action> At(int t) {
    return std::span(actions).subspan(t * returns.size(), returns.size());
  }
  std::span<const env::Action> At(int t) const {
    return std::span(actions).subspan(t * returns.size(), returns.size());
  }

  std::vector<env::Action> actions;  ///< [T, S]
  std::vector<float> returns;        ///< [S]
  std::vector<float> weights;        ///< [S], which sum to 1
  std::vector<int> order;            ///< [S], room for sorting
};

/// Draws clip(centre + deviation * noise, -1, 1), with noise of its own for each number.
env::Action DrawAround(const env::Action& centre, const env::Action& deviation,
                       base::Random& random);

/// Sets w_s in proportion to e^(R_s / temperature) (MPPI: Williams et al. 2017, equation 6).
void WeighByReturn(double temperature, ActionSamples& samples);

/// Sets w_s to 1 / num_best for the sequences of highest return and to 0 for the others (CEM: Chua
/// et al. 2018, section 5).
void WeighTheBest(int num_best, ActionSamples& samples);

/// Sets the plan to the weighted mean and standard deviation of the actions, of at least 0.01.
void FitPlan(const ActionSamples& samples, ActionPlan& plan);

/// Draws a sequence by the weights.
int DrawSequence(const ActionSamples& samples, base::Random& random);

}  // namespace slalom::policy
