#include "learner/value_ops.h"

#include <algorithm>
#include <cmath>

#include "policy/layer_ops.h"

namespace slalom::learner {

using policy::IsHostFloat;

void CopyActions(const at::Tensor& from, at::Tensor& to) {
  if (!IsHostFloat(to)) {
    to.copy_(from);
    return;
  }
  const std::int64_t columns = to.size(1);
  for (std::int64_t i = 0; i < to.size(0); ++i) {
    const float* const source = from.data_ptr<float>() + i * from.stride(0);
    std::copy(source, source + columns, to.data_ptr<float>() + i * to.stride(0));
  }
}

void AddClippedNoise(const at::Tensor& from, const at::Tensor& noise, at::Tensor& to) {
  if (!IsHostFloat(to)) {
    to.copy_((from + noise).clamp(-1.0, 1.0));
    return;
  }
  for (std::int64_t i = 0; i < to.size(0); ++i) {
    const float* const action = from.data_ptr<float>() + i * from.stride(0);
    const float* const offset = noise.data_ptr<float>() + i * noise.stride(0);
    float* const row = to.data_ptr<float>() + i * to.stride(0);
    for (std::int64_t j = 0; j < to.size(1); ++j) {
      row[j] = std::clamp(action[j] + offset[j], -1.0f, 1.0f);
    }
  }
}

void MinimumTarget(std::span<const at::Tensor> values, const at::Tensor& reward,
                   const at::Tensor& discount, at::Tensor& y) {
  if (!IsHostFloat(y)) {
    at::Tensor least = values[0];
    for (const at::Tensor& value : values.subspan(1)) least = at::minimum(least, value);
    y.copy_(reward + discount * least.squeeze(1));
    return;
  }
  const float* const r = reward.data_ptr<float>();
  const float* const gamma = discount.data_ptr<float>();
  float* const result = y.data_ptr<float>();
  for (std::int64_t i = 0; i < y.numel(); ++i) {
    float least = values[0].data_ptr<float>()[i];
    for (const at::Tensor& value : values.subspan(1)) {
      least = std::min(least, value.data_ptr<float>()[i]);
    }
    result[i] = r[i] + gamma[i] * least;
  }
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

void WeighError(const at::Tensor& q, const at::Tensor& y, const at::Tensor& weight, double share,
                at::Tensor& dq, at::Tensor& error) {
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
