// Results of evaluations, without the files that they name.

#include "base/error.h"
#include "eval/report/result.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const eval::ParsedResult parsed = eval::ParseResult(text, "input");
    fuzz::Require(parsed.result.file == "input" &&
                  parsed.courses_file.find('/') == std::string::npos &&
                  parsed.tracks_file.find('/') == std::string::npos);
  } catch (const base::Error& error) {
    fuzz::Require(std::string_view(error.what()).starts_with("input:"));
  }
  return 0;
}
