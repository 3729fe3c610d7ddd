#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <variant>
#include <vector>

#include "base/result.h"
#include "proto/refusal_code.h"
#include "proto/run_identity.h"

/// The messages between roles, as plain structs; protobuf types never leave this folder.
/// docs/protocol.md gives their bytes and says who sends which. A message consists of a header,
/// which is encoded and decoded here, and a payload of raw bytes (rows, samples, a policy), which
/// is not.
///
/// proto/slalom.proto says what the fields of a header mean and may hold. A struct mirrors a
/// message of it: `Fields` gives its members in the order of the message's fields.

namespace slalom::proto {

/// A peer with another major version is refused. A newer minor version may add fields, which older
/// peers ignore, and messages, which they refuse with `kUnknownMessage`, without any other effect.
inline constexpr int kMajorVersion = 1;
inline constexpr int kMinorVersion = 0;

/// The number of bytes before the header's protobuf.
inline constexpr std::size_t kPrefixBytes = 16;

/// Bounds on a header, which is refused with `kBadMessage` beyond them. The last three are those of
/// proto/slalom.proto.
inline constexpr std::size_t kMaxHeaderBytes = 1 << 20;  ///< Size of the protobuf.
inline constexpr std::size_t kMaxTextBytes = 1024;
inline constexpr int kMaxFrames = 1 << 17;  ///< Batch times history of a sample.
inline constexpr int kMaxStreams = 4096;    ///< Streams of an actor.
inline constexpr int kMaxFigures = 256;     ///< Figures in a report, facts, keys of a run.
inline constexpr int kMaxRoles = 4096;      ///< Roles in a status.

struct Hello {
  std::string role;
  std::string name;
  std::uint64_t session = 0;
  std::uint64_t spec_hash = 0;
  int num_beams = 0;
  int num_streams = 0;
  std::string software;
  RunIdentity run;
  static auto Fields(auto& m) {
    return std::tie(m.role, m.name, m.session, m.spec_hash, m.num_beams, m.num_streams, m.software,
                    m.run);
  }
};

struct Welcome {
  std::uint64_t server = 0;
  std::uint64_t session = 0;
  std::uint64_t next_sequence = 0;
  std::int64_t window_bytes = 0;
  std::uint64_t previous_session = 0;
  std::int64_t previous_accepted_steps = 0;
  std::string software;
  static auto Fields(auto& m) {
    return std::tie(m.server, m.session, m.next_sequence, m.window_bytes, m.previous_session,
                    m.previous_accepted_steps, m.software);
  }
};

struct Insert {
  std::uint64_t session = 0;
  std::uint64_t sequence = 0;
  int num_rows = 0;
  int num_beams = 0;
  int num_steps = 0;
  std::int64_t oldest_version = 0;
  std::int64_t newest_version = 0;
  static auto Fields(auto& m) {
    return std::tie(m.session, m.sequence, m.num_rows, m.num_beams, m.num_steps, m.oldest_version,
                    m.newest_version);
  }
};

struct InsertAck {
  std::uint64_t session = 0;
  std::uint64_t next_sequence = 0;
  std::int64_t window_bytes = 0;
  static auto Fields(auto& m) { return std::tie(m.session, m.next_sequence, m.window_bytes); }
};

struct Goodbye {
  std::uint64_t session = 0;
  static auto Fields(auto& m) { return std::tie(m.session); }
};

struct SampleRequest {
  std::uint64_t cursor = 0;
  int batch = 0;
  int history = 0;
  int n_step = 0;
  double gamma = 0.0;
  bool prioritized = false;
  double importance_exponent = 0.0;
  std::uint64_t mirror = 0;
  int mirror_places = 0;
  static auto Fields(auto& m) {
    return std::tie(m.cursor, m.batch, m.history, m.n_step, m.gamma, m.prioritized,
                    m.importance_exponent, m.mirror, m.mirror_places);
  }
};

struct SampleReply {
  std::uint64_t cursor = 0;
  int batch = 0;
  int history = 0;
  int num_beams = 0;
  bool weighted = false;
  std::int64_t inserted_steps = 0;
  std::int64_t table_steps = 0;
  double acting_version = 0.0;
  double table_weight = 0.0;
  std::uint64_t mirror = 0;
  int num_scans = 0;
  static auto Fields(auto& m) {
    return std::tie(m.cursor, m.batch, m.history, m.num_beams, m.weighted, m.inserted_steps,
                    m.table_steps, m.acting_version, m.table_weight, m.mirror, m.num_scans);
  }
};

struct PriorityUpdate {
  int count = 0;
  static auto Fields(auto& m) { return std::tie(m.count); }
};

struct SnapshotRequest {
  std::int64_t held_version = -1;
  std::string name;
  bool shipped = false;
  bool without_model = false;
  static auto Fields(auto& m) {
    return std::tie(m.held_version, m.name, m.shipped, m.without_model);
  }
};

struct Snapshot {
  std::int64_t version = 0;
  std::uint64_t spec_hash = 0;
  std::int64_t published_ns = 0;
  std::int64_t learner_steps = 0;
  static auto Fields(auto& m) {
    return std::tie(m.version, m.spec_hash, m.published_ns, m.learner_steps);
  }
};

struct Report {
  std::string role;
  std::string name;
  std::map<std::string, double> figures;
  std::map<std::string, std::string> facts;
  static auto Fields(auto& m) { return std::tie(m.role, m.name, m.figures, m.facts); }
};

struct StatusRequest {
  static auto Fields(auto&) { return std::tie(); }
};

/// A part of `StatusReply`.
struct RoleStatus {
  Report report;
  double age_s = 0.0;
  bool connected = false;
  static auto Fields(auto& m) { return std::tie(m.report, m.age_s, m.connected); }
};

struct StatusReply {
  std::vector<RoleStatus> roles;
  int omitted = 0;
  static auto Fields(auto& m) { return std::tie(m.roles, m.omitted); }
};

/// The status of a service with several replay servers. Of a process that more than one of them
/// knows, it holds the newest report.
StatusReply Merge(std::vector<StatusReply> statuses);

struct Refusal {
  RefusalCode code = RefusalCode::kBadMessage;
  std::string text;
  std::uint64_t about = 0;
  static auto Fields(auto& m) { return std::tie(m.code, m.text, m.about); }
};

/// The refusal of a server that has as many connections as it may have.
Refusal NoRoom(int max_connections);

/// All headers. Their places in the list, counted from 1, are the messages' numbers on the wire.
using Header = std::variant<Hello, Welcome, Insert, InsertAck, Goodbye, SampleRequest, SampleReply,
                            PriorityUpdate, SnapshotRequest, Snapshot, Report, StatusRequest,
                            StatusReply, Refusal>;

/// The name of a message for logs and metrics: "Hello", "Insert", ...
std::string_view NameOf(const Header& header);

/// Encodes a header's frame: a prefix of `kPrefixBytes`, which holds a checksum of header and
/// payload, and then protobuf. The same header always gives the same bytes.
///
/// Texts are made to fit: they are cut, and '?' replaces bytes that are not printable ASCII. A
/// status is made to fit, too: roles for which there is no room are counted in `omitted`.
/// Requires: everything else is within bounds (`FindFault`).
std::string Encode(const Header& header, std::span<const std::byte> payload);

/// What is wrong with a header that `Encode` may not be given: the field, what was found and what
/// was expected. Empty if nothing is.
std::string FindFault(const Header& header);

/// Decodes a header's frame and compares its checksum with the payload. If the bytes are not a
/// message of this protocol, returns the `Refusal` to answer with. Allocates at most 1 MiB and 64
/// bytes for each byte of `frame`, for any bytes.
base::Result<Header, Refusal> Decode(std::span<const std::byte> frame,
                                     std::span<const std::byte> payload);

}  // namespace slalom::proto
