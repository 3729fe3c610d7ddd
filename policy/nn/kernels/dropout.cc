#include "policy/nn/kernels/dropout.h"

#include <ATen/ATen.h>

#include <span>

#include "base/check.h"
#include "policy/nn/kernels/forward_kernels.h"
#include "policy/nn/kernels/layer_ops.h"

namespace slalom::nn {
namespace {

std::span<float> Numbers(const at::Tensor& t) {
  return {t.data_ptr<float>(), static_cast<std::size_t>(t.numel())};
}

}  // namespace

Dropout::Dropout(double rate, const at::Tensor& like, base::Random* random)
    : rate_(rate), random_(random), mask_(at::zeros_like(like)) {
  SLALOM_CHECK(rate > 0.0 && rate < 1.0 && random != nullptr);
  host_mask_ = IsHostFloat(mask_) ? mask_ : at::zeros(like.sizes(), at::kFloat);
}

void Dropout::Draw() {
  if (!mask_.defined()) return;
  DrawDropoutMask(rate_, *random_, Numbers(host_mask_));
  if (!IsHostFloat(mask_)) mask_.copy_(host_mask_);
}

void Dropout::Apply(at::Tensor& y) const {
  if (!mask_.defined()) return;
  SLALOM_CHECK(y.sizes() == mask_.sizes() && y.is_contiguous());
  if (!IsHostFloat(y)) {
    y.mul_(mask_);
    return;
  }
  ApplyDropoutMask(Numbers(mask_), y.data_ptr<float>());
}

}  // namespace slalom::nn
