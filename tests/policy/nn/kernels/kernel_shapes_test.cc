#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include "policy/nn/kernels/attention.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/packed_linear.h"
#include "policy/nn/kernels/sequence_ops.h"

/// Kernels work on bare memory, so a wrong shape must end the program and not write beyond it.

namespace slalom::nn {
namespace {

at::Tensor Of(at::IntArrayRef sizes) { return at::zeros(sizes, at::kFloat); }

TEST(KernelShapesDeathTest, OfLayersMustFit) {
  at::Tensor y = Of({4, 3}), narrow = Of({4, 2}), b = Of({3}), short_b = Of({2});
  at::Tensor x = Of({4, 5}), w = Of({3, 5}), wide_w = Of({3, 6}), normal = Of({4, 3}), r = Of({3});
  EXPECT_DEATH(Linear(x, wide_w, b, false, y), "check failed");
  EXPECT_DEATH(Linear(x, w, short_b, false, y), "check failed");
  EXPECT_DEATH(Linear(x, w, b, false, narrow), "check failed");
  EXPECT_DEATH(LinearWeightGradient(x, y, wide_w, b), "check failed");
  EXPECT_DEATH(LinearWeightGradient(x, y, w, short_b), "check failed");
  EXPECT_DEATH(LinearInputGradient(y, w, narrow, x), "check failed");
  EXPECT_DEATH(LinearInputGradient(y, wide_w, {}, x), "check failed");
  EXPECT_DEATH(ReluGradient(narrow, y), "check failed");
  EXPECT_DEATH(LayerNormRelu(b, b, y, normal, r), "check failed");  // r has one number too few.
  at::Tensor turned = y.t();
  EXPECT_DEATH(Tanh(turned), "check failed");
}

TEST(KernelShapesDeathTest, OfSequencesMustFit) {
  at::Tensor y = Of({4, 3}), narrow = Of({4, 2}), b = Of({3}), short_b = Of({2}), r = Of({4});
  at::Tensor gates = Of({4, 9}), few_gates = Of({4, 8}), other = Of({4, 3});
  EXPECT_DEATH(AddTo(narrow, y), "check failed");
  EXPECT_DEATH(SetRows(short_b, y), "check failed");
  EXPECT_DEATH(AddColumnSums(y, short_b), "check failed");
  EXPECT_DEATH(LayerNorm(short_b, b, y, y, other, r), "check failed");
  EXPECT_DEATH(LayerNormGradient(b, narrow, r, y, y, b, b), "check failed");
  EXPECT_DEATH(Gelu(y, narrow), "check failed");
  EXPECT_DEATH(GruStep(y, gates, few_gates, other), "check failed");
  EXPECT_DEATH(GruStepGradient(y, other, gates, gates, narrow), "check failed");
}

TEST(KernelShapesDeathTest, OfAttentionMustFit) {
  // Two sequences of three tokens, all of which ask; two heads of two columns.
  const AttentionInput input{
      .query = Of({6, 4}), .key = Of({6, 4}), .value = Of({6, 4}), .dropout_mask = {}};
  at::Tensor weights = Of({2, 2, 3, 3}), few = Of({2, 2, 3, 2}), result = Of({6, 4});
  Attend(input, weights, result);
  EXPECT_DEATH(Attend(input, few, result), "check failed");
  at::Tensor narrow = Of({6, 3});
  EXPECT_DEATH(Attend(input, weights, narrow), "check failed");
  EXPECT_DEATH(AttendGradient(input, weights, result, result, narrow, result), "check failed");
}

TEST(KernelShapesDeathTest, OfPackedLayersMustFit) {
  const PackedLinear linear(5, 3);
  float x[5] = {}, y[3] = {};
  EXPECT_DEATH(linear.ForwardPart(1, {x, 5}, 3, 3, false, {y, 3}), "check failed");
  EXPECT_DEATH(linear.Forward(2, {x, 0}, false, {y, 2}), "check failed");
}

}  // namespace
}  // namespace slalom::nn
