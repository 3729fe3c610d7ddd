#include "learner/noise.h"

#include <algorithm>
#include <span>

namespace slalom::learner {

Noise::Noise(std::uint64_t seed, std::int64_t batch, at::Device device)
    : random_(seed),
      host_(at::zeros({batch, 2}, at::kFloat)),
      values_(device.is_cpu()
                  ? host_
                  : at::zeros({batch, 2}, at::TensorOptions(at::kFloat).device(device))) {}

const at::Tensor& Noise::Draw(double standard_deviation, double limit) {
  float* const values = host_.data_ptr<float>();
  for (std::int64_t i = 0; i < host_.numel(); ++i) {
    values[i] =
        static_cast<float>(std::clamp(standard_deviation * random_.Normal(), -limit, limit));
  }
  if (!values_.is_cpu()) values_.copy_(host_);
  return values_;
}

void Noise::SaveState(const std::string& name, policy::TensorMap& tensors) const {
  tensors[name] = policy::StoredTensor::Of(std::span<const std::uint64_t>(random_.state()));
}

void Noise::LoadState(const std::string& name, const policy::TensorFile& file) {
  base::Random::State state;
  file.Read(name, std::span(state));
  random_.set_state(state);
}

}  // namespace slalom::learner
