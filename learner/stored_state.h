#pragma once

#include <ATen/core/Tensor.h>

#include <string>

#include "base/random.h"
#include "policy/nn/safetensors.h"

/// How tensors and random streams of a learner's state are stored in a checkpoint. Reading throws
/// `base::Error` if a tensor is missing or of another size.

namespace slalom::learner {

/// Copy a float32 tensor on any device to and from a checkpoint.
nn::StoredTensor StoreTensor(const at::Tensor& values);
void ReadTensor(const nn::TensorFile& file, const std::string& name, at::Tensor& values);

/// Copy the state of a random stream to and from a checkpoint, so that its next numbers are the
/// same.
nn::StoredTensor StoreRandom(const base::Random& random);
void ReadRandom(const nn::TensorFile& file, const std::string& name, base::Random& random);

}  // namespace slalom::learner
