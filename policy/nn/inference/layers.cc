#include "policy/nn/inference/layers.h"

#include <algorithm>

#include "base/check.h"

namespace slalom::nn {

const ParameterSlot& FindSlot(const std::vector<ParameterSlot>& slots, std::string_view name) {
  const auto slot = std::ranges::find(slots, name, &ParameterSlot::name);
  SLALOM_CHECK(slot != slots.end());
  return *slot;
}

NamedLinear::NamedLinear(const std::vector<ParameterSlot>& slots, const std::string& name,
                         const CpuFeatures& cpu)
    : NamedLinear(slots, name, {0, FindSlot(slots, name + ".bias").size()}, cpu) {}

NamedLinear::NamedLinear(const std::vector<ParameterSlot>& slots, const std::string& name,
                         OutputRange outputs, const CpuFeatures& cpu)
    : weight_offset_(FindSlot(slots, name + ".weight").offset),
      bias_offset_(FindSlot(slots, name + ".bias").offset + outputs.first),
      linear_(FindSlot(slots, name + ".weight").size() / FindSlot(slots, name + ".bias").size(),
              outputs.count, cpu) {
  SLALOM_CHECK(outputs.first + outputs.count <= FindSlot(slots, name + ".bias").size());
  weight_offset_ += outputs.first * linear_.inputs();
}

NamedVector::NamedVector(const std::vector<ParameterSlot>& slots, const std::string& name)
    : offset_(FindSlot(slots, name).offset),
      numbers_(static_cast<std::size_t>(FindSlot(slots, name).size())) {}

void NamedVector::SetWeights(const float* parameters) {
  std::copy_n(parameters + offset_, numbers_.size(), numbers_.begin());
}

}  // namespace slalom::nn
