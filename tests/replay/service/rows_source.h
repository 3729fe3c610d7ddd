#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/random.h"
#include "proto/transport/frame.h"
#include "replay/chunk.h"
#include "replay/rows.h"

namespace slalom::replay {

/// Sound chunks of some environments, as an actor would make them: random numbers, random ends of
/// episodes.
class RowsSource {
 public:
  RowsSource(int num_beams, int num_streams, std::uint64_t seed)
      : num_beams_(num_beams), random_(seed), open_(static_cast<std::size_t>(num_streams), 0) {}

  int num_beams() const { return num_beams_; }

  /// One step in each environment, `steps` times.
  Chunk Next(int steps = 1) {
    Chunk chunk(num_beams_);
    for (int i = 0; i < steps; ++i) {
      for (std::size_t s = 0; s < open_.size(); ++s) AddStep(static_cast<int>(s), &chunk);
    }
    return chunk;
  }

  /// The environments were started anew.
  void Reset() { std::fill(open_.begin(), open_.end(), 0); }

  static transport::Frame Bytes(const Chunk& chunk) {
    transport::Frame frame(RowBytes::Size(chunk.num_rows(), chunk.shape));
    RowBytes::Write(chunk, frame.mutable_bytes());
    return frame;
  }

  static int NumSteps(const Chunk& chunk) {
    int steps = 0;
    for (const std::uint8_t flags : chunk.flags) steps += !(flags & kRowFinal);
    return steps;
  }

 private:
  void AddStep(int stream, Chunk* chunk) {
    std::vector<std::uint16_t> ranges(static_cast<std::size_t>(num_beams_));
    for (auto& r : ranges) r = static_cast<std::uint16_t>(random_.UniformInt(1000));
    std::vector<float> state(env::kStateSize);
    for (auto& x : state) x = static_cast<float>(random_.Normal());
    const env::FrameView frame{ranges, state};
    const double fate = random_.Uniform();
    const auto outcome = fate < 0.1   ? env::Outcome::kCollision
                         : fate < 0.2 ? env::Outcome::kTimeout
                                      : env::Outcome::kRunning;
    const env::StepResult result{
        .reward = static_cast<float>(random_.Normal()), .cost = 0.0f, .outcome = outcome};
    std::uint8_t& open = open_[static_cast<std::size_t>(stream)];
    chunk->AddStep(stream, !open, frame, std::array{0.5f, -0.5f}, result);
    open = !result.ended();
    if (result.ended()) chunk->AddFinal(stream, frame);
  }

  const int num_beams_;
  base::Random random_;
  std::vector<std::uint8_t> open_;
};

}  // namespace slalom::replay
