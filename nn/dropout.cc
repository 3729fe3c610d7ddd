#include "nn/dropout.h"

#include <ATen/ATen.h>

#include <cmath>
#include <cstdint>

#include "base/check.h"
#include "nn/layer_ops.h"

namespace slalom::nn {

Dropout::Dropout(double rate, const at::Tensor& like, base::Random* random)
    : rate_(rate), random_(random), mask_(at::zeros_like(like)) {
  SLALOM_CHECK(rate > 0.0 && rate < 1.0 && random != nullptr);
  host_mask_ = IsHostFloat(mask_) ? mask_ : at::zeros(like.sizes(), at::kFloat);
}

void Dropout::Draw() {
  if (!mask_.defined()) return;
  // Two numbers from each word of the stream, kept where they are not below the rate.
  const std::uint32_t limit = static_cast<std::uint32_t>(std::lround(std::ldexp(rate_, 31)));
  const float scale = static_cast<float>(1.0 / (1.0 - rate_));
  float* const mask = host_mask_.data_ptr<float>();
  const std::int64_t size = host_mask_.numel();
  for (std::int64_t i = 0; i < size; i += 2) {
    const std::uint64_t word = random_->NextU64();
    mask[i] = static_cast<std::uint32_t>(word >> 33) >= limit ? scale : 0.0f;
    if (i + 1 < size) {
      mask[i + 1] = static_cast<std::uint32_t>(word & 0x7fffffff) >= limit ? scale : 0.0f;
    }
  }
  if (!IsHostFloat(mask_)) mask_.copy_(host_mask_);
}

void Dropout::Apply(at::Tensor& y) const {
  if (!mask_.defined()) return;
  if (!IsHostFloat(y)) {
    y.mul_(mask_);
    return;
  }
  const float* const mask = mask_.data_ptr<float>();
  float* const values = y.data_ptr<float>();
  for (std::int64_t i = 0; i < y.numel(); ++i) values[i] *= mask[i];
}

}  // namespace slalom::nn
