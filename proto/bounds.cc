#include "proto/bounds.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/name.h"

namespace slalom::proto {
namespace {

constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();

bool IsPrintable(char c) { return c >= ' ' && c <= '~'; }

/// Finds the first field that is out of bounds. Each call checks one field.
class FaultFinder {
 public:
  explicit FaultFinder(Way way) : way_(way) {}

  template <class T>
  void In(const char* field, T value, T low, T high) {
    if (!fault_.empty() || (value >= low && value <= high)) return;  // NaN is not in any range.
    fault_ = fmt::format("{} is {}, expected {} to {}", field, value, low, high);
  }
  void NotNegative(const char* field, std::int64_t value) {
    In<std::int64_t>(field, value, 0, kMost);
  }
  void Finite(const char* field, double value) {
    if (fault_.empty() && !std::isfinite(value)) fault_ = fmt::format("{} is not finite", field);
  }
  void Name(const char* field, std::string_view value) {
    if (!fault_.empty() || base::IsName(value)) return;
    fault_ = fmt::format("{} is '{}', expected 1 to {} letters, digits, '-_.:@'", field,
                         FitText(value.substr(0, base::kMaxNameBytes)), base::kMaxNameBytes);
  }
  void Text(const char* field, std::string_view value) {
    if (!fault_.empty() || way_ == Way::kToBeSent) return;
    if (value.size() > kMaxTextBytes || !std::ranges::all_of(value, IsPrintable)) {
      fault_ = fmt::format("{} is not a text of at most {} printable ASCII characters", field,
                           kMaxTextBytes);
    }
  }

  Way way() const { return way_; }
  std::string Take() { return std::move(fault_); }

 private:
  const Way way_;
  std::string fault_;
};

void Look(const Hello& m, FaultFinder& f) {
  f.Name("role", m.role);
  f.Name("name", m.name);
  f.In("num_beams", m.num_beams, 0, kMaxBeams);
  f.In("num_streams", m.num_streams, 0, kMaxStreams);
  f.Text("software", m.software);
}

void Look(const Welcome& m, FaultFinder& f) {
  f.NotNegative("window_bytes", m.window_bytes);
  f.NotNegative("previous_accepted_steps", m.previous_accepted_steps);
  f.Text("software", m.software);
}

void Look(const Insert& m, FaultFinder& f) {
  f.In("num_rows", m.num_rows, 1, kMaxRows);
  f.In("num_beams", m.num_beams, 1, kMaxBeams);
  f.In("num_steps", m.num_steps, 0, m.num_rows);
  f.In<std::int64_t>("newest_version", m.newest_version, -1, kMost);
  f.In<std::int64_t>("oldest_version", m.oldest_version, -1, m.newest_version);
}

void Look(const InsertAck& m, FaultFinder& f) { f.NotNegative("window_bytes", m.window_bytes); }

void Look(const Goodbye&, FaultFinder&) {}

void LookAtSize(int batch, int history, FaultFinder& f) {
  f.In("batch", batch, 1, kMaxBatch);
  f.In("history", history, 1, kMaxHistory);
  f.In<std::int64_t>("batch times history", std::int64_t{batch} * history, 1, kMaxFrames);
}

void Look(const SampleRequest& m, FaultFinder& f) {
  LookAtSize(m.batch, m.history, f);
  f.In("n_step", m.n_step, 1, kMaxNStep);
  f.In("gamma", m.gamma, 0.0, 1.0);
  f.In("importance_exponent", m.importance_exponent, 0.0, 1.0);
}

void Look(const SampleReply& m, FaultFinder& f) {
  LookAtSize(m.batch, m.history, f);
  f.In("num_beams", m.num_beams, 1, kMaxBeams);
  f.NotNegative("inserted_steps", m.inserted_steps);
  f.NotNegative("table_steps", m.table_steps);
  f.Finite("acting_version", m.acting_version);
}

void Look(const PriorityUpdate& m, FaultFinder& f) { f.In("count", m.count, 1, kMaxBatch); }

void Look(const SnapshotRequest& m, FaultFinder& f) {
  f.In<std::int64_t>("held_version", m.held_version, -1, kMost);
  f.Name("name", m.name);
}

void Look(const Snapshot& m, FaultFinder& f) {
  f.NotNegative("version", m.version);
  f.NotNegative("published_ns", m.published_ns);
  f.NotNegative("learner_steps", m.learner_steps);
}

void Look(const Report& m, FaultFinder& f) {
  f.Name("role", m.role);
  f.Name("name", m.name);
  f.In<std::size_t>("the number of figures", m.figures.size(), 0, kMaxFigures);
  f.In<std::size_t>("the number of facts", m.facts.size(), 0, kMaxFigures);
  for (const auto& [key, value] : m.figures) f.Name("the key of a figure", key);
  for (const auto& [key, value] : m.facts) {
    f.Name("the key of a fact", key);
    f.Text("a fact", value);
  }
}

void Look(const StatusRequest&, FaultFinder&) {}

void Look(const StatusReply& m, FaultFinder& f) {
  if (f.way() == Way::kReceived) {
    f.In<std::size_t>("the number of roles", m.roles.size(), 0, kMaxRoles);
  }
  f.In("omitted", m.omitted, 0, std::numeric_limits<int>::max());
  for (const RoleStatus& role : m.roles) {
    Look(role.report, f);
    f.In("age_s", role.age_s, 0.0, std::numeric_limits<double>::max());
  }
}

void Look(const Refusal& m, FaultFinder& f) {
  f.In<std::uint32_t>("code", static_cast<std::uint32_t>(m.code), 1,
                      std::numeric_limits<std::uint32_t>::max());
  f.Text("text", m.text);
}

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
  std::visit([&](const auto& message) { Look(message, finder); }, header);
  return finder.Take();
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
