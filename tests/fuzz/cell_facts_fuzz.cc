// What a cell of a sweep says of itself (cell.json), as the live page reads it.

#include <fstream>

#include "app/watch/run_progress.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  static const std::filesystem::path cell = fuzz::ScratchDirectory("cell_facts") / "id";
  std::filesystem::create_directories(cell);
  std::ofstream(cell / "cell.json", std::ios::binary) << fuzz::Input(data, size).text();
  fuzz::Require(!watch::NameOf(cell / "run").empty());
  return 0;
}
