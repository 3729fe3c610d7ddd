#include "learner/stored_state.h"

#include <ATen/ATen.h>

#include <cstdint>
#include <span>
#include <vector>

namespace slalom::learner {

nn::StoredTensor StoreTensor(const at::Tensor& values) {
  const at::Tensor host = values.to(at::kCPU).contiguous();
  return nn::StoredTensor::Of(
      std::span<const float>(host.data_ptr<float>(), static_cast<std::size_t>(host.numel())),
      host.sizes().vec());
}

void ReadTensor(const nn::TensorFile& file, const std::string& name, at::Tensor& values) {
  std::vector<float> host(static_cast<std::size_t>(values.numel()));
  file.Read(name, std::span(host));
  values.copy_(at::from_blob(host.data(), values.sizes(), at::kFloat));
}

nn::StoredTensor StoreRandom(const base::Random& random) {
  return nn::StoredTensor::Of(std::span<const std::uint64_t>(random.state()));
}

void ReadRandom(const nn::TensorFile& file, const std::string& name, base::Random& random) {
  base::Random::State state;
  file.Read(name, std::span(state));
  random.set_state(state);
}

}  // namespace slalom::learner
