#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "policy/nn/feature_map.h"
#include "policy/nn/transition_model.h"
#include "replay/batch.h"

/// Shapes: `B` samples, `H` frames that the model reads, `K` steps.

namespace slalom::learner {

/// Rolls a transition model forward with the actions that were really taken. Returns the root mean
/// squared error per feature after 1, 2, ... K steps, [K], or an empty vector if no sample has a
/// whole window.
///
/// `rows`: B samples with a history of H + K frames. The rollout starts from the first H frames;
/// each later frame holds, as its last action, the action that led to it. Samples less than H + K
/// frames after the start of their episode are skipped. Predictions are the model's means, without
/// noise. Computes on the model's device; allocates. Requires: `model` has float32 parameters.
std::vector<double> PredictionErrors(const nn::TransitionModel& model, int member,
                                     const nn::FeatureMap& features,
                                     const replay::SampledRows& rows, at::Device device);

}  // namespace slalom::learner
