#include "policy/nn/kernels/sequence_ops.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "base/check.h"
#include "base/vector_clones.h"
#include "policy/nn/kernels/forward_kernels.h"
#include "policy/nn/kernels/lane_sums.h"
#include "policy/nn/kernels/smooth_math.h"
#include "policy/nn/kernels/tensor_rows.h"

namespace slalom::nn {
namespace {

constexpr double kLayerNormEpsilon = 1e-5;
constexpr double kGeluScale = 0.79788456080286536;  // sqrt(2 / pi)
constexpr double kGeluCube = 0.044715;

/// dx may be dy if not `add`.
SLALOM_SIMD void NormaliseRowGradient(const float* __restrict gain, std::int64_t n,
                                      const float* __restrict normal, float rstd, const float* dy,
                                      bool add, float* dx, float* __restrict dgain,
                                      float* __restrict dbias) {
  float sums[kLanes] = {}, dots[kLanes] = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    for (int j = 0; j < kLanes; ++j) {
      const float scaled = dy[i + j] * gain[i + j];
      sums[j] += scaled;
      dots[j] += scaled * normal[i + j];
    }
  }
  for (; i < n; ++i) {
    sums[0] += dy[i] * gain[i];
    dots[0] += dy[i] * gain[i] * normal[i];
  }
  const float count = static_cast<float>(n);
  const float mean = LaneSum(sums) / count;
  const float slope = LaneSum(dots) / count;
  for (std::int64_t j = 0; j < n; ++j) {
    dgain[j] += dy[j] * normal[j];
    dbias[j] += dy[j];
  }
  if (add) {
    for (std::int64_t j = 0; j < n; ++j) {
      dx[j] += (dy[j] * gain[j] - mean - normal[j] * slope) * rstd;
    }
  } else {
    for (std::int64_t j = 0; j < n; ++j) {
      dx[j] = (dy[j] * gain[j] - mean - normal[j] * slope) * rstd;
    }
  }
}

constexpr float kScale = static_cast<float>(kGeluScale);
constexpr float kCube = static_cast<float>(kGeluCube);

SLALOM_ALWAYS_INLINE float GeluTanh(float x) {
  return SmoothTanh(kScale * (x + kCube * x * x * x));
}

SLALOM_SIMD void GeluRowGradient(const float* __restrict x, std::int64_t n, float* __restrict dy) {
  for (std::int64_t j = 0; j < n; ++j) {
    const float t = GeluTanh(x[j]);
    const float slope = kScale * (1.0f + 3.0f * kCube * x[j] * x[j]);
    dy[j] *= 0.5f * (1.0f + t) + 0.5f * x[j] * (1.0f - t * t) * slope;
  }
}

/// `dbefore` may be null.
SLALOM_SIMD void GruRowGradient(const float* __restrict before, const float* __restrict dafter,
                                std::int64_t w, float* __restrict state, float* __restrict gates,
                                float* __restrict dbefore) {
  float* __restrict const reset = gates;
  float* __restrict const update = gates + w;
  float* __restrict const fresh = gates + 2 * w;
  if (dbefore != nullptr) {
    for (std::int64_t j = 0; j < w; ++j) dbefore[j] += dafter[j] * update[j];
  }
  for (std::int64_t j = 0; j < w; ++j) {
    const float r = reset[j], z = update[j], n = fresh[j];
    const float dn = dafter[j] * (1.0f - z) * (1.0f - n * n);
    const float dz = dafter[j] * (before[j] - n) * z * (1.0f - z);
    const float dr = dn * state[2 * w + j] * r * (1.0f - r);
    reset[j] = dr;
    update[j] = dz;
    fresh[j] = dn;
    state[j] = dr;
    state[w + j] = dz;
    state[2 * w + j] = dn * r;
  }
}

/// One number for each of the columns, or for each of the rows.
void CheckSizes(const at::Tensor& y, std::int64_t columns, std::int64_t rows) {
  SLALOM_CHECK_EQ(columns, y.size(1));
  SLALOM_CHECK_EQ(rows, y.size(0));
}

/// before, after: [N, W]; gates: [N, 3 W].
void CheckGru(const at::Tensor& before, const at::Tensor& state_gates, const at::Tensor& gates,
              const at::Tensor& after) {
  SLALOM_CHECK(after.sizes() == before.sizes());
  SLALOM_CHECK(state_gates.sizes() == gates.sizes());
  CheckSizes(gates, 3 * before.size(1), before.size(0));
}

}  // namespace

