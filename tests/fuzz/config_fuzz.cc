// Configs: what is read without an error is printed as a text that reads back to the same.

#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string_view text = fuzz::Input(data, size).text();
  try {
    train::RunConfig config;
    config::ReadToml(text, "input", config::ListFields(config));
    const std::string printed = config::ToToml(config);
    train::RunConfig again;
    config::ReadToml(printed, "printed", config::ListFields(again));
    fuzz::Require(config::ToToml(again) == printed);
  } catch (const base::Error&) {
  }
  return 0;
}
