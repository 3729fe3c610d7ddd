#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "replay/batch.h"
#include "replay/scan_mirror.h"

/// Samples that a replay server sends a learner, and priorities that it gets back, each in one
/// block of bytes, without padding, little-endian.
///
/// A sample: sequence [B] int64, next_sequence [B] int64, state [B, H, S] float32, next_state [B,
/// H, S] float32, action [B, A] float32, n_step_return [B] float32, cost_return [B] float32,
/// discount [B] float32, if weighted weight [B] float32, then ranges [B, H, N] uint16 [cm] and next
/// ranges [B, H, N] uint16 [cm].
///
/// A sample with a mirror (replay/scan_mirror.h): the same up to the ranges, then for each frame of
/// ranges and next ranges [2, B, H] int32 the place of its scan, or its bitwise complement if the
/// scan was not sent before, and then those scans in this order, [C, N] uint16 [cm].
///
/// New priorities of sampled rows: sequence [C] int64, priority [C] float32.

namespace slalom::replay {

/// The shape of a sample.
struct SampleShape {
  int batch = 1;          ///< B, at least 1.
  int history = 1;        ///< H, at least 1.
  env::StepShape step;    ///< N, S and A
  bool weighted = false;  ///< Whether it has importance weights; if not, all are 1.
};

/// Returns the size of a sample in bytes, or nothing if no memory could hold it. If a peer chose
/// the shape, compare this size with the limit before drawing anything.
std::optional<std::size_t> SampleSize(const SampleShape& shape);

/// Writes a sample to `out`, copying scans straight from the table. Requires: out.size() ==
/// SampleSize(...); `out` starts on a multiple of 8 bytes.
void WriteSample(const SampledRows& rows, bool weighted, std::span<std::byte> out);

/// Parses bytes from an untrusted peer. `rows` then points to the scans in `bytes`, which must
/// outlive it; the rest is copied. Fails, leaving `rows` unspecified, if the number of bytes does
/// not fit the shape, they do not start on a multiple of 8 bytes, a number is not finite, a
/// discount is not in [0, 1], a weight is negative, or sequences are not row numbers. Allocates at
/// most the size of `bytes`, and nothing after the first call with a shape.
[[nodiscard]] std::optional<base::Failure> ParseSample(std::span<const std::byte> bytes,
                                                       const SampleShape& shape, SampledRows* rows);

/// The scans of a sample with a mirror.
struct MirroredScans {
  std::vector<std::int32_t> places;           ///< [2, B, H], as `MirroredRows::Take` returned them.
  std::vector<const std::uint16_t*> to_send;  ///< [C] -> [N], those of the negative places.
};

/// Returns the size of a sample with a mirror, of which `num_scans` scans are sent. Requires:
/// SampleSize(shape) returns a size; 0 <= num_scans <= 2 B H.
std::size_t MirroredSampleSize(const SampleShape& shape, std::size_t num_scans);

/// As `WriteSample`. Requires: out.size() == MirroredSampleSize(...).
void WriteMirroredSample(const SampledRows& rows, bool weighted, const MirroredScans& scans,
                         std::span<std::byte> out);

/// As `ParseSample`, for a reader that keeps a mirror. `rows` then points to scans in `bytes` and
/// in `mirror`, which notes those that came. Fails as well if a place is not one of the mirror's,
/// if it holds no scan, or if there are not `num_scans` new ones; scans may have been noted then.
[[nodiscard]] std::optional<base::Failure> ParseMirroredSample(std::span<const std::byte> bytes,
                                                               const SampleShape& shape,
                                                               std::size_t num_scans,
                                                               ScanMirror* mirror,
                                                               SampledRows* rows);

/// Returns the size of `count` priorities in bytes. Requires: count >= 0.
std::size_t PrioritySize(int count);

/// Writes priorities to `out`. Requires: both spans have the same size; out.size() ==
/// PrioritySize(...); `out` starts on a multiple of 8 bytes.
void WritePriorities(std::span<const std::int64_t> sequence, std::span<const float> priority,
                     std::span<std::byte> out);

/// Views only.
struct PriorityView {
  std::span<const std::int64_t> sequence;  ///< [C] >= 0; the table may no longer hold such a row.
  std::span<const float> priority;         ///< [C] finite, >= 0
};

/// Parses bytes from an untrusted peer. Fails if their number is not the size of `count`
/// priorities, if they do not start on a multiple of 8 bytes, or if a value is outside the ranges
/// above.
base::Result<PriorityView> ParsePriorities(std::span<const std::byte> bytes, int count);

}  // namespace slalom::replay
