#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "base/check.h"
#include "base/file.h"
#include "replay/table.h"

namespace slalom::replay {
namespace {

static_assert(std::endian::native == std::endian::little, "the file is little-endian");

/// The header of the file; docs/replay.md specifies it byte by byte.
struct Head {
  char magic[8] = {'S', 'L', 'R', 'P', 'L', 'P', 'R', 'I'};
  std::uint32_t version = 1;
  std::uint32_t zero = 0;
  double alpha = 0.0;
  double largest = 0.0;
  std::int64_t first_row = 0;
  std::int64_t num_rows = 0;
};
static_assert(sizeof(Head) == 48);

constexpr std::size_t kChecksumBytes = sizeof(std::uint64_t);

}  // namespace

std::string Table::PrintPriorities() const {
  SLALOM_CHECK(priorities_.has_value());
  Head head;
  head.alpha = priorities_->alpha();
  head.largest = priorities_->largest();
  head.first_row = first_sequence();
  head.num_rows = num_rows();
  const auto num_rows = static_cast<std::size_t>(head.num_rows);
  std::string bytes(sizeof head + num_rows * sizeof(double) + kChecksumBytes, '\0');
  std::memcpy(bytes.data(), &head, sizeof head);
  char* out = bytes.data() + sizeof head;
  for (std::int64_t s = first_sequence(); s < total_; ++s, out += sizeof(double)) {
    const double weight = priorities_->weight(SlotIndex(s));
    std::memcpy(out, &weight, sizeof weight);
  }
  const std::uint64_t checksum =
      base::Checksum(std::string_view(bytes).substr(0, bytes.size() - kChecksumBytes));
  std::memcpy(out, &checksum, sizeof checksum);
  return bytes;
}

std::optional<base::Failure> Table::RestorePriorities(std::string_view bytes, double alpha) {
  SLALOM_CHECK(!priorities_.has_value());
  if (bytes.size() < sizeof(Head) + kChecksumBytes) return base::Failure{"it is cut short"};
  const std::string_view content = bytes.substr(0, bytes.size() - kChecksumBytes);
  std::uint64_t checksum = 0;
  std::memcpy(&checksum, bytes.data() + content.size(), sizeof checksum);
  if (checksum != base::Checksum(content)) return base::Failure{"its checksum is wrong"};
  Head head;
  std::memcpy(&head, bytes.data(), sizeof head);
  if (std::memcmp(head.magic, Head().magic, sizeof head.magic) != 0 ||
      head.version != Head().version) {
    return base::Failure{
        fmt::format("it is of version {}, expected {}", head.version, Head().version)};
  }
  if (head.alpha != alpha) {
    return base::Failure{
        fmt::format("it was made with priority exponent {}, expected {}", head.alpha, alpha)};
  }
  const std::size_t num_weights = (content.size() - sizeof head) / sizeof(double);
  std::vector<double> weights(num_weights);
  std::memcpy(weights.data(), bytes.data() + sizeof head, num_weights * sizeof(double));
  const auto is_weight = [](double w) { return w >= 0.0 && w <= Priorities::kLargest; };
  const bool sound = content.size() == sizeof head + num_weights * sizeof(double) &&
                     head.num_rows == static_cast<std::int64_t>(num_weights) &&
                     head.first_row >= 0 && head.largest >= 1.0 &&
                     head.largest <= Priorities::kLargest &&
                     std::ranges::all_of(weights, is_weight);
  if (!sound) return base::Failure{"its numbers are out of range"};

  priorities_.emplace(config_.capacity, alpha);
  priorities_->RaiseLargest(head.largest);
  for (std::int64_t s = first_sequence(); s < total_; ++s) {
    if (slot(s).flags & kRowFinal) continue;
    // The journal may hold more rows, or other rows in place of a tail that was truncated.
    const std::int64_t i = s - head.first_row;
    const double weight = i >= 0 && i < head.num_rows ? weights[static_cast<std::size_t>(i)] : 0.0;
    if (weight > 0.0) {
      priorities_->RestoreWeight(SlotIndex(s), weight);
    } else {
      priorities_->SetNew(SlotIndex(s));
    }
  }
  return std::nullopt;
}

}  // namespace slalom::replay
