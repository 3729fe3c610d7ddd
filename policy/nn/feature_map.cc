#include "policy/nn/feature_map.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace slalom::nn {
namespace {

std::uint16_t Minimum(const std::uint16_t* values, int n) {
  std::uint16_t minimum = values[0];
  for (int i = 1; i < n; ++i) minimum = std::min(minimum, values[i]);
  return minimum;
}

void PortableMinima(const std::uint16_t* values, int group, int num_groups, std::uint16_t* minima) {
  for (int i = 0; i < num_groups; ++i) minima[i] = Minimum(values + i * group, group);
}

#if defined(__x86_64__)
/// Requires: group >= 8. The last load overlaps the one before: a minimum may see a value twice.
__attribute__((target("sse4.1"))) void Sse41Minima(const std::uint16_t* values, int group,
                                                   int num_groups, std::uint16_t* minima) {
  for (int i = 0; i < num_groups; ++i) {
    const std::uint16_t* const begin = values + i * group;
    __m128i minimum = _mm_loadu_si128(reinterpret_cast<const __m128i*>(begin + group - 8));
    for (int j = 0; j + 8 < group; j += 8) {
      minimum =
          _mm_min_epu16(minimum, _mm_loadu_si128(reinterpret_cast<const __m128i*>(begin + j)));
    }
    minima[i] = static_cast<std::uint16_t>(_mm_extract_epi16(_mm_minpos_epu16(minimum), 0));
  }
}
#endif

/// Writes the minimum of each of `num_groups` consecutive groups.
void GroupMinima(const std::uint16_t* values, int group, int num_groups, std::uint16_t* minima) {
#if defined(__x86_64__)
  static const bool has_sse41 = __builtin_cpu_supports("sse4.1");
  if (group >= 8 && has_sse41) return Sse41Minima(values, group, num_groups, minima);
#endif
  PortableMinima(values, group, num_groups, minima);
}

}  // namespace

FeatureMap::FeatureMap(const env::ObservationSpec& spec, const NetworkConfig& config)
    : num_beams_(spec.num_beams),
      state_size_(spec.state_size),
      num_ranges_(config.sectors == 0 ? spec.num_beams : config.sectors),
      beams_per_range_(num_ranges_ == 0 ? 0 : spec.num_beams / num_ranges_),
      goal_transform_(config.goal_transform),
      goal_scale_(static_cast<float>(spec.goal_scale)) {
  base::ThrowIf(num_beams_ > 0 && state_size_ != env::StateSize(spec),
                "found a state of {} numbers beside a scan, expected {}", state_size_,
                env::StateSize(spec));
  base::ThrowIf(
      num_beams_ > 0 && state_size_ != env::kStateSize &&
          EncoderOf(config) == EncoderKind::kBeamCnn,
      "network.cnn_axis: found \"beams\", expected \"time\", or environment.observation to add "
      "nothing to goal and last action");
  base::ThrowIf(num_beams_ == 0 && EncoderOf(config) == EncoderKind::kBeamCnn,
                "network.cnn_axis: found \"beams\" without a scan, expected \"time\"");
  base::ThrowIf(
      beams_per_range_ * num_ranges_ != num_beams_ || (num_ranges_ > 0 && beams_per_range_ < 1),
      "network.sectors: found {}, expected 0 or a divisor of the {} beams of a scan",
      config.sectors, spec.num_beams);
  env::ForEachNumber(spec, [this](const auto&, const env::StateNumber& number) {
    mirror_.push_back(number.has_side ? -1.0f : 1.0f);
  });
  const float clip_cm = static_cast<float>(100.0 * spec.range_clip);
  table_.resize(static_cast<std::size_t>(std::ceil(clip_cm)) + 1);
  for (std::size_t cm = 0; cm < table_.size(); ++cm) {
    const float range_cm = std::min(static_cast<float>(cm), clip_cm);
    table_[cm] = config.range_transform == RangeTransform::kInverse
                     ? 0.6f / (range_cm * 0.01f + 0.2f) - 0.8f
                     : range_cm * (2.0f / clip_cm) - 1.0f;
  }
}

void FeatureMap::Write(const std::uint16_t* ranges_cm, const float* state, bool mirrored,
                       float* features) const {
  if (num_beams_ == 0) {
    std::copy_n(state, state_size_, features);
    return;
  }
  if (beams_per_range_ > 1) {
    PoolSectors(ranges_cm, mirrored, features);
  } else {
    const std::size_t last = table_.size() - 1;
    for (int i = 0; i < num_ranges_; ++i) {
      const std::size_t cm = ranges_cm[mirrored ? num_ranges_ - 1 - i : i];
      features[i] = table_[std::min(cm, last)];
    }
  }
  const float side = mirrored ? -1.0f : 1.0f;
  float* const rest = features + num_ranges_;
  WriteGoal(state, side, rest);
  for (int i = 2; i < state_size_; ++i) rest[i] = mirrored ? mirror_[i] * state[i] : state[i];
}

/// goal: [2] [m]; side: -1 if left and right are exchanged, else 1; features: [2].
void FeatureMap::WriteGoal(const float* goal, float side, float* features) const {
  const float x = goal[0];
  const float y = side * goal[1];
  if (goal_transform_ == GoalTransform::kBounded) {
    const float scale = std::sqrt(x * x + y * y) + goal_scale_;
    features[0] = x / scale;
    features[1] = y / scale;
    return;
  }
  features[0] = x / goal_scale_ - 1.0f;
  features[1] = y / goal_scale_ - (goal_transform_ == GoalTransform::kCentred ? 0.0f : 1.0f);
}

void FeatureMap::PoolSectors(const std::uint16_t* ranges_cm, bool mirrored, float* features) const {
  constexpr int kBlock = 64;
  std::uint16_t minima[kBlock];
  const std::size_t last = table_.size() - 1;
  for (int begin = 0; begin < num_ranges_; begin += kBlock) {
    const int n = std::min(kBlock, num_ranges_ - begin);
    GroupMinima(ranges_cm + begin * beams_per_range_, beams_per_range_, n, minima);
    for (int i = 0; i < n; ++i) {
      const float value = table_[std::min<std::size_t>(minima[i], last)];
      features[mirrored ? num_ranges_ - 1 - begin - i : begin + i] = value;
    }
  }
}

void FeatureMap::Prefetch(const std::uint16_t* ranges_cm) const {
  const char* const begin = reinterpret_cast<const char*>(ranges_cm);
  const std::ptrdiff_t bytes = static_cast<std::ptrdiff_t>(num_beams_) * 2;
  // Into the second cache: far more requests can wait for memory there than at the first.
  for (std::ptrdiff_t at = 0; at < bytes; at += 64) {
    __builtin_prefetch(begin + at, /*rw=*/0, /*locality=*/1);
  }
}

void FeatureMap::PushFrames(const env::ObservationBatch& observations, int history,
                            float* stacks) const {
  const int frame = frame_size();
  const int size = history * frame;
  for (int i = 0; i < observations.batch_size; ++i) {
    float* const row = stacks + static_cast<std::ptrdiff_t>(i) * size;
    float* const newest = row + size - frame;
    std::copy(row + frame, row + size, row);
    const env::FrameView view = observations.frame(i);
    Write(view.ranges_cm.data(), view.state.data(), /*mirrored=*/false, newest);
    if (observations.first[i]) {
      for (float* older = row; older != newest; older += frame) {
        std::copy(newest, newest + frame, older);
      }
    }
  }
}

}  // namespace slalom::nn
