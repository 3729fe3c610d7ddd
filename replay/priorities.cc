#include "replay/priorities.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::replay {
namespace {

// Number of draws whose paths are followed side by side.
constexpr std::size_t kDrawBlock = 64;

double SumOfEight(const double* x) {
  return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
}

}  // namespace

Priorities::Priorities(std::int64_t num_slots, double alpha) : alpha_(alpha) {
  SLALOM_CHECK_GE(num_slots, 1);
  SLALOM_CHECK(alpha >= 0.0 && alpha <= 1.0);
  auto size = static_cast<std::size_t>(num_slots);
  do {
    size = (size + kFanOut - 1) / kFanOut;
    levels_.emplace_back(size * kFanOut, 0.0);
  } while (size > 1);
}

void Priorities::Set(std::int64_t slot, double priority) {
  const double p = std::isnan(priority) ? kLargest : std::clamp(priority, kSmallest, kLargest);
  const double weight = std::pow(p, alpha_);
  if (p > largest_) {
    largest_ = p;
    new_weight_ = weight;
  }
  SetWeight(slot, weight);
}

void Priorities::RaiseLargest(double largest) {
  if (largest <= largest_) return;
  largest_ = largest;
  new_weight_ = std::pow(largest, alpha_);
}

void Priorities::SetWeight(std::int64_t slot, double weight) {
  auto i = static_cast<std::size_t>(slot);
  levels_[0][i] = weight;
  // Sums are recomputed from the children, never updated by differences, so errors do not add up.
  for (std::size_t level = 0; level + 1 < levels_.size(); ++level) {
    i /= kFanOut;
    levels_[level + 1][i] = SumOfEight(&levels_[level][i * kFanOut]);
  }
}

double Priorities::total() const { return SumOfEight(levels_.back().data()); }

void Priorities::Draw(base::Random& random, std::span<std::int64_t> slots) const {
  const double sum = total();
  SLALOM_CHECK_GT(sum, 0.0);
  std::array<double, kDrawBlock> rest;
  std::array<std::size_t, kDrawBlock> node;
  for (std::size_t begin = 0; begin < slots.size(); begin += kDrawBlock) {
    const std::size_t n = std::min(kDrawBlock, slots.size() - begin);
    for (std::size_t k = 0; k < n; ++k) {
      rest[k] = random.Uniform() * sum;
      node[k] = 0;
    }
    for (std::size_t level = levels_.size(); level-- > 0;) {
      const double* const values = levels_[level].data();
      for (std::size_t k = 0; k < n; ++k) {
        const double* const child = values + node[k] * kFanOut;
        double before = 0.0;  // Sum of the children before this one.
        double sum_to_here = 0.0;
        std::size_t chosen = 0;
        for (std::size_t c = 0; c < kFanOut - 1; ++c) {
          sum_to_here += child[c];
          const bool past = sum_to_here <= rest[k];
          before = past ? sum_to_here : before;
          chosen += past;
        }
        // Rounding may lead beyond the last child with a weight.
        while (chosen > 0 && child[chosen] == 0.0) --chosen;
        rest[k] -= before;
        node[k] = node[k] * kFanOut + chosen;
        if (level > 0) __builtin_prefetch(&levels_[level - 1][node[k] * kFanOut]);
      }
    }
    for (std::size_t k = 0; k < n; ++k) slots[begin + k] = static_cast<std::int64_t>(node[k]);
  }
}

}  // namespace slalom::replay
