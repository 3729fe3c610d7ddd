#include "policy/nn/kernels/layer_ops.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/vector_clones.h"
#include "policy/nn/kernels/blas.h"
#include "policy/nn/kernels/forward_kernels.h"
#include "policy/nn/kernels/lane_sums.h"
#include "policy/nn/kernels/small_gemm.h"
#include "policy/nn/kernels/tensor_rows.h"

namespace slalom::nn {
namespace {

constexpr float kLayerNormReluEpsilon = 1e-5f;

/// A matrix in row-major order whose rows lie `stride` apart.
struct Matrix : TensorRows {
  explicit Matrix(const at::Tensor& t) : TensorRows(t), rows(t.size(0)), columns(t.size(1)) {}

  std::int64_t rows;
  std::int64_t columns;
};

SLALOM_SIMD void AddBias(const float* bias, bool relu, float* y, std::int64_t rows,
                         std::int64_t columns, std::int64_t stride) {
  for (std::int64_t i = 0; i < rows; ++i) {
    float* const row = y + i * stride;
    if (relu) {
      for (std::int64_t j = 0; j < columns; ++j) {
        const float value = row[j] + bias[j];
        row[j] = value > 0.0f ? value : 0.0f;
      }
    } else {
      for (std::int64_t j = 0; j < columns; ++j) row[j] += bias[j];
    }
  }
}

/// Adds to `sum`.
SLALOM_SIMD void SumRows(const float* x, std::int64_t rows, std::int64_t columns,
                         std::int64_t stride, float* sum) {
  for (std::int64_t i = 0; i < rows; ++i) {
    const float* const row = x + i * stride;
    for (std::int64_t j = 0; j < columns; ++j) sum[j] += row[j];
  }
}

SLALOM_SIMD void MaskByPositive(const float* y, std::int64_t y_stride, float* dy, std::int64_t rows,
                                std::int64_t columns, std::int64_t stride) {
  for (std::int64_t i = 0; i < rows; ++i) {
    const float* const mask = y + i * y_stride;
    float* const row = dy + i * stride;
    for (std::int64_t j = 0; j < columns; ++j) row[j] = mask[j] > 0.0f ? row[j] : 0.0f;
  }
}

/// Rows whose sums are taken together, so that no row waits for another's.
constexpr std::int64_t kRowBlock = 8;

struct GradientSums {
  float gradient;         // sum of dy
  float gradient_normal;  // sum of dy * normal
};

/// dy = (y > 0 ? dy : 0) * gain. Returns its sums.
SLALOM_ALWAYS_INLINE GradientSums ScaleGradient(const float* __restrict gain,
                                                const float* __restrict y,
                                                const float* __restrict normal, std::int64_t n,
                                                float* __restrict dy) {
  float sum[kLanes] = {}, dot[kLanes] = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    for (int j = 0; j < kLanes; ++j) {
      const float value = y[i + j] > 0.0f ? dy[i + j] * gain[i + j] : 0.0f;
      dy[i + j] = value;
      sum[j] += value;
      dot[j] += value * normal[i + j];
    }
  }
  for (; i < n; ++i) {
    dy[i] = y[i] > 0.0f ? dy[i] * gain[i] : 0.0f;
    sum[0] += dy[i];
    dot[0] += dy[i] * normal[i];
  }
  return {LaneSum(sum), LaneSum(dot)};
}

/// `rows` <= kRowBlock. Adds to `dgain` and `dbias` if they are not null.
SLALOM_SIMD void NormaliseRowsGradient(const float* __restrict gain, std::int64_t rows,
                                       std::int64_t n, const float* __restrict y,
                                       std::int64_t y_stride, const float* __restrict normal,
                                       std::int64_t normal_stride, const float* __restrict rstd,
                                       float* __restrict dy, std::int64_t stride,
                                       float* __restrict dgain, float* __restrict dbias) {
  const float count = static_cast<float>(n);
  GradientSums sums[kRowBlock];
  for (std::int64_t i = 0; dgain != nullptr && i < rows; ++i) {
    const float* __restrict const output = y + i * y_stride;
    const float* __restrict const unit = normal + i * normal_stride;
    const float* __restrict const gradient = dy + i * stride;
    for (std::int64_t j = 0; j < n; ++j) {
      const float value = output[j] > 0.0f ? gradient[j] : 0.0f;
      dgain[j] += value * unit[j];
      dbias[j] += value;
    }
  }
  for (std::int64_t i = 0; i < rows; ++i) {
    sums[i] = ScaleGradient(gain, y + i * y_stride, normal + i * normal_stride, n, dy + i * stride);
  }
  for (std::int64_t i = 0; i < rows; ++i) {
    const float* __restrict const unit = normal + i * normal_stride;
    float* __restrict const gradient = dy + i * stride;
    const float mean = sums[i].gradient / count;
    const float slope = sums[i].gradient_normal / count;
    const float scale = rstd[i];
    for (std::int64_t j = 0; j < n; ++j) {
      gradient[j] = scale * (gradient[j] - mean - unit[j] * slope);
    }
  }
}

/// Computes a product by the kernel that suits it.
void Multiply(const GemmTask& task) {
  static const CpuFeatures cpu = DetectCpuFeatures();
  if (SmallGemm(task, cpu)) return;
  Sgemm(task.transpose_a, task.transpose_b, task.m, task.n, task.k, task.a, task.lda, task.b,
        task.ldb, task.c, task.ldc, task.add);
  if (task.bias != nullptr) AddBias(task.bias, task.relu, task.c, task.m, task.n, task.ldc);
  if (task.mask != nullptr) {
    MaskByPositive(task.mask, task.ld_mask, task.c, task.m, task.n, task.ldc);
  }
}

/// x: [B, I], w: [O, I], b: [O], y: [B, O], as values or as gradients by them.
void CheckLinear(const at::Tensor& x, const at::Tensor& w, std::int64_t num_biases,
                 const at::Tensor& y) {
  SLALOM_CHECK_EQ(x.size(0), y.size(0));
  SLALOM_CHECK_EQ(x.size(1), w.size(1));
  SLALOM_CHECK_EQ(y.size(1), w.size(0));
  SLALOM_CHECK_EQ(num_biases, w.size(0));
}

/// y, normal: [B, O]; rstd: [B]; gain: [O].
void CheckNorm(const at::Tensor& gain, const at::Tensor& y, const at::Tensor& normal,
               const at::Tensor& rstd) {
  SLALOM_CHECK(normal.sizes() == y.sizes());
  SLALOM_CHECK_EQ(rstd.numel(), y.size(0));
  SLALOM_CHECK_EQ(gain.numel(), y.size(1));
}

}  // namespace

