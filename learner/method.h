#pragma once

#include <cstdint>
#include <vector>

#include "learner/learner_config.h"
#include "learner/model_config.h"
#include "policy/policy.h"
#include "replay/batch.h"

/// The method that a config asks for, and what follows from it without LibTorch.

namespace slalom::learner {

/// Every section of a run's config that the learner reads.
struct MethodConfig {
  LearnerConfig learner;
  ConstraintConfig constraint;
  nn::TransitionModelConfig model;
  ModelTrainingConfig model_training;
  ImaginationConfig imagination;
};

/// Returns how the algorithm's policies choose actions. It is stored in every policy file.
policy::ActionDistribution DistributionOf(const LearnerConfig& config);

/// Returns the facts about the method's model that planning agents need. They are stored in every
/// policy file. `goal`: when the task's episodes end in success.
policy::PlanningSpec PlanningOf(const MethodConfig& method, const nn::GoalRule& goal = {});

/// Returns the samples of an update: the algorithm's batch, then the model's if there is one.
std::vector<replay::SampleSpec> SampleSpecs(const MethodConfig& method,
                                            const policy::PolicySpec& spec);

/// Returns the sample that one update of the model learns from, of at least `num_rows` rows.
replay::SampleSpec ModelSample(const ModelTrainingConfig& config, int history, int num_rows);

/// Returns the number of states that model rollouts start from for each replayed batch of
/// `batch_size`.
int NumStartingStates(const ImaginationConfig& config, int batch_size);
/// Returns the number of replayed transitions in a batch of MBPO.
std::int64_t NumReal(const ImaginationConfig& config, std::int64_t batch);

/// Returns the number of elites in an ensemble of this size. Only elites predict.
int NumElites(const ModelTrainingConfig& config, int ensemble);

}  // namespace slalom::learner
