#include "proto/bounds.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <type_traits>
#include <vector>

#include "base/name.h"

namespace slalom::proto {
namespace {

bool IsPrintable(char c) { return c >= ' ' && c <= '~'; }

/// Visits the fields of a message and finds the first that is out of bounds.
class FaultFinder {
 public:
  explicit FaultFinder(Way way) : way_(way) {}

  template <class T, class Access, class Bound>
  void operator()(int, std::string_view field, const T& value, const Access&, const Bound& bound,
                  std::string_view) {
    if constexpr (HasFields<T>) {
      Look(value);
    } else {
      Check(field, value, bound);
    }
  }

  /// Checks each field of a message, and then the relations between them.
  template <class Message>
  void Look(const Message& m) {
    Message::Visit(m, *this);
    CheckRelations(m);
  }

  std::string Take() { return std::move(fault_); }

 private:
  template <class T>
  void Check(std::string_view, const T&, const Any&) {}
  template <class T>
  void Check(std::string_view, const T&, const Related&) {}
  template <class T>
  void Check(std::string_view field, T value, const In& bound) {
    Within(field, value, bound.low, bound.high);
  }
  template <class T>
  void Check(std::string_view field, T value, const AtLeast& bound) {
    if constexpr (std::is_enum_v<T>) {
      Check(field, static_cast<std::underlying_type_t<T>>(value), bound);
    } else {
      Within(field, value, static_cast<T>(bound.low), std::numeric_limits<T>::max());
    }
  }
  void Check(std::string_view field, double value, const Finite&) {
    if (fault_.empty() && !std::isfinite(value)) fault_ = fmt::format("{} is not finite", field);
  }
  void Check(std::string_view field, std::string_view value, const Name&) {
    if (!fault_.empty() || base::IsName(value)) return;
    fault_ = fmt::format("{} is '{}', expected 1 to {} letters, digits, '-_.:@'", field,
                         FitText(value.substr(0, base::kMaxNameBytes)), base::kMaxNameBytes);
  }
  void Check(std::string_view field, std::string_view value, const Text&) {
    if (!fault_.empty() || way_ == Way::kToBeSent) return;
    if (value.size() > kMaxTextBytes || !std::ranges::all_of(value, IsPrintable)) {
      fault_ = fmt::format("{} is not a text of at most {} printable ASCII characters", field,
                           kMaxTextBytes);
    }
  }
  template <class T>
  void Check(std::string_view field, const std::vector<T>& list, const AtMost& bound) {
    if (way_ == Way::kReceived) AtMostEntries(field, list.size(), bound);
    for (const T& entry : list) Look(entry);
  }
  template <class T>
  void Check(std::string_view field, const std::map<std::string, T>& map, const AtMost& bound) {
    AtMostEntries(field, map.size(), bound);
    const std::string_view one = field.substr(0, field.size() - 1);  // Without the plural's s.
    for (const auto& [key, value] : map) {
      Check(fmt::format("the key of a {}", one), key, Name{});
      if constexpr (std::is_same_v<T, std::string>) Check(fmt::format("a {}", one), value, Text{});
    }
  }

  void AtMostEntries(std::string_view field, std::size_t size, const AtMost& bound) {
    Within(fmt::format("the number of {}", field), size, std::size_t{0}, bound.size);
  }

  template <class T, class Low, class High>
  void Within(std::string_view field, T value, Low low, High high) {
    if (!fault_.empty()) return;
    const bool is_within = value >= low && value <= high;  // NaN is not.
    if (!is_within) fault_ = fmt::format("{} is {}, expected {} to {}", field, value, low, high);
  }

  template <class Message>
  void CheckRelations(const Message&) {}
  void CheckRelations(const Insert& m) {
    Within("num_steps", m.num_steps, 0, m.num_rows);
    Within("oldest_version", m.oldest_version, -1, m.newest_version);
  }
  void CheckRelations(const SampleRequest& m) { CheckFrames(m.batch, m.history); }
  void CheckRelations(const SampleReply& m) { CheckFrames(m.batch, m.history); }
  void CheckFrames(int batch, int history) {
    Within("batch times history", std::int64_t{batch} * history, 1, kMaxFrames);
  }

