#include "replay/sample_bytes.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/check.h"
#include "replay/batch.h"
#include "replay/rows.h"

namespace slalom::replay {
namespace {

static_assert(std::endian::native == std::endian::little, "samples are sent little-endian");

/// The layout of a sample.
struct Layout {
  std::size_t frames = 0;   // B H
  std::size_t numbers = 0;  // Offset of the float32 numbers.
  std::size_t scans = 0;    // Offset of the uint16 scans.
  std::size_t size = 0;     // End of the scans.
};

std::optional<Layout> LayoutOf(const SampleShape& shape) {
  SLALOM_CHECK(shape.batch >= 1 && shape.history >= 1);
  const auto batch = static_cast<std::uint64_t>(shape.batch);
  Layout layout;
  layout.frames = batch * static_cast<std::uint64_t>(shape.history);  // Below 2^62.
  std::uint64_t scan_bytes = 0;
  // Two stacks of frames, before and after the window, with room for the other columns.
  constexpr std::uint64_t kMost = std::uint64_t{1} << 62;
  const std::uint64_t frame_bytes = 2u * 2u * static_cast<std::uint64_t>(shape.step.num_beams);
  const auto state = static_cast<std::uint64_t>(shape.step.state_size);
  const auto others = static_cast<std::uint64_t>(shape.step.action_size) + (shape.weighted ? 4 : 3);
  if (__builtin_mul_overflow(layout.frames, frame_bytes, &scan_bytes) || scan_bytes > kMost ||
      layout.frames > kMost / 64 / (state + others)) {
    return std::nullopt;
  }
  layout.numbers = 2 * batch * sizeof(std::int64_t);
  const std::uint64_t floats = 2 * layout.frames * state + batch * others;
  layout.scans = layout.numbers + floats * sizeof(float);
  layout.size = layout.scans + scan_bytes;
  return layout;
}

/// Writes columns one after the other.
class ColumnWriter {
 public:
  explicit ColumnWriter(std::byte* out) : out_(out) {}
  template <class Column>
  void operator()(const Column& column) {
    const std::size_t bytes = column.size() * sizeof(column[0]);
    std::memcpy(out_, column.data(), bytes);
    out_ += bytes;
  }

 private:
  std::byte* out_;
};

/// Reads columns one after the other into buffers that already have their size.
class ColumnReader {
 public:
  explicit ColumnReader(const std::byte* in) : in_(in) {}
  template <class Column>
  void operator()(Column& column) {
    const std::size_t bytes = column.size() * sizeof(column[0]);
    std::memcpy(column.data(), in_, bytes);
    in_ += bytes;
  }

 private:
  const std::byte* in_;
};

/// The columns before the scans, in their order.
template <class Rows, class Visit>
void ForEachColumn(Rows& rows, bool weighted, Visit visit) {
  visit(rows.sequence);
  visit(rows.next_sequence);
  visit(rows.state);
  visit(rows.next_state);
  visit(rows.action);
  visit(rows.n_step_return);
  visit(rows.cost_return);
  visit(rows.discount);
  if (weighted) visit(rows.weight);
}

std::optional<base::Failure> CheckNumbers(const SampledRows& rows) {
  for (int b = 0; b < rows.batch; ++b) {
    if (rows.sequence[b] < 0 || rows.next_sequence[b] <= rows.sequence[b]) {
      return base::Failure{fmt::format(
          "sample {}: found rows {} and {}, expected the first and, after it, the last of a window",
          b, rows.sequence[b], rows.next_sequence[b])};
    }
    if (rows.discount[b] < 0.0f || rows.discount[b] > 1.0f) {
      return base::Failure{
          fmt::format("sample {}: discount is {}, expected 0 to 1", b, rows.discount[b])};
    }
    if (rows.weight[b] < 0.0f) {
      return base::Failure{
          fmt::format("sample {}: weight is {}, expected 0 or more", b, rows.weight[b])};
    }
  }
  return std::nullopt;
}

/// Reads the columns of a sample of `size` bytes. `layout`: of the shape.
std::optional<base::Failure> ParseColumns(std::span<const std::byte> bytes,
                                          const SampleShape& shape,
                                          const std::optional<Layout>& layout, std::size_t size,
                                          SampledRows* rows) {
  if (!layout || bytes.size() != size) {
    return base::Failure{fmt::format(
        "sample: found {} bytes, expected {} for a batch of {}, {} frames of {} beams and {} "
        "numbers each, actions of {} numbers{}",
        bytes.size(), size, shape.batch, shape.history, shape.step.num_beams, shape.step.state_size,
        shape.step.action_size, shape.weighted ? ", with weights" : "")};
  }
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(std::int64_t) != 0) {
    return base::Failure{"sample: it does not start on a multiple of 8 bytes"};
  }
  const std::span<const float> numbers(
      reinterpret_cast<const float*>(bytes.data() + layout->numbers),
      (layout->scans - layout->numbers) / sizeof(float));
  if (const std::size_t bad = FirstNotFinite(numbers); bad < numbers.size()) {
    return base::Failure{fmt::format("sample: number {} of {} is not finite", bad, numbers.size())};
  }
  rows->Resize(shape.batch, shape.history, shape.step);
  ForEachColumn(*rows, shape.weighted, ColumnReader(bytes.data()));
  if (!shape.weighted) std::fill_n(rows->weight.data(), rows->weight.size(), 1.0f);
  return std::nullopt;
}

}  // namespace

