// Tracks of episodes, as JSON lines.

#include "base/error.h"
#include "sim/courses/episode_file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const auto tracks = sim::ParseEpisodes(text, "input");
    const std::string printed = sim::PrintEpisodes(tracks);
    fuzz::Require(sim::PrintEpisodes(sim::ParseEpisodes(printed, "printed")) == printed);
  } catch (const base::Error& error) {
    fuzz::Require(std::string_view(error.what()).starts_with("input:"));
  }
  return 0;
}
