#include "policy/layer_ops.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "policy/blas.h"
#include "policy/simd.h"

namespace slalom::policy {
namespace {

constexpr float kLayerNormEpsilon = 1e-5f;

/// A matrix in row-major order whose rows lie `stride` apart.
struct Matrix {
  explicit Matrix(const at::Tensor& t)
      : data(t.data_ptr<float>()), rows(t.size(0)), columns(t.size(1)), stride(t.stride(0)) {}

  float* data;
  std::int64_t rows;
  std::int64_t columns;
  std::int64_t stride;
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

SLALOM_SIMD void SumRows(const float* x, std::int64_t rows, std::int64_t columns,
                         std::int64_t stride, float* sum) {
  std::fill(sum, sum + columns, 0.0f);
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

/// Sums in a fixed order that a compiler may vectorise: sixteen partial sums, then those in turn.
inline float LaneSum(const float (&lanes)[16]) {
  float sum = 0.0f;
  for (const float lane : lanes) sum += lane;
  return sum;
}

inline float Sum(const float* x, std::int64_t n) {
  float lanes[16] = {};
  std::int64_t i = 0;
  for (; i + 16 <= n; i += 16) {
    for (int j = 0; j < 16; ++j) lanes[j] += x[i + j];
  }
  for (; i < n; ++i) lanes[0] += x[i];
  return LaneSum(lanes);
}

inline float Dot(const float* x, const float* y, std::int64_t n) {
  float lanes[16] = {};
  std::int64_t i = 0;
  for (; i + 16 <= n; i += 16) {
    for (int j = 0; j < 16; ++j) lanes[j] += x[i + j] * y[i + j];
  }
  for (; i < n; ++i) lanes[0] += x[i] * y[i];
  return LaneSum(lanes);
}

SLALOM_SIMD void NormaliseRow(const float* gain, const float* bias, std::int64_t n, float* y,
                              float* normal, float* rstd) {
  const float mean = Sum(y, n) / static_cast<float>(n);
  for (std::int64_t j = 0; j < n; ++j) normal[j] = y[j] - mean;
  const float variance = Dot(normal, normal, n) / static_cast<float>(n);
  const float scale = 1.0f / std::sqrt(variance + kLayerNormEpsilon);
  for (std::int64_t j = 0; j < n; ++j) {
    normal[j] *= scale;
    const float value = gain[j] * normal[j] + bias[j];
    y[j] = value > 0.0f ? value : 0.0f;
  }
  *rstd = scale;
}

/// `dgain` and `dbias` are added to, where they are not null.
SLALOM_SIMD void NormaliseRowGradient(const float* gain, const float* y, const float* normal,
                                      float rstd, std::int64_t n, float* dy, float* dgain,
                                      float* dbias) {
  for (std::int64_t j = 0; j < n; ++j) dy[j] = y[j] > 0.0f ? dy[j] : 0.0f;
  if (dgain != nullptr) {
    for (std::int64_t j = 0; j < n; ++j) dgain[j] += dy[j] * normal[j];
    for (std::int64_t j = 0; j < n; ++j) dbias[j] += dy[j];
  }
  for (std::int64_t j = 0; j < n; ++j) dy[j] *= gain[j];
  const float mean = Sum(dy, n) / static_cast<float>(n);
  const float slope = Dot(dy, normal, n) / static_cast<float>(n);
  for (std::int64_t j = 0; j < n; ++j) dy[j] = rstd * (dy[j] - mean - normal[j] * slope);
}

}  // namespace

void Linear(const at::Tensor& x, const at::Tensor& w, const at::Tensor& b, bool relu,
            at::Tensor& y) {
  if (!IsHostFloat(x)) {
    at::addmm_out(y, b, x, w.t());
    if (relu) y.relu_();
    return;
  }
  const Matrix mx(x), mw(w), my(y);
  SLALOM_CHECK(mx.columns == mw.columns && mx.rows == my.rows && mw.rows == my.columns);
  Sgemm(false, true, mx.rows, mw.rows, mx.columns, mx.data, mx.stride, mw.data, mw.stride, my.data,
        my.stride);
  AddBias(b.data_ptr<float>(), relu, my.data, my.rows, my.columns, my.stride);
}

void LinearWeightGradient(const at::Tensor& x, const at::Tensor& dy, at::Tensor& dw,
                          at::Tensor& db) {
  if (!IsHostFloat(x)) {
    at::mm_out(dw, dy.t(), x);
    at::sum_out(db, dy, {0});
    return;
  }
  const Matrix mx(x), mdy(dy), mdw(dw);
  Sgemm(true, false, mdy.columns, mx.columns, mx.rows, mdy.data, mdy.stride, mx.data, mx.stride,
        mdw.data, mdw.stride);
  SumRows(mdy.data, mdy.rows, mdy.columns, mdy.stride, db.data_ptr<float>());
}

void LinearInputGradient(const at::Tensor& dy, const at::Tensor& w, at::Tensor& dx) {
  if (!IsHostFloat(dy)) {
    at::mm_out(dx, dy, w);
    return;
  }
  const Matrix mdy(dy), mw(w), mdx(dx);
  Sgemm(false, false, mdy.rows, mw.columns, mw.rows, mdy.data, mdy.stride, mw.data, mw.stride,
        mdx.data, mdx.stride);
}

void ReluGradient(const at::Tensor& y, at::Tensor& dy) {
  if (!IsHostFloat(dy)) {
    dy.mul_(y > 0);
    return;
  }
  const Matrix my(y), mdy(dy);
  MaskByPositive(my.data, my.stride, mdy.data, mdy.rows, mdy.columns, mdy.stride);
}

void Tanh(at::Tensor& y) {
  if (!IsHostFloat(y)) {
    y.tanh_();
    return;
  }
  float* const values = y.data_ptr<float>();
  for (std::int64_t i = 0; i < y.numel(); ++i) values[i] = std::tanh(values[i]);
}

void TanhGradient(const at::Tensor& y, at::Tensor& dy) {
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
  if (!IsHostFloat(y)) {
    const at::Tensor centred = y - y.mean(1, /*keepdim=*/true);
    rstd.copy_((centred.square().mean(1) + kLayerNormEpsilon).rsqrt());
    normal.copy_(centred * rstd.unsqueeze(1));
    y.copy_((normal * gain + bias).relu());
    return;
  }
  const Matrix my(y), mn(normal);
  for (std::int64_t i = 0; i < my.rows; ++i) {
    NormaliseRow(gain.data_ptr<float>(), bias.data_ptr<float>(), my.columns,
                 my.data + i * my.stride, mn.data + i * mn.stride, rstd.data_ptr<float>() + i);
  }
}

void LayerNormReluGradient(const at::Tensor& gain, const at::Tensor& y, const at::Tensor& normal,
                           const at::Tensor& rstd, at::Tensor& dy, at::Tensor& dgain,
                           at::Tensor& dbias) {
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
  for (std::int64_t i = 0; i < mdy.rows; ++i) {
    NormaliseRowGradient(gain.data_ptr<float>(), my.data + i * my.stride, mn.data + i * mn.stride,
                         rstd.data_ptr<float>()[i], mdy.columns, mdy.data + i * mdy.stride,
                         gain_gradient, bias_gradient);
  }
}

}  // namespace slalom::policy