std::optional<std::size_t> SampleSize(const SampleShape& shape) {
  const std::optional<Layout> layout = LayoutOf(shape);
  if (!layout) return std::nullopt;
  return layout->size;
}

void WriteSample(const SampledRows& rows, bool weighted, std::span<std::byte> out) {
  const auto layout = LayoutOf({rows.batch, rows.history, rows.shape, weighted});
  SLALOM_CHECK(layout.has_value());
  SLALOM_CHECK_EQ(out.size(), layout->size);
  ForEachColumn(rows, weighted, ColumnWriter(out.data()));
  auto* const scans = reinterpret_cast<std::uint16_t*>(out.data() + layout->scans);
  const int n = rows.shape.num_beams;
  GatherScans(rows.ranges_cm, n, scans);
  GatherScans(rows.next_ranges_cm, n, scans + layout->frames * n);
}

std::optional<base::Failure> ParseSample(std::span<const std::byte> bytes, const SampleShape& shape,
                                         SampledRows* rows) {
  const std::optional<Layout> layout = LayoutOf(shape);
  if (auto failure = ParseColumns(bytes, shape, layout, layout ? layout->size : 0, rows)) {
    return failure;
  }
  const auto* const scans = reinterpret_cast<const std::uint16_t*>(bytes.data() + layout->scans);
  const auto n = static_cast<std::size_t>(shape.step.num_beams);
  for (std::size_t f = 0; f < layout->frames; ++f) {
    rows->ranges_cm[f] = scans + f * n;
    rows->next_ranges_cm[f] = scans + (layout->frames + f) * n;
  }
  return CheckNumbers(*rows);
}

std::size_t MirroredSampleSize(const SampleShape& shape, std::size_t num_scans) {
  const std::optional<Layout> layout = LayoutOf(shape);
  SLALOM_CHECK(layout.has_value());
  return layout->scans + 2 * layout->frames * sizeof(std::int32_t) +
         num_scans * static_cast<std::size_t>(shape.step.num_beams) * sizeof(std::uint16_t);
}

void WriteMirroredSample(const SampledRows& rows, bool weighted, const MirroredScans& scans,
                         std::span<std::byte> out) {
  const SampleShape shape{rows.batch, rows.history, rows.shape, weighted};
  SLALOM_CHECK_EQ(out.size(), MirroredSampleSize(shape, scans.to_send.size()));
  const Layout layout = *LayoutOf(shape);
  SLALOM_CHECK_EQ(scans.places.size(), 2 * layout.frames);
  ForEachColumn(rows, weighted, ColumnWriter(out.data()));
  ColumnWriter writer(out.data() + layout.scans);
  writer(scans.places);
  auto* const sent = out.data() + layout.scans + scans.places.size() * sizeof(std::int32_t);
  GatherScans(scans.to_send, rows.shape.num_beams, reinterpret_cast<std::uint16_t*>(sent));
}

