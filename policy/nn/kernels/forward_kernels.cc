#include "policy/nn/kernels/forward_kernels.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/vector_clones.h"
#include "policy/nn/kernels/lane_sums.h"
#include "policy/nn/kernels/smooth_math.h"

namespace slalom::nn {
namespace {

constexpr float kNormEpsilon = 1e-5f;
/// Rows whose sums are taken together, so that no row waits for another's.
constexpr std::int64_t kNormBlock = 8;

SLALOM_ALWAYS_INLINE float SquaredDistances(const float* __restrict x, float mean, std::int64_t n) {
  float lanes[kLanes] = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    for (int j = 0; j < kLanes; ++j) lanes[j] += (x[i + j] - mean) * (x[i + j] - mean);
  }
  for (; i < n; ++i) lanes[0] += (x[i] - mean) * (x[i] - mean);
  return LaneSum(lanes);
}

/// y may be x.
SLALOM_SIMD void NormaliseOneRow(const float* gain, const float* bias, std::int64_t n,
                                 const float* x, float* y, float* __restrict normal, float* rstd) {
  const float count = static_cast<float>(n);
  const float mean = Sum(x, n) / count;
  const float variance = SquaredDistances(x, mean, n) / count;
  const float scale = 1.0f / std::sqrt(variance + kNormEpsilon);
  for (std::int64_t j = 0; j < n; ++j) normal[j] = (x[j] - mean) * scale;
  for (std::int64_t j = 0; j < n; ++j) y[j] = gain[j] * normal[j] + bias[j];
  *rstd = scale;
}

/// centred = x - mean. Returns the sum of its squares.
SLALOM_ALWAYS_INLINE float Centre(const float* __restrict x, float mean, std::int64_t n,
                                  float* __restrict centred) {
  float lanes[kLanes] = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    for (int j = 0; j < kLanes; ++j) {
      const float value = x[i + j] - mean;
      centred[i + j] = value;
      lanes[j] += value * value;
    }
  }
  for (; i < n; ++i) {
    centred[i] = x[i] - mean;
    lanes[0] += centred[i] * centred[i];
  }
  return LaneSum(lanes);
}

/// `rows` <= kNormBlock.
SLALOM_SIMD void NormaliseReluRows(const float* __restrict gain, const float* __restrict bias,
                                   std::int64_t rows, std::int64_t n, float* __restrict y,
                                   std::int64_t y_stride, float* __restrict normal,
                                   std::int64_t normal_stride, float* __restrict rstd) {
  const float count = static_cast<float>(n);
  float mean[kNormBlock], squares[kNormBlock];
  for (std::int64_t i = 0; i < rows; ++i) mean[i] = Sum(y + i * y_stride, n) / count;
  for (std::int64_t i = 0; i < rows; ++i) {
    squares[i] = Centre(y + i * y_stride, mean[i], n, normal + i * normal_stride);
  }
  for (std::int64_t i = 0; i < rows; ++i) {
    rstd[i] = 1.0f / std::sqrt(squares[i] / count + kNormEpsilon);
  }
  for (std::int64_t i = 0; i < rows; ++i) {
    float* __restrict const to = y + i * y_stride;
    float* __restrict const unit = normal + i * normal_stride;
    const float scale = rstd[i];
    for (std::int64_t j = 0; j < n; ++j) {
      unit[j] *= scale;
      const float value = gain[j] * unit[j] + bias[j];
      to[j] = value > 0.0f ? value : 0.0f;
    }
  }
}

constexpr float kGeluScale = 0.79788456080286536f;  // sqrt(2 / pi)
constexpr float kGeluCube = 0.044715f;

SLALOM_SIMD void AddRow(const float* __restrict x, std::int64_t n, float* __restrict y) {
  for (std::int64_t j = 0; j < n; ++j) y[j] += x[j];
}

SLALOM_SIMD void GruRow(const float* __restrict before, const float* __restrict state,
                        std::int64_t w, float* __restrict gates, float* __restrict after) {
  float* __restrict const reset = gates;
  float* __restrict const update = gates + w;
  float* __restrict const fresh = gates + 2 * w;
  for (std::int64_t j = 0; j < w; ++j) reset[j] = SmoothSigmoid(reset[j] + state[j]);
  for (std::int64_t j = 0; j < w; ++j) update[j] = SmoothSigmoid(update[j] + state[w + j]);
  for (std::int64_t j = 0; j < w; ++j)
    fresh[j] = SmoothTanh(fresh[j] + reset[j] * state[2 * w + j]);
  for (std::int64_t j = 0; j < w; ++j) after[j] = fresh[j] + update[j] * (before[j] - fresh[j]);
}

