#include "sim/cast_shapes.h"

#include <algorithm>
#include <cmath>

#include "base/geometry.h"
#include "sim/vector_lanes.h"

namespace slalom::sim {
namespace {

static_assert(kBeamPadding == 2 * kLanes);

/// Angle of (x, y), within 2e-5 rad.
SLALOM_ALWAYS_INLINE Floats Atan2(Floats y, Floats x) {
  const Floats zero{};
  const Floats ax = Abs(x), ay = Abs(y);
  const Floats a = Min(ax, ay) / Max(Max(ax, ay), Fill(1e-30f));
  const Floats z = a * a;
  Floats angle =
      a * (0.9998660f + z * (-0.3302995f + z * (0.1801410f + z * (-0.0851330f + z * 0.0208351f))));
  angle = ay > ax ? 1.57079633f - angle : angle;
  angle = x < zero ? 3.14159265f - angle : angle;
  return y < zero ? -angle : angle;
}

/// A circle in S and the beams [first, last] that may hit it.
struct SensedCircle {
  float x, y, radius;  // [m]
  int first, last;
};

// Shortens the range of beams [i, i + kLanes) to a circle that the sensor is outside of and that
// none of these beams has behind it. The square root of a beam that misses is no number, and the
// smaller of no number and the old range is the old range.
SLALOM_ALWAYS_INLINE void ShortenToCircle(const Sensor& sensor, const SensedCircle& circle, int i,
                                          float* ranges) {
  const Floats c = Load(sensor.beam_cos + i), s = Load(sensor.beam_sin + i);
  const Floats along = circle.x * c + circle.y * s;
  const Floats across = circle.y * c - circle.x * s;
  const Floats half_chord = Sqrt(circle.radius * circle.radius - across * across);
  Store(ranges + i, Min(along - half_chord, Load(ranges + i)));
}

// Vectors of beams begin at multiples of their size: a processor that loads what it has just stored
// need not wait for the memory if it does so in the same pieces, and circles side by side share
// beams. Most circles fill up to two vectors. As many are always done, which costs less than to
// guess the number wrongly. Beams before the first and after the last miss.
SLALOM_ALWAYS_INLINE void CastCircle(const Sensor& sensor, const SensedCircle& circle,
                                     float* ranges) {
  const int begin = circle.first & ~(kLanes - 1);
  ShortenToCircle(sensor, circle, begin, ranges);
  ShortenToCircle(sensor, circle, begin + kLanes, ranges);
  for (int i = begin + 2 * kLanes; i <= circle.last; i += kLanes) {
    ShortenToCircle(sensor, circle, i, ranges);
  }
}

// The same for any circle, also around the sensor.
SLALOM_ALWAYS_INLINE void CastAnyCircle(const Sensor& sensor, const SensedCircle& circle,
                                        float* ranges) {
  const Floats zero{};
  for (int i = circle.first; i <= circle.last; i += kLanes) {
    const Floats c = Load(sensor.beam_cos + i), s = Load(sensor.beam_sin + i);
    const Floats along = circle.x * c + circle.y * s;
    const Floats across = circle.y * c - circle.x * s;
    const Floats half_chord_squared = circle.radius * circle.radius - across * across;
    const Floats half_chord = Sqrt(Max(half_chord_squared, zero));
    const Floats old = Load(ranges + i);
    const Ints hit = (half_chord_squared >= zero) & (along + half_chord >= zero);
    Store(ranges + i, hit ? Min(Max(along - half_chord, zero), old) : old);
  }
}

/// Circles in S, side by side, and which of them to cast. They are first all made, then cast: a
/// processor can make several groups at once, but not beyond a branch that it guesses wrongly.
struct SensedCircles {
  static constexpr int kRoom = 16 * kLanes;

