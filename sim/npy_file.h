#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace slalom::sim {

/// A table of whole numbers from a NumPy file. A value.
struct IntegerTable {
  std::size_t num_rows = 0;
  std::size_t num_cols = 0;
  std::vector<std::int64_t> values;  ///< [num_rows, num_cols], row by row.

  std::int64_t at(std::size_t row, std::size_t col) const { return values[row * num_cols + col]; }
};

/// The table in the bytes of a .npy file: format version 1 or 2, type int64 little-endian ('<i8'),
/// two dimensions, C or Fortran order. Throws `Error` that names `source` where it is anything
/// else, or cut short.
IntegerTable ParseNpy(std::string_view bytes, std::string_view source);

/// Reads a .npy file. Throws `Error` as `ParseNpy` does, or where it cannot be read.
IntegerTable ReadNpy(const std::filesystem::path& path);

}  // namespace slalom::sim