/// `weights`, `mask`: [Q, T]; mask may be null.
SLALOM_SIMD void AttendHead(const AttentionSizes& s, Rows query, Rows key, Rows value,
                            const float* mask, float* weights, Rows result) {
  const float scale = 1.0f / std::sqrt(static_cast<float>(s.width));
  for (std::int64_t i = 0; i < s.queries; ++i) {
    float* const row = weights + i * s.tokens;
    const std::int64_t seen = s.tokens - s.queries + i + 1;
    float largest = -INFINITY;
    for (std::int64_t j = 0; j < seen; ++j) {
      row[j] = scale * Dot(query[i], key[j], s.width);
      largest = row[j] > largest ? row[j] : largest;
    }
    float sum = 0.0f;
    for (std::int64_t j = 0; j < seen; ++j) {
      row[j] = SmoothExp(row[j] - largest);
      sum += row[j];
    }
    std::fill(row + seen, row + s.tokens, 0.0f);
    std::fill(result[i], result[i] + s.width, 0.0f);
    for (std::int64_t j = 0; j < seen; ++j) {
      row[j] /= sum;
      const float kept = mask == nullptr ? row[j] : row[j] * mask[i * s.tokens + j];
      AddScaled(kept, value[j], s.width, result[i]);
    }
  }
}

// Heads of eight columns are too narrow to compute one by one, so four are taken side by side.
constexpr int kNarrowWidth = 8;
constexpr int kNarrowHeads = 4;
constexpr std::int64_t kMaxNarrowTokens = 16;

/// As `AttendHead` for four heads of eight columns, with the same bits: every sum has its order.
/// `weights`, `mask`: [4, Q, T]; mask may be null. Requires: T <= kMaxNarrowTokens.
SLALOM_SIMD void AttendNarrowHeads(const AttentionSizes& s, Rows query, Rows key, Rows value,
                                   const float* mask, float* weights, Rows result) {
  constexpr int kColumns = kNarrowHeads * kNarrowWidth;
  const float scale = 1.0f / std::sqrt(static_cast<float>(kNarrowWidth));
  float scores[kMaxNarrowTokens * kNarrowHeads] = {};  // [T, 4]
  for (std::int64_t i = 0; i < s.queries; ++i) {
    const float* const asks = query[i];
    const std::int64_t seen = s.tokens - s.queries + i + 1;
    float largest[kNarrowHeads], sum[kNarrowHeads] = {}, total[kColumns] = {};
    std::fill(largest, largest + kNarrowHeads, -INFINITY);
    for (std::int64_t j = 0; j < seen; ++j) {
      const float* const answers = key[j];
      float products[kColumns];
      for (int c = 0; c < kColumns; ++c) products[c] = asks[c] * answers[c];
      for (int h = 0; h < kNarrowHeads; ++h) {
        const float* const p = products + h * kNarrowWidth;
        const float score =
            scale * (((p[0] + p[4]) + (p[2] + p[6])) + ((p[1] + p[5]) + (p[3] + p[7])));
        scores[j * kNarrowHeads + h] = score;
        largest[h] = score > largest[h] ? score : largest[h];
      }
    }
    for (std::int64_t j = 0; j < seen; ++j) {
      for (int h = 0; h < kNarrowHeads; ++h) scores[j * kNarrowHeads + h] -= largest[h];
    }
    for (std::int64_t n = 0; n < seen * kNarrowHeads; ++n) scores[n] = SmoothExp(scores[n]);
    for (std::int64_t j = 0; j < seen; ++j) {
      for (int h = 0; h < kNarrowHeads; ++h) sum[h] += scores[j * kNarrowHeads + h];
    }
    for (std::int64_t j = 0; j < seen; ++j) {
      const float* const given = value[j];
      float kept[kNarrowHeads];
      for (int h = 0; h < kNarrowHeads; ++h) kept[h] = scores[j * kNarrowHeads + h] / sum[h];
      for (int h = 0; h < kNarrowHeads; ++h) {
        const std::int64_t at = (h * s.queries + i) * s.tokens + j;
        weights[at] = kept[h];
        if (mask != nullptr) kept[h] *= mask[at];
        for (int c = h * kNarrowWidth; c < (h + 1) * kNarrowWidth; ++c) {
          total[c] += kept[h] * given[c];
        }
      }
    }
    std::copy(total, total + kColumns, result[i]);
    for (int h = 0; h < kNarrowHeads; ++h) {
      float* const row = weights + (h * s.queries + i) * s.tokens;
      std::fill(row + seen, row + s.tokens, 0.0f);
    }
  }
}

}  // namespace

