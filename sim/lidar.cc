#include "sim/lidar.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "base/check.h"
#include "sim/cast_shapes.h"
#include "sim/vector_lanes.h"

namespace slalom::sim {
namespace {

constexpr int kNoiseBits = 12;
constexpr int kNoiseLevels = 1 << kNoiseBits;
constexpr int kPaddedBeams = LidarConfig::kMaxBeams + kBeamPadding;

using Shorts = std::uint16_t __attribute__((vector_size(2 * kLanes)));

/// How a range is reported.
struct Reporting {
  float low, high;        // [m]
  float steps_per_metre;  // Steps of the resolution.
  float centimetres_per_step;
};

SLALOM_ALWAYS_INLINE Ints Quantised(const Reporting& reporting, Floats ranges) {
  const Floats limited = Min(Max(ranges, Fill(reporting.low)), Fill(reporting.high));
  const Floats steps = ToFloats(ToInts(limited * reporting.steps_per_metre + 0.5f));
  return ToInts(steps * reporting.centimetres_per_step + 0.5f);
}

// `ranges`: [num_beams + kBeamPadding] [m]; `ranges_cm`: [num_beams] [cm].
SLALOM_VECTOR_CLONES
void Quantise(const Reporting& reporting, const float* ranges, int num_beams,
              std::uint16_t* ranges_cm) {
  int i = 0;
  for (; i + kLanes <= num_beams; i += kLanes) {
    const Shorts cm = __builtin_convertvector(Quantised(reporting, Load(ranges + i)), Shorts);
    std::memcpy(ranges_cm + i, &cm, sizeof cm);
  }
  const Ints cm = Quantised(reporting, Load(ranges + i));
  for (int k = 0; i + k < num_beams; ++k) ranges_cm[i + k] = static_cast<std::uint16_t>(cm[k]);
}

/// The quantiles of the normal distribution in the middle of kNoiseLevels equal parts.
const std::vector<double>& UnitQuantiles() {
  static const std::vector<double> quantiles = [] {
    std::vector<double> list(kNoiseLevels);
    for (int level = 0; level < kNoiseLevels; ++level) {
      list[level] = base::NormalQuantile((level + 0.5) / kNoiseLevels);
    }
    return list;
  }();
  return quantiles;
}

/// Those of a normal distribution with standard deviation `std`.
void ScaleQuantiles(double std, std::vector<float>& scaled) {
  const std::vector<double>& quantiles = UnitQuantiles();
  scaled.resize(kNoiseLevels);
  for (int level = 0; level < kNoiseLevels; ++level) {
    scaled[level] = static_cast<float>(std * quantiles[level]);
  }
}

}  // namespace

Lidar::Lidar(const LidarConfig& config, double clip) { Configure(config, clip); }

void Lidar::Configure(const LidarConfig& config, double clip) {
  SLALOM_CHECK_GE(config.num_beams, 2);
  SLALOM_CHECK_LE(config.num_beams, LidarConfig::kMaxBeams);
  const bool is_new = beam_cos_.empty();
  const bool has_new_beams = is_new || config.num_beams != config_.num_beams ||
                             config.field_of_view != config_.field_of_view;
  const bool has_new_noise = is_new || config.noise_std != config_.noise_std;
  const bool has_new_relative_noise = is_new || config.noise_per_metre != config_.noise_per_metre;
  config_ = config;
  clip_ = std::min(clip, config.max_range);
  first_angle_ = -0.5 * config.field_of_view;
  angle_step_ = config.field_of_view / (config.num_beams - 1);
  // No noise level is beyond 4 standard deviations.
  reach_ = std::min(config.max_range, (clip + 4.0 * config.noise_std + config.resolution) /
                                          (1.0 - 4.0 * config.noise_per_metre));
  if (has_new_beams) {
    beam_cos_.assign(config.num_beams + kBeamPadding, 0.0f);
    beam_sin_.assign(config.num_beams + kBeamPadding, 0.0f);
    for (int i = 0; i < config.num_beams; ++i) {
      const auto [s, c] = base::SinCos(beam_angle(i));
      beam_cos_[i] = static_cast<float>(c);
      beam_sin_[i] = static_cast<float>(s);
    }
  }
  if (has_new_noise) ScaleQuantiles(config.noise_std, noise_quantiles_);
  if (has_new_relative_noise) ScaleQuantiles(config.noise_per_metre, relative_quantiles_);
}

double LongestEcho(const LidarConfig& config) {
  constexpr double kMostNoise = 3.7;  // Standard deviations (docs/simulator.md).
  const double noise = config.noise_std + config.noise_per_metre * config.max_range;
  return config.max_range - kMostNoise * noise - config.resolution;
}

env::ScanGeometry ScanGeometryOf(const EnvironmentConfig& environment) {
  const LidarConfig& lidar = environment.lidar;
  return {lidar.num_beams,
          lidar.field_of_view,
          {lidar.offset_x, lidar.offset_y},
          std::min(environment.observation.range_clip, LongestEcho(lidar))};
}

void Lidar::Scan(const CollisionMap& map, const base::Pose2& X_WR, base::Random& noise,
                 std::span<std::uint16_t> ranges_cm, const MovingShapes* moving) const {
  SLALOM_CHECK_EQ(ranges_cm.size(), static_cast<std::size_t>(config_.num_beams));
  alignas(64) std::array<float, kPaddedBeams> ranges;
  CastPadded(map, moving, X_WR, ranges.data());
  if (config_.noise_std > 0.0 || config_.noise_per_metre > 0.0) AddNoise(noise, ranges.data());
  if (config_.dropout_probability > 0.0) DropBeams(noise, ranges.data());
  const Reporting reporting{.low = static_cast<float>(config_.min_range),
                            .high = static_cast<float>(clip_),
                            .steps_per_metre = static_cast<float>(1.0 / config_.resolution),
                            .centimetres_per_step = static_cast<float>(100.0 * config_.resolution)};
  Quantise(reporting, ranges.data(), config_.num_beams, ranges_cm.data());
}

void Lidar::Cast(const CollisionMap& map, const base::Pose2& X_WR, std::span<float> ranges,
                 const MovingShapes* moving) const {
  SLALOM_CHECK_EQ(ranges.size(), static_cast<std::size_t>(config_.num_beams));
  std::array<float, kPaddedBeams> padded;
  CastPadded(map, moving, X_WR, padded.data());
  std::copy_n(padded.begin(), config_.num_beams, ranges.begin());
}

// `ranges`: [num_beams + kBeamPadding]; the last kBeamPadding are scratch.
void Lidar::CastPadded(const CollisionMap& map, const MovingShapes* moving, const base::Pose2& X_WR,
                       float* ranges) const {
  const base::Vec2 p_WS = base::Transform(X_WR, {config_.offset_x, config_.offset_y});
  const auto [sin_yaw, cos_yaw] = base::SinCos(X_WR.yaw);
  const Sensor sensor{.x = static_cast<float>(p_WS.x),
                      .y = static_cast<float>(p_WS.y),
                      .cos_yaw = static_cast<float>(cos_yaw),
                      .sin_yaw = static_cast<float>(sin_yaw),
                      .reach = static_cast<float>(reach_),
                      .first_angle = static_cast<float>(first_angle_),
                      .beams_per_radian = static_cast<float>(1.0 / angle_step_),
                      .num_beams = config_.num_beams,
                      .beam_cos = beam_cos_.data(),
                      .beam_sin = beam_sin_.data()};
  std::fill_n(ranges, config_.num_beams + kBeamPadding, static_cast<float>(config_.max_range));
  CollisionMap::Runs runs;
  map.FindCircles(sensor.x, sensor.y, sensor.reach, runs);
  CastCircles({map.x(), map.y(), map.radius()}, runs.span(), sensor, ranges);
  CastBoxes(map.boxes(), sensor, ranges);
  if (moving == nullptr) return;
  const CollisionMap::Run all{0, moving->num_circles};
  CastCircles({moving->x.data(), moving->y.data(), moving->radius.data()}, {&all, 1}, sensor,
              ranges);
  CastBoxes(moving->boxes, sensor, ranges);
}

// Five beams from each 64-bit word: the quantile of one of kNoiseLevels equal parts of probability.
// `ranges`: [num_beams + kBeamPadding], as the last word may serve beams after the last.
void Lidar::AddNoise(base::Random& noise, float* ranges) const {
  constexpr int kBeamsPerWord = 64 / kNoiseBits;
  static_assert(kBeamsPerWord <= kBeamPadding);
  const auto add = [&](auto noise_of) {
    base::Random random = noise;  // A copy can stay in registers.
    for (int i = 0; i < config_.num_beams; i += kBeamsPerWord) {
      const std::uint64_t word = random.NextU64();
      for (int k = 0; k < kBeamsPerWord; ++k) {
        ranges[i + k] += noise_of((word >> (k * kNoiseBits)) & (kNoiseLevels - 1), ranges[i + k]);
      }
    }
    noise = random;
  };
  const float* const absolute = noise_quantiles_.data();
  const float* const relative = relative_quantiles_.data();
  if (config_.noise_per_metre > 0.0) {
    add([=](std::uint64_t level, float range) {
      return absolute[level] + relative[level] * range;
    });
  } else {
    add([=](std::uint64_t level, float) { return absolute[level]; });
  }
}

// Four beams from each 64-bit word, each lost with a probability in 1 / 65536.
void Lidar::DropBeams(base::Random& noise, float* ranges) const {
  constexpr int kBits = 16, kBeamsPerWord = 64 / kBits;
  const auto lost = static_cast<std::uint64_t>(
      std::lround(config_.dropout_probability * static_cast<double>(1 << kBits)));
  for (int i = 0; i < config_.num_beams; i += kBeamsPerWord) {
    std::uint64_t word = noise.NextU64();
    const int end = std::min(i + kBeamsPerWord, config_.num_beams);
    for (int k = i; k < end; ++k) {
      if ((word & ((1u << kBits) - 1)) < lost) ranges[k] = static_cast<float>(config_.max_range);
      word >>= kBits;
    }
  }
}

}  // namespace slalom::sim
