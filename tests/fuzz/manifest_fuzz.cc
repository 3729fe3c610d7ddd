// Manifests of the replay buffer, with the checksum that they ought to have.

#include <fmt/format.h>

#include "base/error.h"
#include "base/file.h"
#include "replay/manifest.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string text(reinterpret_cast<const char*>(data), size);
  for (const std::string& whole :
       {text, text + fmt::format("checksum {:016x}\n", base::Checksum(text))}) {
    try {
      const replay::Manifest manifest = replay::ParseManifest(whole, "input");
      const std::string printed = replay::PrintManifest(manifest);
      fuzz::Require(replay::PrintManifest(replay::ParseManifest(printed, "printed")) == printed);
    } catch (const base::Error& error) {
      fuzz::Require(std::string_view(error.what()).starts_with("input: "));
    }
  }
  return 0;
}