void AddTo(const at::Tensor& x, at::Tensor& y) {
  SLALOM_CHECK(x.dim() == 1 ? x.size(0) == y.size(1) : x.sizes() == y.sizes());
  if (!IsHostFloat(y)) {
    y.add_(x);
    return;
  }
  AddRows({y.size(0), y.size(1)}, TensorRows(x), TensorRows(y));
}

void SetRows(const at::Tensor& row, at::Tensor& y) {
  SLALOM_CHECK_EQ(row.numel(), y.size(1));
  if (!IsHostFloat(y)) {
    y.copy_(row.expand_as(y));
    return;
  }
  const TensorRows from(row), to(y);
  const std::int64_t rows = y.size(0), columns = y.size(1);
  for (std::int64_t i = 0; i < rows; ++i) std::copy_n(from[i], columns, to[i]);
}

void AddColumnSums(const at::Tensor& x, at::Tensor& sum) {
  SLALOM_CHECK_EQ(sum.numel(), x.size(1));
  if (!IsHostFloat(x)) {
    sum.add_(x.sum(0));
    return;
  }
  // Each row is added to the one row of the sum.
  AddRows({x.size(0), x.size(1)}, TensorRows(x), {sum.data_ptr<float>(), 0});
}

void LayerNorm(const at::Tensor& gain, const at::Tensor& bias, const at::Tensor& x, at::Tensor& y,
               at::Tensor& normal, at::Tensor& rstd) {
  SLALOM_CHECK(x.sizes() == y.sizes() && x.sizes() == normal.sizes());
  CheckSizes(x, gain.numel(), rstd.numel());
  SLALOM_CHECK_EQ(bias.numel(), gain.numel());
  if (!IsHostFloat(x)) {
    const at::Tensor centred = x - x.mean(1, /*keepdim=*/true);
    rstd.copy_((centred.square().mean(1) + kLayerNormEpsilon).rsqrt());
    normal.copy_(centred * rstd.unsqueeze(1));
    y.copy_(normal * gain + bias);
    return;
  }
  LayerNormRows({x.size(0), x.size(1)}, gain.data_ptr<float>(), bias.data_ptr<float>(),
                TensorRows(x), TensorRows(y), TensorRows(normal), rstd.data_ptr<float>());
}

void LayerNormGradient(const at::Tensor& gain, const at::Tensor& normal, const at::Tensor& rstd,
                       const at::Tensor& dy, at::Tensor& dx, at::Tensor& dgain, at::Tensor& dbias,
                       Into into) {
  const bool add = into == Into::kAdd;
  SLALOM_CHECK(dx.sizes() == dy.sizes() && normal.sizes() == dy.sizes());
  CheckSizes(dy, gain.numel(), rstd.numel());
  SLALOM_CHECK(dgain.numel() == gain.numel() && dbias.numel() == gain.numel());
  if (!IsHostFloat(dy)) {
    dgain.copy_((dy * normal).sum(0));
    dbias.copy_(dy.sum(0));
    const at::Tensor scaled = dy * gain;
    const at::Tensor slope = (scaled * normal).mean(1, /*keepdim=*/true);
    const at::Tensor result =
        (scaled - scaled.mean(1, /*keepdim=*/true) - normal * slope) * rstd.unsqueeze(1);
    if (add) {
      dx.add_(result);
    } else {
      dx.copy_(result);
    }
    return;
  }
  float* const gain_gradient = dgain.data_ptr<float>();
  float* const bias_gradient = dbias.data_ptr<float>();
  std::fill(gain_gradient, gain_gradient + dy.size(1), 0.0f);
  std::fill(bias_gradient, bias_gradient + dy.size(1), 0.0f);
  const TensorRows from(dy), to(dx), normals(normal);
  const float* const gains = gain.data_ptr<float>();
  const float* const scales = rstd.data_ptr<float>();
  const std::int64_t rows = dy.size(0), columns = dy.size(1);
  for (std::int64_t i = 0; i < rows; ++i) {
    NormaliseRowGradient(gains, columns, normals[i], scales[i], from[i], add, to[i], gain_gradient,
                         bias_gradient);
  }
}

