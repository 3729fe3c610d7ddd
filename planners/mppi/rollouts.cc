#include "planners/mppi/rollouts.h"

#include <algorithm>
#include <iterator>

#include "base/check.h"
#include "base/vector_clones.h"

namespace slalom::planners {
namespace {

SLALOM_ALWAYS_INLINE float LimitChange(float wanted, float from, float largest_step) {
  const float low = from - largest_step, high = from + largest_step;
  const float raised = wanted < low ? low : wanted;
  return raised > high ? high : raised;
}

/// One step of all rollouts, from the last one's results; arrays are [B].
SLALOM_VECTOR_CLONES
void DriveStep(const float* control_linear, const float* control_angular, const float* last_linear,
               const float* last_angular, const float* last_x, const float* last_y,
               const float* last_cosine, const float* last_sine, const DriveLimits& limits,
               int batch_size, float* __restrict linear, float* __restrict angular,
               float* __restrict x, float* __restrict y, float* __restrict cosine,
               float* __restrict sine) {
  const DriveLimits l = limits;
  for (int b = 0; b < batch_size; ++b) {
    const float v = LimitChange(control_linear[b], last_linear[b], l.max_linear_step);
    const float w = LimitChange(control_angular[b], last_angular[b], l.max_angular_step);
    // Half the step's turn, by Taylor series; the error is below 1e-8 for |half| <= 0.5.
    const float half = 0.5f * w * l.dt, h2 = half * half;
    const float c = 1.0f - h2 * (0.5f - h2 * (1.0f / 24.0f - h2 * (1.0f / 720.0f)));
    const float s =
        half * (1.0f - h2 * (1.0f / 6.0f - h2 * (1.0f / 120.0f - h2 * (1.0f / 5040.0f))));
    const float chord_cosine = last_cosine[b] * c - last_sine[b] * s;
    const float chord_sine = last_sine[b] * c + last_cosine[b] * s;
    linear[b] = v;
    angular[b] = w;
    x[b] = last_x[b] + v * l.dt * chord_cosine;
    y[b] = last_y[b] + v * l.dt * chord_sine;
    cosine[b] = chord_cosine * c - chord_sine * s;
    sine[b] = chord_sine * c + chord_cosine * s;
  }
}

}  // namespace

Rollouts::Rollouts(int new_batch_size, int new_num_steps)
    : batch_size(new_batch_size), num_steps(new_num_steps) {
  SLALOM_CHECK_GE(batch_size, 1);
  SLALOM_CHECK_GE(num_steps, 1);
  for (std::vector<float>* values :
       {&control_linear, &control_angular, &linear, &angular, &x, &y, &cosine, &sine}) {
    values->assign(Index(num_steps, 0), 0.0f);
  }
  start_rows.assign(Index(6, 0), 0.0f);
}

void Drive(const RolloutStart& start, const DriveLimits& limits, Rollouts& rollouts) {
  Rollouts& r = rollouts;
  const auto size = static_cast<std::size_t>(r.batch_size);
  const float values[] = {start.linear, start.angular, 0.0f, 0.0f, start.cosine, start.sine};
  for (std::size_t i = 0; i < std::size(values); ++i) {
    std::fill_n(r.start_rows.begin() + static_cast<std::ptrdiff_t>(i * size), size, values[i]);
  }
  const float* last[] = {&r.start_rows[0],        &r.start_rows[size],     &r.start_rows[2 * size],
                         &r.start_rows[3 * size], &r.start_rows[4 * size], &r.start_rows[5 * size]};
  for (int t = 0; t < r.num_steps; ++t) {
    const std::size_t i = r.Index(t, 0);
    float* const now[] = {&r.linear[i], &r.angular[i], &r.x[i], &r.y[i], &r.cosine[i], &r.sine[i]};
    DriveStep(&r.control_linear[i], &r.control_angular[i], last[0], last[1], last[2], last[3],
              last[4], last[5], limits, r.batch_size, now[0], now[1], now[2], now[3], now[4],
              now[5]);
    std::copy(std::begin(now), std::end(now), std::begin(last));
  }
}

}  // namespace slalom::planners
