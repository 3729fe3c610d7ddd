#pragma once

#include <ATen/core/Tensor.h>

#include <string>

#include "base/random.h"
#include "policy/safetensors.h"

/// Parts of a learner's state as they stand in a checkpoint. Reading throws `base::Error` where a
/// tensor is missing or of another size.

namespace slalom::learner {

/// Copies between a float32 tensor on any device and a file.
policy::StoredTensor StoreTensor(const at::Tensor& values);
void ReadTensor(const policy::TensorFile& file, const std::string& name, at::Tensor& values);

/// The same of a stream of random numbers, at the place where it stands.
policy::StoredTensor StoreRandom(const base::Random& random);
void ReadRandom(const policy::TensorFile& file, const std::string& name, base::Random& random);

}  // namespace slalom::learner
