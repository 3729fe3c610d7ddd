#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "policy/feature_map.h"
#include "policy/transition_model.h"
#include "replay/batch.h"

/// Shapes: `B` samples, `H` frames that the model reads, `K` steps.

namespace slalom::learner {

/// How far a transition model is off after 1, 2, ... K steps when it is rolled forward by the
/// actions that were really taken: for each step the root of the mean squared error of a feature,
/// [K]. Nothing where no sample has a whole window.
///
/// `rows`: B samples with a history of H + K frames. Their first H frames are where the model
/// begins; each later one holds, as its last action, the one that led to it. Samples less than H +
/// K frames after the begin of their episode are passed over. The model's means are taken (no
/// noise). On the model's device; allocates. Requires: parameters of `model` in float32.
std::vector<double> PredictionErrors(const policy::TransitionModel& model, int member,
                                     const policy::FeatureMap& features,
                                     const replay::SampledRows& rows, at::Device device);

}  // namespace slalom::learner
