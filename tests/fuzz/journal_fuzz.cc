// Journals of the replay server: a directory of one segment whose checksums are right and whose
// records are the input's, or whose bytes are.

#include <fstream>

#include "base/error.h"
#include "replay/journal.h"
#include "tests/fuzz/fuzz_input.h"

namespace slalom::fuzz {
namespace {

void Append(std::string* file, std::span<const std::byte> bytes) {
  file->append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

/// The segment that an input describes: records one after the other, each with its type, the size
/// of its head and of its rows, and both.
std::string MakeSegment(Input* input, int num_beams) {
  std::string file;
  replay::SegmentHead head;
  head.num_beams = num_beams;
  head.spec_hash = 7;
  head.index = 1;
  head.first_row = input->TakeIn(0, 3);
  Append(&file, replay::PrintSegmentHead(head));
  while (!input->rest().empty()) {
    replay::RecordBytes record;
    record.type = static_cast<std::uint32_t>(input->TakeIn(0, 5));
    const auto head_bytes = input->TakeBytes(input->Take<std::uint8_t>());
    record.head.assign(head_bytes.begin(), head_bytes.end());
    if (record.type == 4) record.rows = input->TakeBytes(input->Take<std::uint16_t>() % 2048);
    Append(&file, record.Prefix({head.index, file.size()}));
    Append(&file, record.head);
    Append(&file, record.rows);
    file.resize((file.size() + 7) / 8 * 8, '\0');
  }
  return file;
}

}  // namespace
}  // namespace slalom::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  static const std::filesystem::path directory = fuzz::ScratchDirectory("journal");
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    std::filesystem::remove(entry.path());
  }
  fuzz::Input input(data, size);
  const int num_beams = input.TakeIn(1, 3);
  const int cut = input.TakeIn(0, 63);
  std::string segment =
      input.TakeIn(0, 15) == 0 ? std::string(input.text()) : fuzz::MakeSegment(&input, num_beams);
  if (cut > 40) segment.resize(segment.size() - std::min<std::size_t>(cut - 40, segment.size()));
  const replay::JournalOptions options{.directory = directory, .shape = num_beams, .spec_hash = 7};
  std::ofstream(directory / "journal-00000001.log", std::ios::binary) << segment;
  try {
    const replay::Recovered recovered = replay::RecoverJournal(options, {.capacity = 16});
    replay::SampledRows sampled;
    base::Random random(1);
    (void)recovered.table.SampleRows({.batch = 8, .history = 3, .n_step = 2}, random, &sampled);
  } catch (const base::Error&) {
  }
  return 0;
}