void Linear(const at::Tensor& x, const at::Tensor& w, const at::Tensor& b, bool relu,
            at::Tensor& y) {
  CheckLinear(x, w, b.numel(), y);
  if (!IsHostFloat(x)) {
    at::addmm_out(y, b, x, w.t());
    if (relu) y.relu_();
    return;
  }
  const Matrix mx(x), mw(w), my(y);
  Multiply({.transpose_b = true,
            .m = mx.rows,
            .n = mw.rows,
            .k = mx.columns,
            .a = mx.data,
            .lda = mx.stride,
            .b = mw.data,
            .ldb = mw.stride,
            .c = my.data,
            .ldc = my.stride,
            .bias = b.data_ptr<float>(),
            .relu = relu});
}

void LinearWeightGradient(const at::Tensor& x, const at::Tensor& dy, at::Tensor& dw, at::Tensor& db,
                          Into into) {
  const bool add = into == Into::kAdd;
  CheckLinear(x, dw, db.numel(), dy);
  if (!IsHostFloat(x)) {
    if (!add) {
      at::mm_out(dw, dy.t(), x);
      at::sum_out(db, dy, {0});
    } else {
      dw.addmm_(dy.t(), x);
      db.add_(dy.sum(0));
    }
    return;
  }
  const Matrix mx(x), mdy(dy), mdw(dw);
  Multiply({.transpose_a = true,
            .m = mdy.columns,
            .n = mx.columns,
            .k = mx.rows,
            .a = mdy.data,
            .lda = mdy.stride,
            .b = mx.data,
            .ldb = mx.stride,
            .c = mdw.data,
            .ldc = mdw.stride,
            .add = add});
  float* const sum = db.data_ptr<float>();
  if (!add) std::fill(sum, sum + mdy.columns, 0.0f);
  SumRows(mdy.data, mdy.rows, mdy.columns, mdy.stride, sum);
}

void LinearInputGradient(const at::Tensor& dy, const at::Tensor& w, const at::Tensor& relu_output,
                         at::Tensor& dx, Into into) {
  const bool add = into == Into::kAdd;
  CheckLinear(dx, w, w.size(0), dy);
  if (relu_output.defined()) {
    SLALOM_CHECK(!add);
    SLALOM_CHECK(relu_output.sizes() == dx.sizes());
  }
  if (!IsHostFloat(dy)) {
    if (add) {
      dx.addmm_(dy, w);
    } else {
      at::mm_out(dx, dy, w);
    }
    if (relu_output.defined()) dx.mul_(relu_output > 0);
    return;
  }
  const Matrix mdy(dy), mw(w), mdx(dx);
  GemmTask task{.m = mdy.rows,
                .n = mw.columns,
                .k = mw.rows,
                .a = mdy.data,
                .lda = mdy.stride,
                .b = mw.data,
                .ldb = mw.stride,
                .c = mdx.data,
                .ldc = mdx.stride,
                .add = add};
  if (relu_output.defined()) {
    task.mask = relu_output.data_ptr<float>();
    task.ld_mask = relu_output.stride(0);
  }
  Multiply(task);
}

