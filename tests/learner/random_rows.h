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
  RandomRows(int batch, int history, const env::StepShape& shape, std::uint64_t seed,
             std::int64_t begin = 0) {
    base::Random random(seed);
    const std::size_t frames = static_cast<std::size_t>(batch) * history;
    for (auto* scan : {&scans, &next_scans}) {
      scan->resize(frames * shape.num_beams);
      for (auto& range : *scan) range = static_cast<std::uint16_t>(random.UniformInt(501));
    }
    rows.Resize(batch, history, shape);
    std::iota(rows.sequence.begin(), rows.sequence.end(), begin);
    const auto draw = [&] { return static_cast<float>(random.Uniform(-1.0, 1.0)); };
    for (std::size_t i = 0; i < frames; ++i) {
      rows.ranges_cm[i] = scans.data() + i * shape.num_beams;
      rows.next_ranges_cm[i] = next_scans.data() + i * shape.num_beams;
      const auto state_size = static_cast<std::size_t>(shape.state_size);
      for (std::size_t j = 0; j < state_size; ++j) {
        rows.state[i * state_size + j] = draw();
        rows.next_state[i * state_size + j] = draw();
      }
    }
    for (int i = 0; i < batch; ++i) {
      for (int j = 0; j < shape.action_size; ++j) rows.action[i * shape.action_size + j] = draw();
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
  RandomBatches(std::span<const replay::SampleSpec> specs, const env::StepShape& shape,
                std::uint64_t seed, std::int64_t begin = 0) {
    for (const replay::SampleSpec& spec : specs) {
      owners.push_back(std::make_unique<RandomRows>(spec.batch, spec.history, shape, seed, begin));
      batches.push_back(std::move(owners.back()->rows));
    }
  }

  std::vector<std::unique_ptr<RandomRows>> owners;  // Of the scans.
  std::vector<replay::SampledRows> batches;
};

}  // namespace slalom::learner
