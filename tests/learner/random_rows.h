#pragma once

#include <cstdint>
#include <memory>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "base/random.h"
#include "replay/batch.h"

namespace slalom::learner {

/// Sampled rows of random numbers that own their scans, numbered from `begin` on.
struct RandomRows {
  RandomRows(int batch, int history, int num_beams, std::uint64_t seed, std::int64_t begin = 0) {
    base::Random random(seed);
    const std::size_t frames = static_cast<std::size_t>(batch) * history;
    for (auto* scan : {&scans, &next_scans}) {
      scan->resize(frames * num_beams);
      for (auto& range : *scan) range = static_cast<std::uint16_t>(random.UniformInt(501));
    }
    rows.batch = batch;
    rows.history = history;
    rows.num_beams = num_beams;
    rows.state.Resize(frames * env::kStateSize);
    rows.next_state.Resize(frames * env::kStateSize);
    rows.action.Resize(batch);
    rows.n_step_return.Resize(batch);
    rows.cost_return.Resize(batch);
    rows.discount.Resize(batch);
    rows.weight.Resize(batch);
    rows.sequence.resize(batch);
    std::iota(rows.sequence.begin(), rows.sequence.end(), begin);
    const auto draw = [&] { return static_cast<float>(random.Uniform(-1.0, 1.0)); };
    for (std::size_t i = 0; i < frames; ++i) {
      rows.ranges_cm.push_back(scans.data() + i * num_beams);
      rows.next_ranges_cm.push_back(next_scans.data() + i * num_beams);
      for (std::size_t j = 0; j < env::kStateSize; ++j) {
        rows.state[i * env::kStateSize + j] = draw();
        rows.next_state[i * env::kStateSize + j] = draw();
      }
    }
    for (int i = 0; i < batch; ++i) {
      rows.action[i] = {draw(), draw()};
      rows.n_step_return[i] = draw();
      rows.cost_return[i] = i % 3 == 0 ? 0.5f : 0.0f;
      rows.discount[i] = i % 4 == 0 ? 0.0f : 0.96f;
      rows.weight[i] = 1.0f;
    }
  }
  RandomRows(const RandomRows&) = delete;
  RandomRows& operator=(const RandomRows&) = delete;

  /// As an update without a model takes them.
  std::span<const replay::SampledRows> batches() const { return {&rows, 1}; }

  std::vector<std::uint16_t> scans;
  std::vector<std::uint16_t> next_scans;
  replay::SampledRows rows;
};

/// One of each kind that an update learns from.
struct RandomBatches {
  RandomBatches(std::span<const replay::SampleSpec> specs, int num_beams, std::uint64_t seed,
                std::int64_t begin = 0) {
    for (const replay::SampleSpec& spec : specs) {
      owners.push_back(
          std::make_unique<RandomRows>(spec.batch, spec.history, num_beams, seed, begin));
      batches.push_back(std::move(owners.back()->rows));
    }
  }

  std::vector<std::unique_ptr<RandomRows>> owners;  // Of the scans.
  std::vector<replay::SampledRows> batches;
};

}  // namespace slalom::learner
