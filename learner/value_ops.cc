#include "learner/value_ops.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>

#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/tensor_rows.h"

namespace slalom::learner {

using nn::IsHostFloat;

void CopyActions(const at::Tensor& from, at::Tensor& to) {
  if (!IsHostFloat(to)) {
    to.copy_(from);
    return;
  }
  const nn::TensorRows sources(from), rows(to);
  const std::int64_t batch = to.size(0), columns = to.size(1);
  for (std::int64_t i = 0; i < batch; ++i) std::copy_n(sources[i], columns, rows[i]);
}

void AddClippedNoise(const at::Tensor& from, const at::Tensor& noise, at::Tensor& to) {
  if (!IsHostFloat(to)) {
    to.copy_((from + noise).clamp(-1.0, 1.0));
    return;
  }
  const nn::TensorRows actions(from), offsets(noise), rows(to);
  const std::int64_t batch = to.size(0), columns = to.size(1);
  for (std::int64_t i = 0; i < batch; ++i) {
    for (std::int64_t j = 0; j < columns; ++j) {
      rows[i][j] = std::clamp(actions[i][j] + offsets[i][j], -1.0f, 1.0f);
    }
  }
}

void TdTarget(std::span<const at::Tensor> values, TargetReduction reduction,
              const at::Tensor& reward, const at::Tensor& discount, at::Tensor& y) {
  const bool least = reduction == TargetReduction::kMin;
  if (!IsHostFloat(y)) {
    at::Tensor chosen = values[0];
    for (const at::Tensor& value : values.subspan(1)) {
      chosen = least ? at::minimum(chosen, value) : at::maximum(chosen, value);
    }
    y.copy_(reward + discount * chosen.squeeze(1));
    return;
  }
  const float* const r = reward.data_ptr<float>();
  const float* const gamma = discount.data_ptr<float>();
  float* const result = y.data_ptr<float>();
  for (std::int64_t i = 0; i < y.numel(); ++i) {
    float chosen = values[0].data_ptr<float>()[i];
    for (const at::Tensor& value : values.subspan(1)) {
      const float other = value.data_ptr<float>()[i];
      chosen = least ? std::min(chosen, other) : std::max(chosen, other);
    }
    result[i] = r[i] + gamma[i] * chosen;
  }
}

void MinGradient(std::span<const at::Tensor> q, std::span<at::Tensor> dq, at::Tensor& value_total) {
  const std::int64_t batch = q[0].size(0);
  const double share = -1.0 / static_cast<double>(batch);
  if (!IsHostFloat(q[0])) {
    at::Tensor least = q[0].clone();
    dq[0].fill_(share);
    for (std::size_t k = 1; k < q.size(); ++k) {
      const at::Tensor less = q[k] < least;
      for (std::size_t before = 0; before < k; ++before) dq[before].masked_fill_(less, 0.0);
      dq[k].copy_(less);
      dq[k].mul_(share);
      least = at::minimum(least, q[k]);
    }
    value_total.add_(least.mean());
    return;
  }
  double sum = 0.0;
  for (std::int64_t i = 0; i < batch; ++i) {
    std::size_t least = 0;
    for (std::size_t k = 1; k < q.size(); ++k) {
      if (q[k].data_ptr<float>()[i] < q[least].data_ptr<float>()[i]) least = k;
    }
    for (std::size_t k = 0; k < q.size(); ++k) {
      dq[k].data_ptr<float>()[i] = k == least ? static_cast<float>(share) : 0.0f;
    }
    sum += q[least].data_ptr<float>()[i];
  }
  *value_total.data_ptr<double>() += sum / static_cast<double>(batch);
}

void SquaredError(const at::Tensor& q, const at::Tensor& y, at::Tensor& dq, at::Tensor& loss_total,
                  at::Tensor& value_total) {
  const std::int64_t batch = y.numel();
  if (!IsHostFloat(q)) {
    const at::Tensor error = q.squeeze(1) - y;
    loss_total.add_(error.square().mean());
    value_total.add_(q.mean());
    dq.copy_((error * (2.0 / static_cast<double>(batch))).unsqueeze(1));
    return;
  }
  const float* const value = q.data_ptr<float>();
  const float* const target = y.data_ptr<float>();
  float* const gradient = dq.data_ptr<float>();
  const float scale = 2.0f / static_cast<float>(batch);
  double squared = 0.0;
  double sum = 0.0;
  for (std::int64_t i = 0; i < batch; ++i) {
    const float error = value[i] - target[i];
    gradient[i] = scale * error;
    squared += static_cast<double>(error) * error;
    sum += value[i];
  }
  *loss_total.data_ptr<double>() += squared / static_cast<double>(batch);
  *value_total.data_ptr<double>() += sum / static_cast<double>(batch);
}

void ApplyImportanceWeights(const at::Tensor& q, const at::Tensor& y, const at::Tensor& weight,
                            double share, at::Tensor& dq, at::Tensor& error) {
  if (!IsHostFloat(q)) {
    error.add_((q.squeeze(1) - y).abs(), share);
    dq.mul_(weight.unsqueeze(1));
    return;
  }
  const float* const value = q.data_ptr<float>();
  const float* const target = y.data_ptr<float>();
  const float* const factor = weight.data_ptr<float>();
  float* const gradient = dq.data_ptr<float>();
  float* const errors = error.data_ptr<float>();
  for (std::int64_t i = 0; i < y.numel(); ++i) {
    errors[i] += static_cast<float>(share) * std::abs(value[i] - target[i]);
    gradient[i] *= factor[i];
  }
}

void AddMean(const at::Tensor& q, at::Tensor& value_total) {
  if (!IsHostFloat(q)) {
    value_total.add_(q.mean());
    return;
  }
  const float* const value = q.data_ptr<float>();
  double sum = 0.0;
  for (std::int64_t i = 0; i < q.numel(); ++i) sum += value[i];
  *value_total.data_ptr<double>() += sum / static_cast<double>(q.numel());
}

}  // namespace slalom::learner
