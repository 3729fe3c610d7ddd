// The claim of a cell of a sweep: nobody but its owner takes the cell before it expires, and then
// one worker does.

#include <fstream>

#include "app/sweep/claim.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  static const std::filesystem::path cell = fuzz::ScratchDirectory("claim");
  for (const auto& entry : std::filesystem::directory_iterator(cell)) {
    std::filesystem::remove(entry.path());
  }
  std::ofstream(cell / "claim-1", std::ios::binary) << fuzz::Input(data, size).text();
  sweep::ClaimTaker taker;
  const auto begin = sweep::ClaimTaker::Clock::now();
  // No input names this machine's start, so no owner is known to be dead.
  fuzz::Require(taker.Try(cell, begin) == nullptr);
  const auto claim = taker.Try(cell, begin + sweep::Claim::kExpiry);
  fuzz::Require(claim != nullptr && claim->Renew() && sweep::IsClaimed(cell));
  return 0;
}
