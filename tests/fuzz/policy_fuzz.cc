// Policies, as they travel in messages and stand in files. They need no checksum.

#include "base/error.h"
#include "policy/policy.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  try {
    const auto loaded = policy::ParsePolicy(std::as_bytes(std::span(data, size)), "input");
    const std::string printed = policy::PrintPolicy(loaded.snapshot, loaded.metadata);
    const auto again = policy::ParsePolicy(std::as_bytes(std::span(printed)), "printed");
    fuzz::Require(*again.snapshot.weights == *loaded.snapshot.weights);
  } catch (const base::Error& error) {
    fuzz::Require(std::string_view(error.what()).starts_with("input: "));
  }
  return 0;
}
