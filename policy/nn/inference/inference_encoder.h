#pragma once

#include <memory>

#include "base/random.h"
#include "policy/nn/kernels/cpu_features.h"
#include "policy/nn/kernels/rows.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `H` frames of history, `F` features of a frame, `W` features of an encoder.

namespace slalom::nn {

/// Reads the stack of frames in front of a head, forward only and without LibTorch. Confined to one
/// thread at a time.
class InferenceEncoder {
 public:
  virtual ~InferenceEncoder() = default;

  /// `parameters`: the encoder's, in the order of `EncoderSlots`; copied. Allocates nothing.
  virtual void SetWeights(const float* parameters) = 0;

  /// Makes room for passes of `batch` rows. Requires: batch >= 1.
  virtual void Resize(std::int64_t batch) = 0;

  /// input: [B, H * F], oldest frame first; features: [B, W]. `dropout` draws the masks of an
  /// encoder that drops when acting; if it is null, nothing is dropped. Allocates nothing.
  virtual void Forward(Rows input, base::Random* dropout, Rows features) = 0;
};

/// The encoder of a shape, with weights of 0. Requires: shape.has_encoder().
std::unique_ptr<InferenceEncoder> MakeInferenceEncoder(const NetworkShape& shape,
                                                       const CpuFeatures& cpu);

/// The function above for one kind, defined in the source of that encoder.
template <EncoderKind kKind>
std::unique_ptr<InferenceEncoder> MakeInferenceEncoderOf(const NetworkShape& shape,
                                                         const CpuFeatures& cpu);

#define SLALOM_DECLARE(kind)                                                                       \
  template <>                                                                                      \
  std::unique_ptr<InferenceEncoder> MakeInferenceEncoderOf<EncoderKind::kind>(const NetworkShape&, \
                                                                              const CpuFeatures&);
SLALOM_FOR_EACH_ENCODER(SLALOM_DECLARE)
#undef SLALOM_DECLARE

}  // namespace slalom::nn
