#pragma once

#include <ATen/core/Tensor.h>

#include "base/random.h"
#include "policy/nn/network_shape.h"

namespace slalom::learner {

/// Returns newly initialised parameters of `num_networks` networks of one shape, one network after
/// the other: [num_networks * P].
at::Tensor InitialParameters(const nn::NetworkShape& shape, int num_networks, base::Random& random,
                             at::Device device);

}  // namespace slalom::learner
