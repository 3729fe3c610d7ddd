#pragma once

#include <ATen/core/Tensor.h>

#include <algorithm>
#include <memory>
#include <string_view>
#include <vector>

#include "base/check.h"
#include "base/random.h"
#include "policy/nn/mlp.h"
#include "policy/nn/network_shape.h"
#include "policy/nn/parameter_slot.h"

/// Shapes: `B` batch, `H` frames of history, `F` features of a frame, `W` features of an encoder.

namespace slalom::nn {

/// Input and output of an encoder's pass. Tensors are kept, not copied.
struct EncoderPorts {
  at::Tensor input;             ///< [B, H * F], oldest frame first; rows may lie further apart.
  at::Tensor features;          ///< [B, W], inside the head's input.
  at::Tensor feature_gradient;  ///< [B, W], for the backward pass; undefined in inference.
  PassUse use = PassUse::kTraining;
  base::Random* dropout = nullptr;  ///< Draws the masks in this pass; null for no dropout.
};

/// Intermediate results of an encoder between forward and backward pass, for one batch size.
/// Allocates on construction only. Confined to one thread at a time.
class EncoderPass {
 public:
  virtual ~EncoderPass() = default;
};

/// Reads the stack of frames in front of a head. Parameters are views into the network's flat
/// tensor. Thread-compatible; `Forward` into different passes is thread-safe.
class Encoder {
 public:
  virtual ~Encoder() = default;

  /// Writes the features. Requires: a pass that `MakeEncoderPass` made for the same shape.
  virtual void Forward(EncoderPass& pass) const = 0;

  /// Writes the gradients of all parameters into the parameters of `gradient`, an encoder of the
  /// same shape. Uses up the pass. Requires: `Forward` has run and the feature gradient is set.
  virtual void ParameterGradient(EncoderPass& pass, Encoder& gradient) const = 0;
};

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

/// Makes the encoder of a shape. `parameters`: the encoder's, shared, not copied. Requires:
/// shape.has_encoder().
std::unique_ptr<Encoder> MakeEncoder(const NetworkShape& shape, const at::Tensor& parameters);
std::unique_ptr<EncoderPass> MakeEncoderPass(const NetworkShape& shape, const EncoderPorts& ports);

/// The two functions above for one kind, defined in the source of that encoder.
template <EncoderKind kKind>
std::unique_ptr<Encoder> MakeEncoderOf(const NetworkShape& shape, const at::Tensor& parameters);
template <EncoderKind kKind>
std::unique_ptr<EncoderPass> MakeEncoderPassOf(const NetworkShape& shape,
                                               const EncoderPorts& ports);

#define SLALOM_DECLARE(kind)                                                             \
  template <>                                                                            \
  std::unique_ptr<Encoder> MakeEncoderOf<EncoderKind::kind>(const NetworkShape&,         \
                                                            const at::Tensor&);          \
  template <>                                                                            \
  std::unique_ptr<EncoderPass> MakeEncoderPassOf<EncoderKind::kind>(const NetworkShape&, \
                                                                    const EncoderPorts&);
SLALOM_FOR_EACH_ENCODER(SLALOM_DECLARE)
#undef SLALOM_DECLARE

}  // namespace slalom::nn
