#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/result.h"
#include "replay/chunk.h"

/// Shapes: `R` rows; `N`, `S` and `A` of `env::StepShape`.

namespace slalom::replay {

/// The rows of a chunk as they are sent and kept, in one block of bytes: state [R, S] float32,
/// action [R, A] float32, reward [R] float32, cost [R] float32, stream [R] int32, ranges [R, N]
/// uint16 [cm], flags [R] uint8; the columns follow each other without padding, little-endian. A
/// view: the bytes must outlive it. The sender numbers its streams from 0.
class RowBytes {
 public:
  /// Returns the size of `num_rows` rows in bytes. Requires: num_rows >= 0.
  static std::size_t Size(int num_rows, const env::StepShape& shape);

  /// Writes the rows to `out`. Requires: out.size() == Size(...); `out` starts on a multiple of 4
  /// bytes.
  static void Write(const Chunk& chunk, std::span<std::byte> out);

  /// Largest magnitude of a state's number, a reward or a cost, far above what a simulator makes.
  static constexpr float kMaxNumber = 1e6f;

  /// Parses bytes from an untrusted peer. Fails if there is no row, the number of bytes is not the
  /// size of `num_rows` rows, they do not start on a multiple of 4 bytes, a number is not finite or
  /// its magnitude is above `kMaxNumber`, flags contradict each other, a final row has an action,
  /// reward or cost, or a stream is not in [0, num_streams). Whether the flags form episodes is
  /// checked by `Table::CheckEpisodes`. Allocates only the text of a failure. Cost: reads
  /// everything except the ranges.
  static base::Result<RowBytes> Parse(std::span<const std::byte> bytes, int num_rows,
                                      const env::StepShape& shape, int num_streams);

  int num_rows() const { return num_rows_; }
  const env::StepShape& shape() const { return shape_; }
  int num_streams() const { return num_streams_; }  ///< As given to `Parse`.
  int num_steps() const;                            ///< Number of rows that are not final.
  std::int32_t stream(int r) const { return streams()[r]; }
  std::uint8_t flags(int r) const { return all_flags()[r]; }
  RowView row(int r) const;
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  RowBytes(std::span<const std::byte> bytes, int num_rows, const env::StepShape& shape,
           int num_streams)
      : bytes_(bytes), num_rows_(num_rows), shape_(shape), num_streams_(num_streams) {}

  const float* numbers() const { return reinterpret_cast<const float*>(bytes_.data()); }
  const std::int32_t* streams() const;
  const std::uint8_t* all_flags() const;

  std::span<const std::byte> bytes_;
  int num_rows_;
  env::StepShape shape_;
  int num_streams_;
};

/// Returns the index of the first value that is not finite, or values.size() if all are finite.
std::size_t FirstNotFinite(std::span<const float> values);

}  // namespace slalom::replay
