// What learners were granted, as a replay server keeps it.

#include <fmt/format.h>

#include "base/file.h"
#include "replay/rate_limiter.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string text(reinterpret_cast<const char*>(data), size);
  // The second has a checksum that is right.
  for (const std::string& whole :
       {text, fmt::format("{:016x}\n{}", base::Checksum(std::string_view(text)), text)}) {
    replay::RateLimiter limiter({.max_ahead_steps = 5}, 100);
    limiter.Ask("a", 1);
    const std::string before = limiter.PrintCursors();
    if (limiter.RestoreCursors(whole)) {
      fuzz::Require(limiter.PrintCursors() == before);
      continue;
    }
    const std::string after = limiter.PrintCursors();
    fuzz::Require(!limiter.RestoreCursors(after) && limiter.PrintCursors() == after);
    static_cast<void>(limiter.MayInsert());
  }
  return 0;
}
