#include "proto/conversion.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "base/check.h"
#include "proto/bounds.h"
#include "proto/slalom.pb.h"

namespace slalom::proto {
namespace {

/// Converts a number from the wire to an int. One that does not fit becomes the largest int, which
/// exceeds every bound.
int ToInt(std::uint32_t value) {
  return static_cast<int>(std::min<std::uint32_t>(value, std::numeric_limits<int>::max()));
}

wire::Hello ToWire(const Hello& m) {
  wire::Hello w;
  w.set_role(m.role);
  w.set_name(m.name);
  w.set_session(m.session);
  w.set_spec_hash(m.spec_hash);
  w.set_num_beams(static_cast<std::uint32_t>(m.num_beams));
  w.set_num_streams(static_cast<std::uint32_t>(m.num_streams));
  w.set_software(FitText(m.software));
  return w;
}
Hello FromWire(const wire::Hello& w) {
  return {.role = w.role(),
          .name = w.name(),
          .session = w.session(),
          .spec_hash = w.spec_hash(),
          .num_beams = ToInt(w.num_beams()),
          .num_streams = ToInt(w.num_streams()),
          .software = w.software()};
}

wire::Welcome ToWire(const Welcome& m) {
  wire::Welcome w;
  w.set_server(m.server);
  w.set_session(m.session);
  w.set_next_sequence(m.next_sequence);
  w.set_window_bytes(m.window_bytes);
  w.set_previous_session(m.previous_session);
  w.set_previous_accepted_steps(m.previous_accepted_steps);
  w.set_software(FitText(m.software));
  return w;
}
Welcome FromWire(const wire::Welcome& w) {
  return {.server = w.server(),
          .session = w.session(),
          .next_sequence = w.next_sequence(),
          .window_bytes = w.window_bytes(),
          .previous_session = w.previous_session(),
          .previous_accepted_steps = w.previous_accepted_steps(),
          .software = w.software()};
}

wire::Insert ToWire(const Insert& m) {
  wire::Insert w;
  w.set_session(m.session);
  w.set_sequence(m.sequence);
  w.set_num_rows(static_cast<std::uint32_t>(m.num_rows));
  w.set_num_beams(static_cast<std::uint32_t>(m.num_beams));
  w.set_num_steps(static_cast<std::uint32_t>(m.num_steps));
  w.set_oldest_version(m.oldest_version);
  w.set_newest_version(m.newest_version);
  return w;
}
Insert FromWire(const wire::Insert& w) {
  return {.session = w.session(),
          .sequence = w.sequence(),
          .num_rows = ToInt(w.num_rows()),
          .num_beams = ToInt(w.num_beams()),
          .num_steps = ToInt(w.num_steps()),
          .oldest_version = w.oldest_version(),
          .newest_version = w.newest_version()};
}

wire::InsertAck ToWire(const InsertAck& m) {
  wire::InsertAck w;
  w.set_session(m.session);
  w.set_next_sequence(m.next_sequence);
  w.set_window_bytes(m.window_bytes);
  return w;
}
InsertAck FromWire(const wire::InsertAck& w) {
  return {
      .session = w.session(), .next_sequence = w.next_sequence(), .window_bytes = w.window_bytes()};
}

wire::Goodbye ToWire(const Goodbye& m) {
  wire::Goodbye w;
  w.set_session(m.session);
  return w;
}
Goodbye FromWire(const wire::Goodbye& w) { return {.session = w.session()}; }

wire::SampleRequest ToWire(const SampleRequest& m) {
  wire::SampleRequest w;
  w.set_cursor(m.cursor);
  w.set_batch(static_cast<std::uint32_t>(m.batch));
  w.set_history(static_cast<std::uint32_t>(m.history));
  w.set_n_step(static_cast<std::uint32_t>(m.n_step));
  w.set_gamma(m.gamma);
  w.set_prioritized(m.prioritized);
  w.set_importance_exponent(m.importance_exponent);
  return w;
}
SampleRequest FromWire(const wire::SampleRequest& w) {
  return {.cursor = w.cursor(),
          .batch = ToInt(w.batch()),
          .history = ToInt(w.history()),
          .n_step = ToInt(w.n_step()),
          .gamma = w.gamma(),
          .prioritized = w.prioritized(),
          .importance_exponent = w.importance_exponent()};
}

wire::SampleReply ToWire(const SampleReply& m) {
  wire::SampleReply w;
  w.set_cursor(m.cursor);
  w.set_batch(static_cast<std::uint32_t>(m.batch));
  w.set_history(static_cast<std::uint32_t>(m.history));
  w.set_num_beams(static_cast<std::uint32_t>(m.num_beams));
  w.set_weighted(m.weighted);
  w.set_inserted_steps(m.inserted_steps);
  w.set_table_steps(m.table_steps);
  w.set_acting_version(m.acting_version);
  return w;
}
SampleReply FromWire(const wire::SampleReply& w) {
  return {.cursor = w.cursor(),
          .batch = ToInt(w.batch()),
          .history = ToInt(w.history()),
          .num_beams = ToInt(w.num_beams()),
          .weighted = w.weighted(),
          .inserted_steps = w.inserted_steps(),
          .table_steps = w.table_steps(),
          .acting_version = w.acting_version()};
}

wire::PriorityUpdate ToWire(const PriorityUpdate& m) {
  wire::PriorityUpdate w;
  w.set_count(static_cast<std::uint32_t>(m.count));
  return w;
}
PriorityUpdate FromWire(const wire::PriorityUpdate& w) { return {.count = ToInt(w.count())}; }

wire::SnapshotRequest ToWire(const SnapshotRequest& m) {
  wire::SnapshotRequest w;
  w.set_held_version(m.held_version);
  w.set_name(m.name);
  return w;
}
SnapshotRequest FromWire(const wire::SnapshotRequest& w) {
  return {.held_version = w.held_version(), .name = w.name()};
}

wire::Snapshot ToWire(const Snapshot& m) {
  wire::Snapshot w;
  w.set_version(m.version);
  w.set_spec_hash(m.spec_hash);
  w.set_published_ns(m.published_ns);
  w.set_learner_steps(m.learner_steps);
  return w;
}
Snapshot FromWire(const wire::Snapshot& w) {
  return {.version = w.version(),
          .spec_hash = w.spec_hash(),
          .published_ns = w.published_ns(),
          .learner_steps = w.learner_steps()};
}

wire::Report ToWire(const Report& m) {
  wire::Report w;
  w.set_role(m.role);
  w.set_name(m.name);
  for (const auto& [key, value] : m.figures) (*w.mutable_figures())[key] = value;
  for (const auto& [key, value] : m.facts) (*w.mutable_facts())[key] = FitText(value);
  return w;
}
Report FromWire(const wire::Report& w) {
  return {.role = w.role(),
          .name = w.name(),
          .figures = {w.figures().begin(), w.figures().end()},
          .facts = {w.facts().begin(), w.facts().end()}};
}

wire::StatusRequest ToWire(const StatusRequest&) { return {}; }
StatusRequest FromWire(const wire::StatusRequest&) { return {}; }

wire::StatusReply ToWire(const StatusReply& m) {
  // Besides its own bytes, a role takes a tag and a length, and so does `omitted`.
  constexpr std::size_t kMargin = 8;
  wire::StatusReply w;
  std::size_t size = kMargin;
  int omitted = m.omitted;
  for (const RoleStatus& role : m.roles) {
    wire::RoleStatus one;
    *one.mutable_report() = ToWire(role.report);
    one.set_age_s(role.age_s);
    one.set_connected(role.connected);
    const std::size_t added = one.ByteSizeLong() + kMargin;
    if (w.roles_size() >= kMaxRoles || size + added > kMaxHeaderBytes) {
      ++omitted;
      continue;
    }
    size += added;
    *w.add_roles() = std::move(one);
  }
  w.set_omitted(static_cast<std::uint32_t>(omitted));
  return w;
}
StatusReply FromWire(const wire::StatusReply& w) {
  StatusReply m;
  m.omitted = ToInt(w.omitted());
  m.roles.reserve(static_cast<std::size_t>(w.roles_size()));
  for (const wire::RoleStatus& role : w.roles()) {
    m.roles.push_back(
        {.report = FromWire(role.report()), .age_s = role.age_s(), .connected = role.connected()});
  }
  return m;
}

wire::Refusal ToWire(const Refusal& m) {
  wire::Refusal w;
  w.set_code(static_cast<std::uint32_t>(m.code));
  w.set_text(FitText(m.text));
  w.set_about(m.about);
  return w;
}
Refusal FromWire(const wire::Refusal& w) {
  return {.code = static_cast<RefusalCode>(w.code()), .text = w.text(), .about = w.about()};
}

template <class Message>
bool ListsFit(std::span<const std::byte> bytes) {
  if constexpr (std::is_same_v<Message, Report>) return ReportListsFit(bytes);
  if constexpr (std::is_same_v<Message, StatusReply>) return StatusListsFit(bytes);
  return true;
}

template <class Message>
std::optional<Header> ParseAs(std::span<const std::byte> bytes) {
  decltype(ToWire(Message{})) w;
  if (!ListsFit<Message>(bytes) ||
      !w.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return std::nullopt;
  }
  return FromWire(w);
}

using Parser = std::optional<Header> (*)(std::span<const std::byte>);

template <std::size_t... kIndex>
constexpr std::array<Parser, sizeof...(kIndex)> MakeParsers(std::index_sequence<kIndex...>) {
  return {&ParseAs<std::variant_alternative_t<kIndex, Header>>...};
}

}  // namespace

void AppendProtobuf(const Header& header, std::string* out) {
  google::protobuf::io::StringOutputStream stream(out);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);  // Otherwise the order of maps varies.
  const bool is_whole = std::visit(
      [&](const auto& message) { return ToWire(message).SerializeToCodedStream(&coded); }, header);
  SLALOM_CHECK(is_whole);
}

std::optional<Header> ParseProtobuf(std::size_t index, std::span<const std::byte> bytes) {
  static constexpr auto kParsers =
      MakeParsers(std::make_index_sequence<std::variant_size_v<Header>>());
  // Bad bytes from a peer get one answer. They must not make protobuf write to standard error.
  static const auto replaced = google::protobuf::SetLogHandler(nullptr);
  (void)replaced;
  SLALOM_CHECK_LT(index, kParsers.size());
  return kParsers[index](bytes);
}

}  // namespace slalom::proto
