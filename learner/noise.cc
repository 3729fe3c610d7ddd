#include "learner/noise.h"

#include <ATen/ATen.h>

#include <algorithm>

namespace slalom::learner {

Noise::Noise(std::int64_t batch, std::int64_t width, at::Device device)
    : host_(at::zeros({batch, width}, at::kFloat)), values_(host_.to(device)) {}

at::Tensor& Noise::Draw(base::Random& random, double standard_deviation, double limit) {
  float* const values = host_.data_ptr<float>();
  for (std::int64_t i = 0; i < host_.numel(); ++i) {
    values[i] = static_cast<float>(std::clamp(standard_deviation * random.Normal(), -limit, limit));
  }
  if (!values_.is_cpu()) values_.copy_(host_);
  return values_;
}

}  // namespace slalom::learner
