// The spool of an actor: the input, with the checksum that it lacks or as it is. What is read is
// sent and saved as it was read.

#include <fstream>

#include "actor/service/outbox.h"
#include "base/error.h"
#include "base/file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  static const std::filesystem::path directory = fuzz::ScratchDirectory("spool");
  fuzz::Input input(data, size);
  const bool is_whole = input.TakeIn(0, 3) == 0;
  std::string bytes(input.text());
  if (!is_whole) {
    const std::uint64_t checksum = base::Checksum(std::string_view(bytes));
    bytes.append(reinterpret_cast<const char*>(&checksum), sizeof(checksum));
  }
  std::ofstream(directory / "spool", std::ios::binary) << bytes;
  actor::Outbox outbox(1 << 20);
  try {
    const auto num_streams = outbox.LoadSpool(directory / "spool");
    fuzz::Require(num_streams.has_value() && outbox.steps() >= 0);
    outbox.SaveSpool(directory / "again", *num_streams);
    fuzz::Require(outbox.empty() || base::ReadFile(directory / "again") == bytes);
    while (const actor::OutgoingChunk* const chunk = outbox.NextToSend(1 << 30)) {
      (void)proto::Encode(chunk->header, chunk->payload.bytes());
      outbox.MarkSent();
    }
  } catch (const base::Error&) {
  }
  return 0;
}
