#pragma once

#include <ATen/core/Tensor.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "base/check.h"
#include "policy/nn/parameter_slot.h"

namespace slalom::nn {

/// The parameters of a flat tensor by their names.
class ParameterViews {
 public:
  /// `parameters`: [CountParameters(slots)], shared, not copied.
  ParameterViews(std::vector<ParameterSlot> slots, const at::Tensor& parameters)
      : slots_(std::move(slots)), parameters_(parameters) {
    SLALOM_CHECK_EQ(parameters.numel(), CountParameters(slots_));
    SLALOM_CHECK(parameters.is_contiguous());
  }

  /// Requires: there is a slot of this name.
  at::Tensor operator[](std::string_view name) const {
    const auto slot = std::ranges::find(slots_, name, &ParameterSlot::name);
    SLALOM_CHECK(slot != slots_.end());
    return parameters_.narrow(0, slot->offset, slot->size()).view(slot->shape);
  }

 private:
  std::vector<ParameterSlot> slots_;
  at::Tensor parameters_;
};

}  // namespace slalom::nn
