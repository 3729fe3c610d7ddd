#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/result.h"
#include "replay/chunk.h"

/// Shapes: `R` rows, `N` beams, `S` = env::kStateSize.

namespace slalom::replay {

/// The rows of a chunk as one run of bytes, as they are sent and kept: state [R, S] float32, action
/// [R, 2] float32, reward [R] float32, cost [R] float32, stream [R] int32, ranges [R, N] uint16
/// [cm], flags [R] uint8, each column right after the other, little-endian. A view: the bytes must
/// outlive it. Streams are numbered by who sends them, from 0.
class RowBytes {
 public:
  /// Bytes of `num_rows` rows. Requires: num_rows, num_beams >= 0.
  static std::size_t Size(int num_rows, int num_beams);

  /// Writes the rows. Requires: out.size() == Size(...) and starts on a multiple of 4 bytes.
  static void Write(const Chunk& chunk, std::span<std::byte> out);

  /// Looks at bytes that anybody may have sent. Fails where there is no row, their number is not
  /// that of so many rows, they do not start on a multiple of 4 bytes, a number is not finite,
  /// flags do not go together, a final row holds an action, reward or cost, or a stream is not in
  /// [0, num_streams). What the flags say of episodes is checked by `Table::CheckEpisodes`.
  /// Allocates nothing but the text of a failure. Cost: reads all but the ranges.
  static base::Result<RowBytes> Parse(std::span<const std::byte> bytes, int num_rows, int num_beams,
                                      int num_streams);

  int num_rows() const { return num_rows_; }
  int num_beams() const { return num_beams_; }
  int num_streams() const { return num_streams_; }  ///< As given to `Parse`.
  int num_steps() const;                            ///< Rows that are not final.
  std::int32_t stream(int r) const { return streams()[r]; }
  std::uint8_t flags(int r) const { return all_flags()[r]; }
  RowView row(int r) const;
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  RowBytes(std::span<const std::byte> bytes, int num_rows, int num_beams, int num_streams)
      : bytes_(bytes), num_rows_(num_rows), num_beams_(num_beams), num_streams_(num_streams) {}

  const float* numbers() const { return reinterpret_cast<const float*>(bytes_.data()); }
  const std::int32_t* streams() const;
  const std::uint8_t* all_flags() const;

  std::span<const std::byte> bytes_;
  int num_rows_;
  int num_beams_;
  int num_streams_;
};

}  // namespace slalom::replay
