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
/// [cm], flags [R] uint8, each column right after the other, little-endian. Views only.
class RowBytes {
 public:
  /// Bytes of `num_rows` rows.
  static std::size_t Size(int num_rows, int num_beams);

  /// Writes the rows. Requires: out.size() == Size(...) and starts on a multiple of 4 bytes.
  static void Write(const Chunk& chunk, std::span<std::byte> out);

  /// Looks at bytes that anybody may have sent. Fails where their number is not that of so many
  /// rows, they do not start on a multiple of 4 bytes, a number is not finite, a flag unknown or a
  /// stream not in [0, num_streams). What the flags say of episodes is checked by `CheckEpisodes`.
  static base::Result<RowBytes> Parse(std::span<const std::byte> bytes, int num_rows, int num_beams,
                                      int num_streams);

  int num_rows() const { return num_rows_; }
  int num_beams() const { return num_beams_; }
  int num_steps() const;  ///< Rows that are not final.
  RowView row(int r) const;
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  RowBytes(std::span<const std::byte> bytes, int num_rows, int num_beams)
      : bytes_(bytes), num_rows_(num_rows), num_beams_(num_beams) {}

  std::span<const std::byte> bytes_;
  int num_rows_;
  int num_beams_;
};

}  // namespace slalom::replay