void Gelu(const at::Tensor& x, at::Tensor& y) {
  SLALOM_CHECK(x.sizes() == y.sizes() && x.is_contiguous() && y.is_contiguous());
  if (!IsHostFloat(x)) {
    y.copy_(0.5 * x * (1.0 + at::tanh(kGeluScale * (x + kGeluCube * x * x * x))));
    return;
  }
  GeluNumbers(x.data_ptr<float>(), x.numel(), y.data_ptr<float>());
}

void GeluGradient(const at::Tensor& x, at::Tensor& dy) {
  SLALOM_CHECK(x.sizes() == dy.sizes() && x.is_contiguous() && dy.is_contiguous());
  if (!IsHostFloat(x)) {
    const at::Tensor t = at::tanh(kGeluScale * (x + kGeluCube * x * x * x));
    dy.mul_(0.5 * (1.0 + t) +
            0.5 * x * (1.0 - t * t) * kGeluScale * (1.0 + 3.0 * kGeluCube * x * x));
    return;
  }
  GeluRowGradient(x.data_ptr<float>(), x.numel(), dy.data_ptr<float>());
}

void GruStep(const at::Tensor& before, const at::Tensor& state_gates, at::Tensor& gates,
             at::Tensor& after) {
  CheckGru(before, state_gates, gates, after);
  const std::int64_t w = before.size(1);
  if (!IsHostFloat(before)) {
    at::Tensor both = gates.narrow(1, 0, 2 * w);
    both.add_(state_gates.narrow(1, 0, 2 * w)).sigmoid_();
    at::Tensor fresh = gates.narrow(1, 2 * w, w);
    fresh.add_(gates.narrow(1, 0, w) * state_gates.narrow(1, 2 * w, w)).tanh_();
    after.copy_(fresh + gates.narrow(1, w, w) * (before - fresh));
    return;
  }
  GruStepRows({before.size(0), w}, TensorRows(before), TensorRows(state_gates), TensorRows(gates),
              TensorRows(after));
}

void GruStepGradient(const at::Tensor& before, const at::Tensor& dafter, at::Tensor& state_gates,
                     at::Tensor& gates, at::Tensor& dbefore) {
  CheckGru(before, state_gates, gates, dafter);
  if (dbefore.defined()) SLALOM_CHECK(dbefore.sizes() == before.sizes());
  const std::int64_t w = before.size(1);
  if (!IsHostFloat(before)) {
    const at::Tensor r = gates.narrow(1, 0, w).clone(), z = gates.narrow(1, w, w).clone(),
                     n = gates.narrow(1, 2 * w, w).clone();
    if (dbefore.defined()) dbefore.add_(dafter * z);
    const at::Tensor dn = dafter * (1.0 - z) * (1.0 - n * n);
    const at::Tensor dz = dafter * (before - n) * z * (1.0 - z);
    const at::Tensor dr = dn * state_gates.narrow(1, 2 * w, w) * r * (1.0 - r);
    gates.copy_(at::cat({dr, dz, dn}, 1));
    state_gates.copy_(at::cat({dr, dz, dn * r}, 1));
    return;
  }
  const TensorRows from(before), gradient(dafter), of_state(state_gates), of_input(gates),
      to(dbefore);
  const std::int64_t rows = before.size(0);
  for (std::int64_t i = 0; i < rows; ++i) {
    GruRowGradient(from[i], gradient[i], w, of_state[i], of_input[i], to[i]);
  }
}

}  // namespace slalom::nn