std::optional<base::Failure> ParseMirroredSample(std::span<const std::byte> bytes,
                                                 const SampleShape& shape, std::size_t num_scans,
                                                 ScanMirror* mirror, SampledRows* rows) {
  const std::optional<Layout> layout = LayoutOf(shape);
  if (layout && num_scans > 2 * layout->frames) {
    return base::Failure{fmt::format("sample: found {} new scans, expected at most {}", num_scans,
                                     2 * layout->frames)};
  }
  if (auto failure = ParseColumns(bytes, shape, layout,
                                  layout ? MirroredSampleSize(shape, num_scans) : 0, rows)) {
    return failure;
  }
  const auto* const places = reinterpret_cast<const std::int32_t*>(bytes.data() + layout->scans);
  const auto* next = reinterpret_cast<const std::uint16_t*>(places + 2 * layout->frames);
  std::size_t num_new = 0;
  for (std::size_t f = 0; f < 2 * layout->frames; ++f) {
    const bool is_new = places[f] < 0;
    const std::int32_t place = is_new ? ~places[f] : places[f];
    num_new += is_new ? 1 : 0;
    if (place >= mirror->num_places() || num_new > num_scans) {
      return base::Failure{
          fmt::format("sample: frame {} has place {}, expected one of {}, and {} new scans", f,
                      places[f], mirror->num_places(), num_scans)};
    }
    if (is_new) {
      mirror->Add(place, next);
      next += shape.step.num_beams;
    }
    const std::uint16_t* const scan = mirror->Find(place);
    if (scan == nullptr) {
      return base::Failure{fmt::format("sample: frame {} is of a scan that did not come", f)};
    }
    (f < layout->frames ? rows->ranges_cm[f] : rows->next_ranges_cm[f - layout->frames]) = scan;
  }
  if (num_new != num_scans) {
    return base::Failure{
        fmt::format("sample: found {} new scans, expected {}", num_new, num_scans)};
  }
  return CheckNumbers(*rows);
}

std::size_t PrioritySize(int count) {
  SLALOM_CHECK_GE(count, 0);
  return static_cast<std::size_t>(count) * (sizeof(std::int64_t) + sizeof(float));
}

void WritePriorities(std::span<const std::int64_t> sequence, std::span<const float> priority,
                     std::span<std::byte> out) {
  SLALOM_CHECK_EQ(sequence.size(), priority.size());
  SLALOM_CHECK_EQ(out.size(), sequence.size_bytes() + priority.size_bytes());
  if (sequence.empty()) return;
  std::memcpy(out.data(), sequence.data(), sequence.size_bytes());
  std::memcpy(out.data() + sequence.size_bytes(), priority.data(), priority.size_bytes());
}

base::Result<PriorityView> ParsePriorities(std::span<const std::byte> bytes, int count) {
  if (count < 0 || bytes.size() != PrioritySize(count)) {
    return base::Failure{
        fmt::format("priorities: found {} bytes, expected 12 for each of {}", bytes.size(), count)};
  }
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(std::int64_t) != 0) {
    return base::Failure{"priorities: they do not start on a multiple of 8 bytes"};
  }
  const auto n = static_cast<std::size_t>(count);
  const auto* const sequences = reinterpret_cast<const std::int64_t*>(bytes.data());
  const PriorityView view{{sequences, n}, {reinterpret_cast<const float*>(sequences + n), n}};
  for (std::size_t i = 0; i < n; ++i) {
    if (view.sequence[i] < 0) {
      return base::Failure{
          fmt::format("priority {}: row {}, expected 0 or more", i, view.sequence[i])};
    }
    if (!(view.priority[i] >= 0.0f)) {
      return base::Failure{
          fmt::format("priority {}: found {}, expected 0 or more", i, view.priority[i])};
    }
  }
  if (const std::size_t bad = FirstNotFinite(view.priority); bad < n) {
    return base::Failure{fmt::format("priority {}: it is not finite", bad)};
  }
  return view;
}

}  // namespace slalom::replay
