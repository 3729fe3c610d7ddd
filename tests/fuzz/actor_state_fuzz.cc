// States of an actor, with the checksum that they ought to have.

#include "actor/actor_state.h"
#include "base/error.h"
#include "base/file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const std::uint64_t checksum = base::Checksum(bytes);
  std::string whole = bytes;
  whole.append(reinterpret_cast<const char*>(&checksum), sizeof(checksum));
  for (const std::string& state : {bytes, whole}) {
    try {
      fuzz::Require(actor::ActorState::Parse(state, "input").Serialize() == state);
    } catch (const base::Error& error) {
      fuzz::Require(std::string_view(error.what()).starts_with("input: "));
    }
  }
  return 0;
}
