#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "base/result.h"
#include "replay/batch.h"

/// A sample as one run of bytes, as a replay server sends it: sequence [B] int64, next_sequence [B]
/// int64, state [B, H, S] float32, next_state [B, H, S] float32, action [B, 2], n_step_return [B],
/// cost_return [B], discount [B] float32, where weighted weight [B] float32, then ranges [B, H, N]
/// uint16 [cm] and next ranges [B, H, N] uint16 [cm]; each right after the other, little-endian.

namespace slalom::replay {

/// What a sample is; each number >= 1.
struct SampleShape {
  int batch = 1;          ///< B
  int history = 1;        ///< H
  int num_beams = 1;      ///< N
  bool weighted = false;  ///< It holds importance weights; else all are 1.
};

/// Bytes of a sample; none: more than memory could hold. Where who asks chose the shape, compare
/// this with what may be sent before anything is drawn.
std::optional<std::size_t> SampleSize(const SampleShape& shape);

/// Writes a sample, scans gathered from where they lie straight to where they go. Requires:
/// out.size() == SampleSize(...) and starts on a multiple of 8 bytes.
void WriteSample(const SampledRows& rows, bool weighted, std::span<std::byte> out);

/// Looks at bytes that anybody may have sent. Their scans stay where they are, so `rows` is valid
/// as long as `bytes`; the rest is copied. Fails, `rows` being unspecified, where the number of
/// bytes is not that of the shape, they do not start on a multiple of 8 bytes, a number is not
/// finite, a discount not in [0, 1], a weight below 0, or sequences are not numbers of rows.
/// Allocates nothing beyond the size of `bytes`, and nothing after the first call of a shape.
[[nodiscard]] std::optional<base::Failure> ParseSample(std::span<const std::byte> bytes,
                                                       const SampleShape& shape, SampledRows* rows);

}  // namespace slalom::replay
