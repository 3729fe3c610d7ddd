#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/random.h"

namespace slalom::nn {

/// Initial values of a parameter tensor.
struct InitialValues {
  enum class Kind { kUniform, kNormal, kConstant };
  Kind kind = Kind::kConstant;
  double value = 0.0;  ///< Bound of a uniform, deviation of a normal with mean 0, or constant.

  /// LibTorch's default for linear layers and convolutions: uniform in +-1 / sqrt(fan_in).
  static InitialValues Uniform(std::int64_t fan_in);
  static InitialValues Normal(double deviation) { return {Kind::kNormal, deviation}; }
  static InitialValues Constant(double value) { return {Kind::kConstant, value}; }
};

/// One parameter tensor in a network's flat parameters.
struct ParameterSlot {
  std::string name;                 ///< "encoder.0.weight"
  std::int64_t offset = 0;          ///< Place of its first number.
  std::vector<std::int64_t> shape;  ///< Row-major: [outputs, inputs] or [outputs].
  InitialValues initial;

  std::int64_t size() const;
};

/// The slots of a network, one behind the other.
class ParameterSlots {
 public:
  void Add(std::string name, std::vector<std::int64_t> shape, InitialValues initial);
  /// "NAME.weight" [outputs, inputs] and "NAME.bias" [outputs] of a linear layer.
  void AddLinear(const std::string& name, std::int64_t outputs, std::int64_t inputs);
  /// "NAME.weight" and "NAME.bias" of a LayerNorm, both [width].
  void AddNorm(const std::string& name, std::int64_t width);
  void Append(const std::vector<ParameterSlot>& slots);

  std::int64_t num_parameters() const { return num_parameters_; }
  std::vector<ParameterSlot> Take() { return std::move(slots_); }

 private:
  std::vector<ParameterSlot> slots_;
  std::int64_t num_parameters_ = 0;
};

/// Counts the numbers of all slots.
std::int64_t CountParameters(const std::vector<ParameterSlot>& slots);

/// Fills `parameters`, [CountParameters(slots)], slot by slot.
void InitialiseParameters(const std::vector<ParameterSlot>& slots, base::Random& random,
                          std::span<float> parameters);

}  // namespace slalom::nn