  const Way way_;
  std::string fault_;
};

/// Walks over the fields of one protobuf message. Stops at the first that is malformed.
class FieldWalk {
 public:
  explicit FieldWalk(std::span<const std::byte> bytes) : rest_(bytes) {}

  /// Moves to the next field that holds bytes (a string or message). Returns false at the end.
  bool NextWithBytes() {
    std::uint64_t tag = 0;
    std::uint64_t value = 0;
    while (Varint(&tag)) {
      number_ = tag >> 3;
      switch (tag & 7) {
        case 0:
          if (!Varint(&value)) return false;
          break;
        case 1:
          if (!Skip(8)) return false;
          break;
        case 2:
          if (!Varint(&value) || value > rest_.size()) return false;
          bytes_ = rest_.first(value);
          return Skip(value);
        case 3:  // Groups: their fields are counted with those around them, which is only stricter.
        case 4:
          break;
        case 5:
          if (!Skip(4)) return false;
          break;
        default:
          return false;
      }
    }
    return false;
  }

  std::uint64_t number() const { return number_; }
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  bool Varint(std::uint64_t* value) {
    *value = 0;
    for (int i = 0; i < 10 && static_cast<std::size_t>(i) < rest_.size(); ++i) {
      const auto byte = static_cast<std::uint64_t>(rest_[i]);
      *value |= (byte & 0x7f) << (7 * i);
      if (byte < 0x80) return Skip(static_cast<std::size_t>(i) + 1);
    }
    return false;
  }
  bool Skip(std::size_t size) {
    if (size > rest_.size()) return false;
    rest_ = rest_.subspan(size);
    return true;
  }

  std::span<const std::byte> rest_;
  std::uint64_t number_ = 0;
  std::span<const std::byte> bytes_;
};

// Field numbers of slalom.proto.
constexpr std::uint64_t kHelloRun = 8;
constexpr std::uint64_t kReportFigures = 3;
constexpr std::uint64_t kReportFacts = 4;
constexpr std::uint64_t kStatusRoles = 1;
constexpr std::uint64_t kRoleReport = 1;

}  // namespace

std::string FitText(std::string_view text) {
  std::string fitting(text.substr(0, kMaxTextBytes));
  std::ranges::replace_if(
      fitting, [](char c) { return !IsPrintable(c); }, '?');
  return fitting;
}

std::string FindFault(const Header& header, Way way) {
  FaultFinder finder(way);
  std::visit([&](const auto& message) { finder.Look(message); }, header);
  return finder.Take();
}

bool HelloListsFit(std::span<const std::byte> protobuf) {
  int keys = 0;
  for (FieldWalk walk(protobuf); walk.NextWithBytes();) {
    if (walk.number() == kHelloRun && ++keys > kMaxFigures) return false;
  }
  return true;
}

bool ReportListsFit(std::span<const std::byte> protobuf) {
  int figures = 0;
  int facts = 0;
  for (FieldWalk walk(protobuf); walk.NextWithBytes();) {
    if (walk.number() == kReportFigures && ++figures > kMaxFigures) return false;
    if (walk.number() == kReportFacts && ++facts > kMaxFigures) return false;
  }
  return true;
}

bool StatusListsFit(std::span<const std::byte> protobuf) {
  int roles = 0;
  for (FieldWalk walk(protobuf); walk.NextWithBytes();) {
    if (walk.number() != kStatusRoles) continue;
    if (++roles > kMaxRoles) return false;
    int reports = 0;
    for (FieldWalk role(walk.bytes()); role.NextWithBytes();) {
      if (role.number() != kRoleReport) continue;
      if (++reports > 1 || !ReportListsFit(role.bytes())) return false;
    }
  }
  return true;
}

}  // namespace slalom::proto
