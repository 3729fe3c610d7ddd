#include "policy/nn/kernels/attention.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/vector_clones.h"
#include "policy/nn/kernels/forward_kernels.h"
#include "policy/nn/kernels/lane_sums.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/tensor_rows.h"

namespace slalom::nn {
namespace {

/// The sizes of `in` and of its weights [B, A, Q, T], which must fit each other.
AttentionSizes GetSizes(const AttentionInput& in, const at::Tensor& weights) {
  SLALOM_CHECK_EQ(weights.dim(), 4);
  const std::int64_t columns = in.query.size(1);
  const AttentionSizes s = {weights.size(0), weights.size(1), weights.size(2), weights.size(3),
                            columns / weights.size(1)};
  SLALOM_CHECK(s.queries <= s.tokens && s.width * s.heads == columns && weights.is_contiguous());
  SLALOM_CHECK_EQ(in.query.size(0), s.batch * s.queries);
  SLALOM_CHECK_EQ(in.key.size(0), s.batch * s.tokens);
  SLALOM_CHECK_EQ(in.key.size(1), columns);
  SLALOM_CHECK(in.value.sizes() == in.key.sizes());
  SLALOM_CHECK(!in.dropout_mask.defined() || in.dropout_mask.sizes() == weights.sizes());
  return s;
}

SLALOM_SIMD void AttendHeadGradient(const AttentionSizes& s, Rows query, Rows key, Rows value,
                                    const float* mask, const float* weights, Rows dresult,
                                    Rows dquery, Rows dkey, Rows dvalue) {
  const float scale = 1.0f / std::sqrt(static_cast<float>(s.width));
  for (std::int64_t j = 0; j < s.tokens; ++j) {
    std::fill(dkey[j], dkey[j] + s.width, 0.0f);
    std::fill(dvalue[j], dvalue[j] + s.width, 0.0f);
  }
  for (std::int64_t i = 0; i < s.queries; ++i) {
    const float* const row = weights + i * s.tokens;
    const std::int64_t seen = s.tokens - s.queries + i + 1;
    const auto kept = [&](std::int64_t j) {
      return mask == nullptr ? 1.0f : mask[i * s.tokens + j];
    };
    float mean = 0.0f;  // of the weights' gradients, weighted
    for (std::int64_t j = 0; j < seen; ++j) {
      mean += row[j] * kept(j) * Dot(dresult[i], value[j], s.width);
    }
    std::fill(dquery[i], dquery[i] + s.width, 0.0f);
    for (std::int64_t j = 0; j < seen; ++j) {
      const float dweight = kept(j) * Dot(dresult[i], value[j], s.width);
      const float dscore = scale * row[j] * (dweight - mean);
      AddScaled(row[j] * kept(j), dresult[i], s.width, dvalue[j]);
      AddScaled(dscore, key[j], s.width, dquery[i]);
      AddScaled(dscore, query[i], s.width, dkey[j]);
    }
  }
}

/// [B * rows, D] as [B, A, rows, D / A].
at::Tensor Split(const at::Tensor& t, const AttentionSizes& s) {
  return t.reshape({s.batch, -1, s.heads, s.width}).transpose(1, 2);
}

at::Tensor Join(const at::Tensor& t, const AttentionSizes& s) {
  return t.transpose(1, 2).reshape({-1, s.heads * s.width});
}

}  // namespace

void Attend(const AttentionInput& in, at::Tensor& weights, at::Tensor& result) {
  const AttentionSizes s = GetSizes(in, weights);
  SLALOM_CHECK(result.sizes() == in.query.sizes());
  if (!IsHostFloat(result)) {
    const double scale = 1.0 / std::sqrt(static_cast<double>(s.width));
    const at::Tensor scores = at::matmul(Split(in.query, s), Split(in.key, s).transpose(2, 3));
    const at::Tensor seen = at::ones({s.queries, s.tokens}, scores.options().dtype(at::kBool))
                                .tril(s.tokens - s.queries);
    weights.copy_((scores * scale).masked_fill(seen.logical_not(), -INFINITY).softmax(3));
    const at::Tensor kept = in.dropout_mask.defined() ? weights * in.dropout_mask : weights;
    result.copy_(Join(at::matmul(kept, Split(in.value, s)), s));
    return;
  }
  AttendRows(s, TensorRows(in.query), TensorRows(in.key), TensorRows(in.value),
             in.dropout_mask.defined() ? in.dropout_mask.data_ptr<float>() : nullptr,
             weights.data_ptr<float>(), TensorRows(result));
}

void AttendGradient(const AttentionInput& in, const at::Tensor& weights, const at::Tensor& dresult,
                    at::Tensor& dquery, at::Tensor& dkey, at::Tensor& dvalue) {
  const AttentionSizes s = GetSizes(in, weights);
  SLALOM_CHECK(dresult.sizes() == in.query.sizes() && dquery.sizes() == in.query.sizes());
  SLALOM_CHECK(dkey.sizes() == in.key.sizes() && dvalue.sizes() == in.value.sizes());
  if (!IsHostFloat(dresult)) {
    const double scale = 1.0 / std::sqrt(static_cast<double>(s.width));
    const at::Tensor d = Split(dresult, s);
    const at::Tensor kept = in.dropout_mask.defined() ? weights * in.dropout_mask : weights;
    dvalue.copy_(Join(at::matmul(kept.transpose(2, 3), d), s));
    at::Tensor dweights = at::matmul(d, Split(in.value, s).transpose(2, 3));
    if (in.dropout_mask.defined()) dweights = dweights * in.dropout_mask;
    const at::Tensor mean = (weights * dweights).sum(3, /*keepdim=*/true);
    const at::Tensor dscores = scale * weights * (dweights - mean);
    dquery.copy_(Join(at::matmul(dscores, Split(in.key, s)), s));
    dkey.copy_(Join(at::matmul(dscores.transpose(2, 3), Split(in.query, s)), s));
    return;
  }
  const TensorRows query(in.query), key(in.key), value(in.value), gradient(dresult);
  const TensorRows to_query(dquery), to_key(dkey), to_value(dvalue);
  const float* const mask = in.dropout_mask.defined() ? in.dropout_mask.data_ptr<float>() : nullptr;
  const float* const all_weights = weights.data_ptr<float>();
  for (std::int64_t b = 0; b < s.batch; ++b) {
    for (std::int64_t head = 0; head < s.heads; ++head) {
      const std::int64_t at = (b * s.heads + head) * s.queries * s.tokens;
      const std::int64_t column = head * s.width;
      const std::int64_t first_query = b * s.queries, first_token = b * s.tokens;
      AttendHeadGradient(s, query.From(first_query, column), key.From(first_token, column),
                         value.From(first_token, column), mask == nullptr ? nullptr : mask + at,
                         all_weights + at, gradient.From(first_query, column),
                         to_query.From(first_query, column), to_key.From(first_token, column),
                         to_value.From(first_token, column));
    }
  }
}

}  // namespace slalom::nn
