#include "sim/courses/npy_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string>
#include <system_error>

#include "base/error.h"
#include "base/file.h"

namespace slalom::sim {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kMaxValues = 1u << 24;

[[noreturn]] void Fail(std::string_view source, std::string_view what) {
  throw base::Error("{}: cannot be read as a .npy file: {}", source, what);
}

/// `size` bytes of `bytes` from `offset` as an unsigned number, least significant byte first.
std::uint64_t LittleEndian(std::string_view bytes, std::size_t offset, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = size; i-- > 0;) {
    value = value << 8 | static_cast<unsigned char>(bytes[offset + i]);
  }
  return value;
}

/// The text after `'key':` in the Python dictionary of the header, without leading blanks.
std::string_view ValueOf(std::string_view header, std::string_view key, std::string_view source) {
  const std::string quoted = fmt::format("'{}':", key);
  const std::size_t at = header.find(quoted);
  if (at == std::string_view::npos) Fail(source, fmt::format("its header has no {}", quoted));
  header.remove_prefix(at + quoted.size());
  header.remove_prefix(std::min(header.find_first_not_of(' '), header.size()));
  return header;
}

std::size_t TakeNumber(std::string_view& text, std::string_view source) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || number > kMaxValues) Fail(source, "its shape is not (rows, columns)");
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return number;
}

void TakeText(std::string_view& text, std::string_view expected, std::string_view source) {
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  if (!text.starts_with(expected)) Fail(source, "its shape is not (rows, columns)");
  text.remove_prefix(expected.size());
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
}

}  // namespace

IntegerTable ParseNpy(std::string_view bytes, std::string_view source) {
  if (bytes.size() < 12 || !bytes.starts_with(kMagic))
    Fail(source, "it does not begin with the bytes of such a file");
  const int version = static_cast<unsigned char>(bytes[6]);
  if (version != 1 && version != 2) Fail(source, fmt::format("its format version is {}", version));
  const std::size_t length_size = version == 1 ? 2 : 4;
  const auto header_size = static_cast<std::size_t>(LittleEndian(bytes, 8, length_size));
  const std::size_t header_start = 8 + length_size;
  if (bytes.size() - header_start < header_size) Fail(source, "it is cut short");
  const std::string_view header = bytes.substr(header_start, header_size);
  const std::string_view data = bytes.substr(header_start + header_size);

  if (!ValueOf(header, "descr", source).starts_with("'<i8'")) Fail(source, "its type is not '<i8'");
  const bool is_fortran = ValueOf(header, "fortran_order", source).starts_with("True");
  std::string_view shape = ValueOf(header, "shape", source);
  IntegerTable table;
  TakeText(shape, "(", source);
  table.num_rows = TakeNumber(shape, source);
  TakeText(shape, ",", source);
  table.num_cols = TakeNumber(shape, source);
  TakeText(shape, ")", source);

  const std::size_t size = table.num_rows * table.num_cols;
  if (size > kMaxValues) Fail(source, "its table is too large for this program");
  if (data.size() != 8 * size) {
    Fail(source,
         fmt::format("it holds {} bytes of data, its shape needs {}", data.size(), 8 * size));
  }
  table.values.resize(size);
  for (std::size_t row = 0; row < table.num_rows; ++row) {
    for (std::size_t col = 0; col < table.num_cols; ++col) {
      const std::size_t from = is_fortran ? col * table.num_rows + row : row * table.num_cols + col;
      table.values[row * table.num_cols + col] =
          static_cast<std::int64_t>(LittleEndian(data, 8 * from, 8));
    }
  }
  return table;
}

IntegerTable ReadNpy(const std::filesystem::path& path) {
  return ParseNpy(base::ReadFile(path), path.string());
}

}  // namespace slalom::sim
