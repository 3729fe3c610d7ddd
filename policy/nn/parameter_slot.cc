#include "policy/nn/parameter_slot.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "base/check.h"

namespace slalom::nn {

InitialValues InitialValues::Uniform(std::int64_t fan_in) {
  return {Kind::kUniform, 1.0 / std::sqrt(static_cast<double>(fan_in))};
}

std::int64_t ParameterSlot::size() const {
  return std::accumulate(shape.begin(), shape.end(), std::int64_t{1}, std::multiplies<>());
}

void ParameterSlots::Add(std::string name, std::vector<std::int64_t> shape, InitialValues initial) {
  slots_.push_back({std::move(name), num_parameters_, std::move(shape), initial});
  num_parameters_ += slots_.back().size();
}

void ParameterSlots::AddLinear(const std::string& name, std::int64_t outputs, std::int64_t inputs) {
  Add(name + ".weight", {outputs, inputs}, InitialValues::Uniform(inputs));
  Add(name + ".bias", {outputs}, InitialValues::Uniform(inputs));
}

void ParameterSlots::AddNorm(const std::string& name, std::int64_t width) {
  Add(name + ".weight", {width}, InitialValues::Constant(1.0));
  Add(name + ".bias", {width}, InitialValues::Constant(0.0));
}

void ParameterSlots::Append(const std::vector<ParameterSlot>& slots) {
  for (const ParameterSlot& slot : slots) Add(slot.name, slot.shape, slot.initial);
}

std::int64_t CountParameters(const std::vector<ParameterSlot>& slots) {
  return slots.empty() ? 0 : slots.back().offset + slots.back().size();
}

void InitialiseParameters(const std::vector<ParameterSlot>& slots, base::Random& random,
                          std::span<float> parameters) {
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(parameters.size()), CountParameters(slots));
  for (const ParameterSlot& slot : slots) {
    const auto values = parameters.subspan(slot.offset, slot.size());
    const double size = slot.initial.value;
    switch (slot.initial.kind) {
      case InitialValues::Kind::kUniform:
        for (float& value : values) value = static_cast<float>(random.Uniform(-size, size));
        break;
      case InitialValues::Kind::kNormal:
        for (float& value : values) value = static_cast<float>(size * random.Normal());
        break;
      case InitialValues::Kind::kConstant:
        std::ranges::fill(values, static_cast<float>(size));
        break;
    }
  }
}

}  // namespace slalom::nn
