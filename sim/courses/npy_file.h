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

/// Parses the bytes of a .npy file of format version 1 or 2 that holds a two-dimensional table of
/// int64, little-endian ('<i8'), in C or Fortran order. Throws `Error` that names `source` if it
/// holds anything else or is cut short.
IntegerTable ParseNpy(std::string_view bytes, std::string_view source);

/// Reads a .npy file. Throws `Error` as `ParseNpy` does, or if the file cannot be read.
IntegerTable ReadNpy(const std::filesystem::path& path);

}  // namespace slalom::sim