void AddRows(MatrixSize size, Rows x, Rows y) {
  for (std::int64_t i = 0; i < size.rows; ++i) AddRow(x[i], size.columns, y[i]);
}

void LayerNormRows(MatrixSize size, const float* gain, const float* bias, Rows x, Rows y,
                   Rows normal, float* rstd) {
  for (std::int64_t i = 0; i < size.rows; ++i) {
    NormaliseOneRow(gain, bias, size.columns, x[i], y[i], normal[i], rstd + i);
  }
}

void LayerNormReluRows(MatrixSize size, const float* gain, const float* bias, Rows y, Rows normal,
                       float* rstd) {
  for (std::int64_t i = 0; i < size.rows; i += kNormBlock) {
    NormaliseReluRows(gain, bias, std::min(kNormBlock, size.rows - i), size.columns, y[i], y.stride,
                      normal[i], normal.stride, rstd + i);
  }
}

SLALOM_SIMD void GeluNumbers(const float* __restrict x, std::int64_t n, float* __restrict y) {
  for (std::int64_t j = 0; j < n; ++j) {
    const float t = SmoothTanh(kGeluScale * (x[j] + kGeluCube * x[j] * x[j] * x[j]));
    y[j] = 0.5f * x[j] * (1.0f + t);
  }
}

void GruStepRows(MatrixSize size, Rows before, Rows state_gates, Rows gates, Rows after) {
  for (std::int64_t i = 0; i < size.rows; ++i) {
    GruRow(before[i], state_gates[i], size.columns, gates[i], after[i]);
  }
}

void AttendRows(const AttentionSizes& s, Rows query, Rows key, Rows value, const float* mask,
                float* weights, Rows result) {
  const bool narrow = s.width == kNarrowWidth && s.tokens <= kMaxNarrowTokens;
  for (std::int64_t b = 0; b < s.batch; ++b) {
    const std::int64_t first_query = b * s.queries, first_token = b * s.tokens;
    std::int64_t head = 0;
    while (head < s.heads) {
      const bool together = narrow && head + kNarrowHeads <= s.heads;
      const std::int64_t at = (b * s.heads + head) * s.queries * s.tokens;
      const std::int64_t column = head * s.width;
      (together ? AttendNarrowHeads : AttendHead)(
          s, query.From(first_query, column), key.From(first_token, column),
          value.From(first_token, column), mask == nullptr ? nullptr : mask + at, weights + at,
          result.From(first_query, column));
      head += together ? kNarrowHeads : 1;
    }
  }
}

void DrawDropoutMask(double rate, base::Random& random, std::span<float> mask) {
  SLALOM_CHECK(rate > 0.0 && rate < 1.0);
  // Each word of the stream gives two numbers. A unit is kept if its number is not below the rate.
  const std::uint32_t limit = static_cast<std::uint32_t>(std::lround(std::ldexp(rate, 31)));
  const float scale = static_cast<float>(1.0 / (1.0 - rate));
  for (std::size_t i = 0; i < mask.size(); i += 2) {
    const std::uint64_t word = random.NextU64();
    mask[i] = static_cast<std::uint32_t>(word >> 33) >= limit ? scale : 0.0f;
    if (i + 1 < mask.size()) {
      mask[i + 1] = static_cast<std::uint32_t>(word & 0x7fffffff) >= limit ? scale : 0.0f;
    }
  }
}

void ApplyDropoutMask(std::span<const float> mask, float* y) {
  for (std::size_t i = 0; i < mask.size(); ++i) y[i] *= mask[i];
}

}  // namespace slalom::nn
