// NumPy files of the original data set.

#include "base/error.h"
#include "sim/courses/npy_file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  try {
    const sim::IntegerTable table = sim::ParseNpy(bytes, "input");
    fuzz::Require(table.values.size() == table.num_rows * table.num_cols);
    fuzz::Require(8 * table.values.size() <= size);
  } catch (const base::Error& error) {
    fuzz::Require(std::string_view(error.what()).starts_with("input"));
  }
  return 0;
}
