#include "replay/rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "base/check.h"

namespace slalom::replay {
namespace {

static_assert(std::endian::native == std::endian::little, "rows are sent little-endian");

/// Number of floats per row: state, action, reward, cost.
std::size_t FloatsOf(const env::StepShape& shape) {
  return static_cast<std::size_t>(shape.state_size) + static_cast<std::size_t>(shape.action_size) +
         2;
}

template <class T>
std::byte* Append(std::byte* out, const std::vector<T>& column) {
  if (!column.empty()) std::memcpy(out, column.data(), column.size() * sizeof(T));
  return out + column.size() * sizeof(T);
}

bool FlagsGoTogether(std::uint8_t flags) {
  return flags == kRowFinal || (flags & ~(kRowFirst | kRowTerminated)) == 0;
}

bool IsNothing(const RowView& row) {
  return std::ranges::all_of(row.action, [](float number) { return number == 0.0f; }) &&
         row.reward == 0.0f && row.cost == 0.0f;
}

}  // namespace

std::size_t FirstNotFinite(std::span<const float> values) {
  // First checks whether there is any, by the bits of the exponent, as that vectorises.
  constexpr std::uint32_t kExponent = 0x7f800000;
  std::uint32_t any = 0;
  for (const float value : values) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    any |= static_cast<std::uint32_t>((bits & kExponent) == kExponent);
  }
  if (any == 0) return values.size();
  return static_cast<std::size_t>(
      std::find_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v); }) -
      values.begin());
}

std::size_t RowBytes::Size(int num_rows, const env::StepShape& shape) {
  SLALOM_CHECK_GE(num_rows, 0);
  const std::size_t row = FloatsOf(shape) * sizeof(float) + sizeof(std::int32_t) +
                          static_cast<std::size_t>(shape.num_beams) * sizeof(std::uint16_t) + 1;
  return static_cast<std::size_t>(num_rows) * row;
}

void RowBytes::Write(const Chunk& chunk, std::span<std::byte> out) {
  SLALOM_CHECK_EQ(out.size(), Size(chunk.num_rows(), chunk.shape));
  std::byte* next = out.data();
  next = Append(next, chunk.state);
  next = Append(next, chunk.action);
  next = Append(next, chunk.reward);
  next = Append(next, chunk.cost);
  next = Append(next, chunk.stream);
  next = Append(next, chunk.ranges_cm);
  next = Append(next, chunk.flags);
  SLALOM_CHECK(next == out.data() + out.size());
}

base::Result<RowBytes> RowBytes::Parse(std::span<const std::byte> bytes, int num_rows,
                                       const env::StepShape& shape, int num_streams) {
  if (num_rows < 1 || num_streams < 1) {
    return base::Failure{fmt::format(
        "rows: found {} rows in {} streams, expected 1 or more of each", num_rows, num_streams)};
  }
  if (bytes.size() != Size(num_rows, shape)) {
    return base::Failure{
        fmt::format("rows: found {} bytes, expected {} for {} rows of {} beams, {} numbers of a "
                    "state and {} of an action",
                    bytes.size(), Size(num_rows, shape), num_rows, shape.num_beams,
                    shape.state_size, shape.action_size)};
  }
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(float) != 0) {
    return base::Failure{"rows: they do not start on a multiple of 4 bytes"};
  }
  const RowBytes rows(bytes, num_rows, shape, num_streams);
  const std::span<const float> numbers(rows.numbers(),
                                       static_cast<std::size_t>(num_rows) * FloatsOf(shape));
  if (const std::size_t bad = FirstNotFinite(numbers); bad < numbers.size()) {
    return base::Failure{fmt::format("rows: number {} of {} is not finite", bad, numbers.size())};
  }
  // Sums over windows of larger ones would not be finite.
  const auto large =
      std::ranges::find_if(numbers, [](float value) { return std::abs(value) > kMaxNumber; });
  if (large != numbers.end()) {
    return base::Failure{fmt::format("rows: number {} of {} is {}, expected {} at most",
                                     large - numbers.begin(), numbers.size(), *large, kMaxNumber)};
  }
  for (int r = 0; r < num_rows; ++r) {
    if (!FlagsGoTogether(rows.flags(r))) {
      return base::Failure{fmt::format("rows: row {} has flags {:#x}, which contradict each other",
                                       r, rows.flags(r))};
    }
    if (rows.stream(r) < 0 || rows.stream(r) >= num_streams) {
      return base::Failure{fmt::format("rows: row {} is of stream {}, expected one of {}", r,
                                       rows.stream(r), num_streams)};
    }
    if ((rows.flags(r) & kRowFinal) && !IsNothing(rows.row(r))) {
      return base::Failure{
          fmt::format("rows: row {} is final, but has an action, a reward or a cost", r)};
    }
  }
  return rows;
}

int RowBytes::num_steps() const {
  return num_rows_ - static_cast<int>(std::count(all_flags(), all_flags() + num_rows_, kRowFinal));
}

const std::int32_t* RowBytes::streams() const {
  return reinterpret_cast<const std::int32_t*>(numbers() + num_rows_ * FloatsOf(shape_));
}

const std::uint8_t* RowBytes::all_flags() const {
  return reinterpret_cast<const std::uint8_t*>(bytes_.data() + bytes_.size() - num_rows_);
}

RowView RowBytes::row(int r) const {
  const auto i = static_cast<std::size_t>(r);
  const auto rows = static_cast<std::size_t>(num_rows_);
  const auto n = static_cast<std::size_t>(shape_.num_beams);
  const auto s = static_cast<std::size_t>(shape_.state_size);
  const auto a = static_cast<std::size_t>(shape_.action_size);
  const float* const state = numbers();
  const float* const action = state + rows * s;
  const float* const reward = action + rows * a;
  const float* const cost = reward + rows;
  const auto* const ranges = reinterpret_cast<const std::uint16_t*>(streams() + rows);
  return {streams()[i],
          all_flags()[i],
          {std::span(ranges + i * n, n), std::span(state + i * s, s)},
          std::span(action + i * a, a),
          reward[i],
          cost[i]};
}

}  // namespace slalom::replay