void ReluGradient(const at::Tensor& y, at::Tensor& dy) {
  SLALOM_CHECK(y.sizes() == dy.sizes());
  if (!IsHostFloat(dy)) {
    dy.mul_(y > 0);
    return;
  }
  const Matrix my(y), mdy(dy);
  MaskByPositive(my.data, my.stride, mdy.data, mdy.rows, mdy.columns, mdy.stride);
}

void Tanh(at::Tensor& y) {
  SLALOM_CHECK(y.is_contiguous());
  if (!IsHostFloat(y)) {
    y.tanh_();
    return;
  }
  float* const values = y.data_ptr<float>();
  for (std::int64_t i = 0; i < y.numel(); ++i) values[i] = std::tanh(values[i]);
}

void TanhGradient(const at::Tensor& y, at::Tensor& dy) {
  SLALOM_CHECK(y.sizes() == dy.sizes() && y.is_contiguous() && dy.is_contiguous());
  if (!IsHostFloat(y)) {
    dy.mul_(1 - y.square());
    return;
  }
  const float* const values = y.data_ptr<float>();
  float* const gradient = dy.data_ptr<float>();
  for (std::int64_t i = 0; i < y.numel(); ++i) gradient[i] *= 1.0f - values[i] * values[i];
}

void LayerNormRelu(const at::Tensor& gain, const at::Tensor& bias, at::Tensor& y,
                   at::Tensor& normal, at::Tensor& rstd) {
  CheckNorm(gain, y, normal, rstd);
  SLALOM_CHECK_EQ(bias.numel(), gain.numel());
  if (!IsHostFloat(y)) {
    const at::Tensor centred = y - y.mean(1, /*keepdim=*/true);
    rstd.copy_((centred.square().mean(1) + kLayerNormReluEpsilon).rsqrt());
    normal.copy_(centred * rstd.unsqueeze(1));
    y.copy_((normal * gain + bias).relu());
    return;
  }
  LayerNormReluRows({y.size(0), y.size(1)}, gain.data_ptr<float>(), bias.data_ptr<float>(),
                    TensorRows(y), TensorRows(normal), rstd.data_ptr<float>());
}

void LayerNormReluGradient(const at::Tensor& gain, const at::Tensor& y, const at::Tensor& normal,
                           const at::Tensor& rstd, at::Tensor& dy, at::Tensor& dgain,
                           at::Tensor& dbias) {
  CheckNorm(gain, y, normal, rstd);
  SLALOM_CHECK(dy.sizes() == y.sizes());
  SLALOM_CHECK_EQ(dgain.defined(), dbias.defined());
  if (dgain.defined()) SLALOM_CHECK(dgain.numel() == gain.numel() && dbias.numel() == gain.numel());
  if (!IsHostFloat(dy)) {
    dy.mul_(y > 0);
    if (dgain.defined()) {
      dgain.copy_((dy * normal).sum(0));
      dbias.copy_(dy.sum(0));
    }
    dy.mul_(gain);
    const at::Tensor mean = dy.mean(1, /*keepdim=*/true);
    const at::Tensor slope = (dy * normal).mean(1, /*keepdim=*/true);
    dy.sub_(mean).sub_(normal * slope).mul_(rstd.unsqueeze(1));
    return;
  }
  const Matrix my(y), mn(normal), mdy(dy);
  float* const gain_gradient = dgain.defined() ? dgain.data_ptr<float>() : nullptr;
  float* const bias_gradient = dgain.defined() ? dbias.data_ptr<float>() : nullptr;
  if (gain_gradient != nullptr) {
    std::fill(gain_gradient, gain_gradient + mdy.columns, 0.0f);
    std::fill(bias_gradient, bias_gradient + mdy.columns, 0.0f);
  }
  for (std::int64_t i = 0; i < mdy.rows; i += kRowBlock) {
    NormaliseRowsGradient(gain.data_ptr<float>(), std::min(kRowBlock, mdy.rows - i), mdy.columns,
                          my.data + i * my.stride, my.stride, mn.data + i * mn.stride, mn.stride,
                          rstd.data_ptr<float>() + i, mdy.data + i * mdy.stride, mdy.stride,
                          gain_gradient, bias_gradient);
  }
}

}  // namespace slalom::nn