  alignas(32) float x[kRoom], y[kRoom], radius[kRoom];
  alignas(32) int first[kRoom], last[kRoom];
  int listed[kRoom];
  int size = 0, num_listed = 0;
};

SLALOM_ALWAYS_INLINE void CastListed(const Sensor& sensor, SensedCircles& circles, float* ranges) {
  for (int n = 0; n < circles.num_listed; ++n) {
    const int k = circles.listed[n];
    CastCircle(sensor,
               {circles.x[k], circles.y[k], circles.radius[k], circles.first[k], circles.last[k]},
               ranges);
  }
  circles.size = circles.num_listed = 0;
}

/// A box seen from the sensor, and the beams that may hit it.
struct SensedBox {
  float x, y;              // Sensor in B, [m].
  float cos_yaw, sin_yaw;  // Heading of S in B.
  float half_x, half_y;    // [m]
};

// Slab test of beams [first, last] in the box's frame.
SLALOM_VECTOR_CLONES
void CastBox(const Sensor& sensor, const SensedBox& box, int first, int last, float* ranges) {
  const Floats zero{};
  const Floats tiny = Fill(1e-12f);
  for (int i = first; i <= last; i += kLanes) {
    const Floats c = Load(sensor.beam_cos + i);
    const Floats s = Load(sensor.beam_sin + i);
    Floats dx = box.cos_yaw * c - box.sin_yaw * s;
    Floats dy = box.sin_yaw * c + box.cos_yaw * s;
    // A beam along a side is turned a little, so that it crosses its slab at two finite points.
    dx = Abs(dx) < tiny ? tiny : dx;
    dy = Abs(dy) < tiny ? tiny : dy;
    const Floats x_low = (-box.half_x - box.x) / dx, x_high = (box.half_x - box.x) / dx;
    const Floats y_low = (-box.half_y - box.y) / dy, y_high = (box.half_y - box.y) / dy;
    const Floats enter = Max(Min(x_low, x_high), Min(y_low, y_high));
    const Floats leave = Min(Max(x_low, x_high), Max(y_low, y_high));
    const Floats range = Max(enter, zero);
    const Floats old = Load(ranges + i);
    const Ints hit = (enter <= leave) & (leave >= zero);
    Store(ranges + i, hit ? Min(range, old) : old);
  }
}

// Angles of the outermost corners of a box seen from outside, in S, around its nearest point,
// [rad].
struct AngularSpan {
  float low, high;
};

SLALOM_VECTOR_CLONES
AngularSpan SpanOfBox(const SensedBox& box) {
  const float near_x = std::clamp(box.x, -box.half_x, box.half_x) - box.x;
  const float near_y = std::clamp(box.y, -box.half_y, box.half_y) - box.y;
  const float left = -box.half_x - box.x, right = box.half_x - box.x;
  const float low = -box.half_y - box.y, high = box.half_y - box.y;
  // From the sensor in B: the nearest point, four corners.
  const Floats x{near_x, left, left, right, right, near_x, near_x, near_x};
  const Floats y{near_y, low, high, low, high, near_y, near_y, near_y};
  const Floats angles = Atan2(box.cos_yaw * y - box.sin_yaw * x, box.cos_yaw * x + box.sin_yaw * y);
  constexpr float kHalfTurn = 3.1415927f;
  AngularSpan span{angles[0], angles[0]};
  for (int corner = 1; corner <= 4; ++corner) {
    float angle = angles[corner];  // Within a quarter turn of the nearest point's.
    if (angle > angles[0] + kHalfTurn) angle -= 2.0f * kHalfTurn;
    if (angle < angles[0] - kHalfTurn) angle += 2.0f * kHalfTurn;
    span = {std::min(span.low, angle), std::max(span.high, angle)};
  }
  return span;
}

}  // namespace

SLALOM_VECTOR_CLONES
void CastCircles(const Circles& circles, std::span<const CollisionMap::Run> runs,
                 const Sensor& sensor, float* ranges) {
  // A margin for rounding and the error of Atan2, in beams.
  const float pad = 1e-3f * sensor.beams_per_radian;
  const float turn = 6.28318531f * sensor.beams_per_radian;
  const float last_beam = static_cast<float>(sensor.num_beams - 1);
  // With so few beams those beside a circle's may have it behind them.
  const float near = sensor.beams_per_radian > 2.0f * kLanes ? 0.5f : 0.0f;
  SensedCircles sensed;
  for (const CollisionMap::Run& run : runs) {
    for (int i = run.begin; i < run.end; i += kLanes) {
      const Floats dx = Load(circles.x + i) - sensor.x;
      const Floats dy = Load(circles.y + i) - sensor.y;
      const Floats radius = Load(circles.radius + i);
      const Floats x = sensor.cos_yaw * dx + sensor.sin_yaw * dy;
      const Floats y = sensor.cos_yaw * dy - sensor.sin_yaw * dx;
      const Floats squared = x * x + y * y;
      const Floats far = radius + sensor.reach;
      // An upper bound of half the angle that it fills, asin(sine).
      const Floats sine = radius / Sqrt(Max(squared, Fill(1e-12f)));
      const Floats wide =
          sine < Fill(0.5f) ? sine * (1.0f + 0.19f * (sine * sine)) : Fill(1.5707964f);
      const Floats half =
          (sine < Fill(1.0f) ? wide : Fill(3.1415927f)) * sensor.beams_per_radian + pad;
      const Floats middle = (Atan2(y, x) - sensor.first_angle) * sensor.beams_per_radian;
      const Floats low = middle - half, high = middle + half;
      const Ints in_reach = squared < far * far;
      const Ints seen = in_reach & (high >= Floats{}) & (low <= Fill(last_beam));
      // If the span crosses the backward direction, its other end is a full turn away. A circle
      // nearby may fill half of all directions, or all.
      const Ints special = in_reach & ((low + turn <= Fill(last_beam)) | (high - turn >= Floats{}) |
                                       (sine >= Fill(near)));
      const int slot = sensed.size;
      Store(sensed.x + slot, x);
      Store(sensed.y + slot, y);
      Store(sensed.radius + slot, radius);
      Store(sensed.first + slot, ToInts(Max(low, Floats{})));
      Store(sensed.last + slot, ToInts(Min(high, Fill(last_beam))));
      alignas(32) int seen_flags[kLanes], special_flags[kLanes];
      Store(seen_flags, seen & ~special);
      Store(special_flags, special);
      int any_special = 0;
      for (int k = 0; k < kLanes; ++k) {
        sensed.listed[sensed.num_listed] = slot + k;
        sensed.num_listed -= seen_flags[k];
        any_special |= special_flags[k];
      }
      if (any_special) [[unlikely]] {
        alignas(32) float lows[kLanes], highs[kLanes];
        Store(lows, low);
        Store(highs, high);
        for (int k = 0; k < kLanes; ++k) {
          if (!special_flags[k]) continue;
          for (const float shift : {-turn, 0.0f, turn}) {
            const float first = std::max(lows[k] + shift, 0.0f);
            const float last = std::min(highs[k] + shift, last_beam);
            if (first > last) continue;
            CastAnyCircle(sensor,
                          {sensed.x[slot + k], sensed.y[slot + k], sensed.radius[slot + k],
                           static_cast<int>(first), static_cast<int>(last)},
                          ranges);
          }
        }
      }
      sensed.size += kLanes;
      if (sensed.size == SensedCircles::kRoom) CastListed(sensor, sensed, ranges);
    }
  }
  CastListed(sensor, sensed, ranges);
}

void CastBoxes(std::span<const PlacedBox> boxes, const Sensor& sensor, float* ranges) {
  for (const PlacedBox& box : boxes) {
    const float dx = sensor.x - box.x, dy = sensor.y - box.y;
    const SensedBox sensed{.x = box.cos_yaw * dx + box.sin_yaw * dy,
                           .y = box.cos_yaw * dy - box.sin_yaw * dx,
                           .cos_yaw = box.cos_yaw * sensor.cos_yaw + box.sin_yaw * sensor.sin_yaw,
                           .sin_yaw = box.cos_yaw * sensor.sin_yaw - box.sin_yaw * sensor.cos_yaw,
                           .half_x = box.half_x,
                           .half_y = box.half_y};
    const float beyond_x = std::max(std::abs(sensed.x) - box.half_x, 0.0f);
    const float beyond_y = std::max(std::abs(sensed.y) - box.half_y, 0.0f);
    if (beyond_x * beyond_x + beyond_y * beyond_y > sensor.reach * sensor.reach) continue;
    constexpr float kNear = 1e-3f;  // Nearer than this, directions are not reliable, [m].
    if (beyond_x < kNear && beyond_y < kNear) {
      CastBox(sensor, sensed, 0, sensor.num_beams - 1, ranges);
      continue;
    }
    constexpr double kPad = 1e-3;  // A margin for rounding and the error of Atan2, [rad].
    const AngularSpan span = SpanOfBox(sensed);
    for (const double shift : {-2.0 * base::kPi, 0.0, 2.0 * base::kPi}) {
      const double low = (span.low - kPad + shift - sensor.first_angle) * sensor.beams_per_radian;
      const double high = (span.high + kPad + shift - sensor.first_angle) * sensor.beams_per_radian;
      const double last_beam = sensor.num_beams - 1;
      if (high < 0.0 || low > last_beam) continue;
      CastBox(sensor, sensed, static_cast<int>(std::max(low, 0.0)),
              static_cast<int>(std::min(high, last_beam)), ranges);
    }
  }
}

}  // namespace slalom::sim
