// Chunks of rows, one after the other into one table, as a replay server takes them.

#include "replay/rows.h"
#include "replay/table.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  fuzz::Input input(data, size);
  const int beams = input.TakeIn(1, 4);
  const int streams = input.TakeIn(1, 4);
  replay::Table table({.capacity = input.TakeIn(2, 20)}, beams);
  const replay::SampleSpec spec{
      .batch = 8, .history = input.TakeIn(1, 4), .n_step = input.TakeIn(1, 4), .gamma = 0.9};
  base::Random random(1);
  replay::SampledRows sampled;
  while (!input.rest().empty()) {
    const int num_rows = input.TakeIn(0, 12);
    const int stream_base = input.TakeIn(0, 3);
    const int cut = input.TakeIn(0, 15);
    // Mostly as many bytes as are announced.
    const std::size_t wanted = replay::RowBytes::Size(num_rows, beams) + (cut == 14 ? 1 : 0);
    fuzz::AlignedCopy copy(input.TakeBytes(wanted), wanted);
    if (cut < 8) table.Cut(cut);
    const auto rows = replay::RowBytes::Parse(copy.bytes(), num_rows, beams, streams);
    if (!rows) continue;
    fuzz::Require(rows->num_steps() <= rows->num_rows());
    if (table.CheckEpisodes(*rows, stream_base)) continue;
    const std::int64_t before = table.total_inserted();
    table.InsertRows(*rows, stream_base);
    fuzz::Require(table.total_inserted() == before + num_rows);
    (void)table.SampleRows(spec, random, &sampled);
  }
  return 0;
}
