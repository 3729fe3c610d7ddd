#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "policy/nn/kernels/cpu_features.h"
#include "policy/nn/kernels/forward_kernels.h"
#include "policy/nn/kernels/packed_linear.h"
#include "policy/nn/parameter_slot.h"

/// Layers of networks that only act. Each knows the place of its parameters in the network's flat
/// array, and copies them when they are set.

namespace slalom::nn {

/// The slot of this name. Requires: there is one.
const ParameterSlot& FindSlot(const std::vector<ParameterSlot>& slots, std::string_view name);

/// Output rows [first, first + count) of a fully connected layer.
struct OutputRange {
  std::int64_t first = 0;
  std::int64_t count = 0;
};

/// A fully connected layer or a convolution: "NAME.weight" [O, ...] and "NAME.bias" [O].
class NamedLinear {
 public:
  NamedLinear(const std::vector<ParameterSlot>& slots, const std::string& name,
              const CpuFeatures& cpu);
  /// Computes only some of the outputs.
  NamedLinear(const std::vector<ParameterSlot>& slots, const std::string& name, OutputRange outputs,
              const CpuFeatures& cpu);

  void SetWeights(const float* parameters) {
    linear_.SetWeights(parameters + weight_offset_, parameters + bias_offset_);
  }
  const PackedLinear& operator*() const { return linear_; }
  const PackedLinear* operator->() const { return &linear_; }

 private:
  std::int64_t weight_offset_;
  std::int64_t bias_offset_;
  PackedLinear linear_;
};

/// Numbers of the flat array that a layer adds or scales by.
class NamedVector {
 public:
  NamedVector(const std::vector<ParameterSlot>& slots, const std::string& name);

  void SetWeights(const float* parameters);
  const float* data() const { return numbers_.data(); }
  std::int64_t size() const { return static_cast<std::int64_t>(numbers_.size()); }

 private:
  std::int64_t offset_;
  std::vector<float> numbers_;
};

/// LayerNorm: "NAME.weight" and "NAME.bias", both [W].
struct NamedNorm {
  NamedNorm(const std::vector<ParameterSlot>& slots, const std::string& name)
      : gain(slots, name + ".weight"), bias(slots, name + ".bias") {}

  void SetWeights(const float* parameters) {
    gain.SetWeights(parameters);
    bias.SetWeights(parameters);
  }

  NamedVector gain;
  NamedVector bias;
};

/// A matrix of numbers that a layer writes. Allocates only when it is made larger.
class Buffer {
 public:
  /// All numbers become 0.
  void Resize(std::int64_t rows, std::int64_t columns) {
    columns_ = columns;
    numbers_.assign(static_cast<std::size_t>(rows * columns), 0.0f);
  }

  Rows rows() { return {numbers_.data(), columns_}; }
  float* data() { return numbers_.data(); }
  const float* data() const { return numbers_.data(); }
  std::int64_t size() const { return static_cast<std::int64_t>(numbers_.size()); }
  std::int64_t columns() const { return columns_; }

 private:
  std::int64_t columns_ = 0;
  std::vector<float> numbers_;
};

}  // namespace slalom::nn
