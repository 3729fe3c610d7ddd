#include "learner/sliced_networks.h"

#include <ATen/ATen.h>

#include "base/check.h"

namespace slalom::learner {

SlicedNetworks::Pass::Pass(const nn::NetworkShape& shape, int num_networks, const at::Tensor& input,
                           nn::PassUse use, const Minibatch& minibatch) {
  const auto allocate = [&](std::int64_t columns) {
    return at::zeros({input.size(0), columns}, input.options());
  };
  for (int k = 0; k < num_networks; ++k) {
    outputs_.push_back(allocate(shape.num_outputs()));
    if (use == nn::PassUse::kInference) continue;
    output_gradients_.push_back(allocate(shape.num_outputs()));
    if (shape.num_extra() > 0) extra_gradients_.push_back(allocate(shape.num_extra()));
  }
  for (const RowSlice& slice : minibatch.Slices()) {
    for (int k = 0; k < num_networks; ++k) {
      const auto rows = [&](const std::vector<at::Tensor>& of_networks) {
        return of_networks.empty() ? at::Tensor()
                                   : of_networks[k].narrow(0, slice.begin, slice.size);
      };
      passes_.emplace_back(shape, input.narrow(0, slice.begin, slice.size), use, minibatch.dropout,
                           nn::PassResults{.output = rows(outputs_),
                                           .output_gradient = rows(output_gradients_),
                                           .extra_gradient = rows(extra_gradients_)});
    }
  }
}

SlicedNetworks::SlicedNetworks(const nn::NetworkShape& shape, int num_networks,
                               const at::Tensor& parameters, const at::Tensor& gradients,
                               const Minibatch& minibatch)
    : num_networks_(num_networks),
      num_slices_(static_cast<int>(minibatch.Slices().size())),
      parallel_(minibatch.parallel) {
  const std::int64_t size = shape.num_parameters();
  SLALOM_CHECK_EQ(parameters.numel(), num_networks * size);
  for (int k = 0; k < num_networks; ++k) {
    networks_.emplace_back(shape, parameters.narrow(0, k * size, size));
  }
  if (!gradients.defined()) return;
  SLALOM_CHECK_EQ(gradients.size(0), static_cast<std::int64_t>(num_slices_));
  for (int slice = 0; slice < num_slices_; ++slice) {
    for (int k = 0; k < num_networks; ++k) {
      gradients_.emplace_back(shape, gradients[slice].narrow(0, k * size, size));
    }
  }
}

void SlicedNetworks::Forward(Pass& pass, int num_networks) const {
  ForEach(num_networks,
          [&](int slice, int k) { networks_[k].Forward(pass.passes_[slice * num_networks_ + k]); });
}

void SlicedNetworks::ParameterGradient(Pass& pass) {
  ForEach(num_networks_, [&](int slice, int k) {
    const int i = slice * num_networks_ + k;
    networks_[k].ParameterGradient(pass.passes_[i], gradients_[i]);
  });
}

void SlicedNetworks::ExtraGradient(Pass& pass, int num_networks) const {
  ForEach(num_networks, [&](int slice, int k) {
    networks_[k].ExtraGradient(pass.passes_[slice * num_networks_ + k]);
  });
}

at::Tensor MakeGradients(const at::Tensor& parameters, const Minibatch& minibatch) {
  return at::zeros({std::ssize(minibatch.Slices()), parameters.numel()}, parameters.options());
}

}  // namespace slalom::learner
