// Inserts and samples of the replay table, at the sizes that training uses: 720 beams, 64 streams.

#include <benchmark/benchmark.h>

#include <memory>
#include <vector>

#include "base/check.h"
#include "replay/table.h"

namespace slalom::replay {
namespace {

constexpr int kBeams = 720;
constexpr int kStreams = 64;
constexpr int kEpisodeSteps = 60;

/// Steps of 64 environments in turn, whose episodes all last 60 steps and begin at different times.
class Source {
 public:
  const Chunk& Next() {
    chunk_.Clear();
    const env::FrameView frame{scan_, state_};
    for (int s = 0; s < kStreams; ++s) {
      const int step = (time_ + s) % kEpisodeSteps;
      const bool first = time_ == 0 || step == 0;
      const bool ends = step == kEpisodeSteps - 1;
      chunk_.AddStep(
          s, first, frame, {},
          {.reward = 1.0f, .outcome = ends ? env::Outcome::kTimeout : env::Outcome::kRunning});
      if (ends) chunk_.AddFinal(s, frame);
    }
    ++time_;
    return chunk_;
  }

 private:
  Chunk chunk_{kBeams};
  std::vector<std::uint16_t> scan_ = std::vector<std::uint16_t>(kBeams, 250);
  std::vector<float> state_ = std::vector<float>(env::kStateSize, 1.0f);
  int time_ = 0;
};

const Table& FullTable() {
  static const std::unique_ptr<Table> table = [] {
    auto full = std::make_unique<Table>(ReplayConfig{.capacity = 500000}, kBeams);
    Source source;
    while (full->num_rows() < full->config().capacity) full->Insert(source.Next());
    return full;
  }();
  return *table;
}

void Insert(benchmark::State& state) {
  Table table({.capacity = 100000}, kBeams);
  Source source;
  // Once around, so that no page is touched for the first time while the clock runs.
  while (table.total_inserted() < 100000) table.Insert(source.Next());
  const std::int64_t before = table.total_inserted();
  for (auto _ : state) table.Insert(source.Next());
  state.SetItemsProcessed(table.total_inserted() - before);
}
BENCHMARK(Insert)->Unit(benchmark::kMicrosecond);

SampleSpec SpecOf(const benchmark::State& state) {
  return {.batch = static_cast<int>(state.range(0)),
          .history = static_cast<int>(state.range(1)),
          .n_step = static_cast<int>(state.range(2))};
}

void Sample(benchmark::State& state) {
  const Table& table = FullTable();
  base::Random random(1);
  Batch batch;
  for (auto _ : state) SLALOM_CHECK(table.Sample(SpecOf(state), random, &batch));
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(Sample)
    ->ArgNames({"batch", "history", "n_step"})
    ->Args({128, 1, 1})
    ->Args({128, 1, 4})
    ->Args({128, 4, 4})
    ->Args({128, 8, 4})
    ->Unit(benchmark::kMicrosecond);

/// Without the copy of the scans.
void SampleRows(benchmark::State& state) {
  const Table& table = FullTable();
  base::Random random(1);
  SampledRows rows;
  for (auto _ : state) SLALOM_CHECK(table.SampleRows(SpecOf(state), random, &rows));
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(SampleRows)
    ->ArgNames({"batch", "history", "n_step"})
    ->Args({128, 1, 1})
    ->Args({128, 1, 4})
    ->Args({128, 8, 4})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace slalom::replay
