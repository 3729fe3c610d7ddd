// The ledger of an actor: its steps add up, whatever the file holds, and go on adding up.

#include <fstream>

#include "actor/service/ledger.h"
#include "base/error.h"
#include "tests/fuzz/fuzz_input.h"

namespace slalom::fuzz {
namespace {

void RequireSum(const actor::Ledger& ledger) {
  const actor::StepAccount account = ledger.account();
  std::int64_t sum = account.accepted + account.pending;
  for (const std::int64_t lost : account.lost) sum += lost;
  Require(account.pending >= 0 && sum == account.made);
}

}  // namespace
}  // namespace slalom::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  static const std::filesystem::path path = fuzz::ScratchDirectory("ledger") / "ledger";
  std::ofstream(path, std::ios::binary) << fuzz::Input(data, size).text();
  try {
    actor::Ledger ledger(path);
    fuzz::RequireSum(ledger);
    ledger.AddMade(3);
    ledger.AcknowledgeAllBut(1);
    ledger.BeginSession(ledger.session() + 1, 2, actor::LossReason::kKilled);
    fuzz::RequireSum(ledger);
  } catch (const base::Error&) {
  }
  return 0;
}
