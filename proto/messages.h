#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/result.h"
#include "proto/field.h"
#include "proto/refusal_code.h"
#include "proto/run_identity.h"

/// The messages between roles, as plain structs; protobuf types never leave this folder.
/// docs/protocol.md gives their bytes and says who sends which. A message consists of a header,
/// which is encoded and decoded here, and a payload of raw bytes (rows, samples, a policy), which
/// is not.
///
/// Each message lists its fields once, in `Visit`, as configs do: number and name in
/// proto/slalom.proto, the member, its bound (proto/field.h) and its meaning. The conversion from
/// and to protobuf, the checks, the tables of docs/protocol.md and the tests' comparisons follow
/// from this list. `Self` is the message, const or not.

namespace slalom::proto {

/// A peer with another major version is refused. A newer minor version may add fields, which older
/// peers ignore, and messages, which they refuse with `kUnknownMessage`, without any other effect.
inline constexpr int kMajorVersion = 1;
inline constexpr int kMinorVersion = 0;

/// The number of bytes before the header's protobuf.
inline constexpr std::size_t kPrefixBytes = 16;

/// Bounds on the contents of a header. A header beyond them is refused with `kBadMessage`.
inline constexpr std::size_t kMaxHeaderBytes = 1 << 20;  ///< Size of the protobuf.
inline constexpr std::size_t kMaxTextBytes = 1024;
inline constexpr int kMaxBeams = 4096;
inline constexpr int kMaxStreams = 4096;
inline constexpr int kMaxRows = 1 << 16;
inline constexpr int kMaxBatch = 1 << 16;
inline constexpr int kMaxHistory = 256;
inline constexpr int kMaxFrames = 1 << 17;  ///< Batch times history of a sample.
inline constexpr int kMaxNStep = 1024;
inline constexpr int kMaxFigures = 256;  ///< Figures in a report, facts, keys of a run.
inline constexpr int kMaxRoles = 4096;   ///< Roles in a status.

struct Hello {
  static constexpr std::string_view kName = "Hello";
  std::string role;
  std::string name;
  std::uint64_t session = 0;
  std::uint64_t spec_hash = 0;
  int num_beams = 0;
  int num_streams = 0;
  std::string software;
  RunIdentity run;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(role), Name{}, "role: actor, learner, evaluator, operator");
    v(2, SLALOM_FIELD(name), Name{}, "name of the process, the same after a restart");
    v(3, SLALOM_FIELD(session), Related{"an actor's: 1 or more"},
      "session; rises with each start of the process");
    v(4, SLALOM_FIELD(spec_hash), Any{}, "spec hash: of what is observed and commanded");
    v(5, SLALOM_FIELD(num_beams), In{0, kMaxBeams}, "beams in a scan; 0: no scan");
    v(6, SLALOM_FIELD(num_streams), In{0, kMaxStreams},
      "streams: environments of an actor, which has 1 or more");
    v(7, SLALOM_FIELD(software), Text{}, "software, for people");
    v(8, SLALOM_FIELD(run), AtMost{kMaxFigures},
      "run: keys on which its processes must agree and that are not at their defaults");
  }
};

struct Welcome {
  static constexpr std::string_view kName = "Welcome";
  std::uint64_t server = 0;
  std::uint64_t session = 0;
  std::uint64_t next_sequence = 0;
  std::int64_t window_bytes = 0;
  std::uint64_t previous_session = 0;
  std::int64_t previous_accepted_steps = 0;
  std::string software;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(server), Any{}, "server: drawn at random at each start of the server");
    v(2, SLALOM_FIELD(session), Any{}, "session, as in the hello");
    v(3, SLALOM_FIELD(next_sequence), Any{},
      "next sequence: chunks of this session before it are safe");
    v(4, SLALOM_FIELD(window_bytes), AtLeast{0},
      "window: payload that may be unacknowledged [bytes]");
    v(5, SLALOM_FIELD(previous_session), Any{}, "previous session of this name; 0: none is known");
    v(6, SLALOM_FIELD(previous_accepted_steps), AtLeast{0},
      "steps of the previous session that were accepted");
    v(7, SLALOM_FIELD(software), Text{}, "software");
  }
};

struct Insert {
  static constexpr std::string_view kName = "Insert";
  std::uint64_t session = 0;
  std::uint64_t sequence = 0;
  int num_rows = 0;
  int num_beams = 0;
  int num_steps = 0;
  std::int64_t oldest_version = 0;
  std::int64_t newest_version = 0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(session), Any{}, "session");
    v(2, SLALOM_FIELD(sequence), Any{}, "sequence: 0, 1, 2, ... within the session");
    v(3, SLALOM_FIELD(num_rows), In{1, kMaxRows}, "rows");
    v(4, SLALOM_FIELD(num_beams), In{0, kMaxBeams}, "beams; 0: no scan");
    v(5, SLALOM_FIELD(num_steps), Related{"0 to rows"}, "steps: rows that are not final");
    v(6, SLALOM_FIELD(oldest_version), Related{"-1 to the newest"},
      "oldest version of the policies that chose the actions");
    v(7, SLALOM_FIELD(newest_version), AtLeast{-1}, "newest version");
  }
};

struct InsertAck {
  static constexpr std::string_view kName = "InsertAck";
  std::uint64_t session = 0;
  std::uint64_t next_sequence = 0;
  std::int64_t window_bytes = 0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(session), Any{}, "session");
    v(2, SLALOM_FIELD(next_sequence), Any{}, "next sequence: all chunks before it are safe");
    v(3, SLALOM_FIELD(window_bytes), AtLeast{0}, "window [bytes]");
  }
};

struct Goodbye {
  static constexpr std::string_view kName = "Goodbye";
  std::uint64_t session = 0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(session), Any{}, "session");
  }
};

struct SampleRequest {
  static constexpr std::string_view kName = "SampleRequest";
  std::uint64_t cursor = 0;
  int batch = 0;
  int history = 0;
  int n_step = 0;
  double gamma = 0.0;
  bool prioritized = false;
  double importance_exponent = 0.0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(cursor), Any{},
      "cursor: number of the batch; the same number draws with the same random numbers");
    v(2, SLALOM_FIELD(batch), In{1, kMaxBatch}, "batch B");
    v(3, SLALOM_FIELD(history), In{1, kMaxHistory}, "history H; B H is at most 131,072");
    v(4, SLALOM_FIELD(n_step), In{1, kMaxNStep}, "n-step");
    v(5, SLALOM_FIELD(gamma), In{0.0, 1.0}, "gamma");
    v(6, SLALOM_FIELD(prioritized), Any{}, "prioritized");
    v(7, SLALOM_FIELD(importance_exponent), In{0.0, 1.0}, "importance exponent, beta");
  }
};

struct SampleReply {
  static constexpr std::string_view kName = "SampleReply";
  std::uint64_t cursor = 0;
  int batch = 0;
  int history = 0;
  int num_beams = 0;
  bool weighted = false;
  std::int64_t inserted_steps = 0;
  std::int64_t table_steps = 0;
  double acting_version = 0.0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(cursor), Any{}, "cursor");
    v(2, SLALOM_FIELD(batch), In{1, kMaxBatch}, "batch B");
    v(3, SLALOM_FIELD(history), In{1, kMaxHistory}, "history H; B H is at most 131,072");
    v(4, SLALOM_FIELD(num_beams), In{0, kMaxBeams}, "beams N; 0: no scan");
    v(5, SLALOM_FIELD(weighted), Any{}, "weighted: the payload holds importance weights");
    v(6, SLALOM_FIELD(inserted_steps), AtLeast{0}, "environment steps ever accepted");
    v(7, SLALOM_FIELD(table_steps), AtLeast{0}, "steps in the table");
    v(8, SLALOM_FIELD(acting_version), Finite{}, "mean policy version of the newest chunks");
  }
};

struct PriorityUpdate {
  static constexpr std::string_view kName = "PriorityUpdate";
  int count = 0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(count), In{1, kMaxBatch}, "count C");
  }
};

struct SnapshotRequest {
  static constexpr std::string_view kName = "SnapshotRequest";
  std::int64_t held_version = -1;
  std::string name;
  bool shipped = false;
  bool without_model = false;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(held_version), AtLeast{-1}, "version held; -1: none");
    v(2, SLALOM_FIELD(name), Name{}, "name of the process that asks");
    v(3, SLALOM_FIELD(shipped), Any{}, "1: the policy that the run would save, not the acting one");
    v(4, SLALOM_FIELD(without_model), Any{},
      "1: the acting one without its transition model and critic, which only planning needs");
  }
};

struct Snapshot {
  static constexpr std::string_view kName = "Snapshot";
  std::int64_t version = 0;
  std::uint64_t spec_hash = 0;
  std::int64_t published_ns = 0;
  std::int64_t learner_steps = 0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(version), AtLeast{0}, "version");
    v(2, SLALOM_FIELD(spec_hash), Any{}, "spec hash");
    v(3, SLALOM_FIELD(published_ns), AtLeast{0}, "when it was published, since 1970 [ns]");
    v(4, SLALOM_FIELD(learner_steps), AtLeast{0}, "environment steps that the learner knew of");
  }
};

struct Report {
  static constexpr std::string_view kName = "Report";
  std::string role;
  std::string name;
  std::map<std::string, double> figures;
  std::map<std::string, std::string> facts;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(role), Name{}, "role");
    v(2, SLALOM_FIELD(name), Name{}, "name");
    v(3, SLALOM_FIELD(figures), AtMost{kMaxFigures}, "figures");
    v(4, SLALOM_FIELD(facts), AtMost{kMaxFigures}, "facts");
  }
};

struct StatusRequest {
  static constexpr std::string_view kName = "StatusRequest";

  template <class Self, class Visitor>
  static void Visit(Self&, Visitor&) {}
};

/// A part of `StatusReply`.
struct RoleStatus {
  static constexpr std::string_view kName = "RoleStatus";
  Report report;
  double age_s = 0.0;
  bool connected = false;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(report), Any{}, "report, once");
    v(2, SLALOM_FIELD(age_s), AtLeast{0}, "age: since the report came [s]");
    v(3, SLALOM_FIELD(connected), Any{}, "connected");
  }
};

struct StatusReply {
  static constexpr std::string_view kName = "StatusReply";
  std::vector<RoleStatus> roles;
  int omitted = 0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(roles), AtMost{kMaxRoles}, "roles");
    v(2, SLALOM_FIELD(omitted), AtLeast{0}, "roles that did not fit");
  }
};

struct Refusal {
  static constexpr std::string_view kName = "Refusal";
  RefusalCode code = RefusalCode::kBadMessage;
  std::string text;
  std::uint64_t about = 0;

  template <class Self, class Visitor>
  static void Visit(Self& m, Visitor& v) {
    v(1, SLALOM_FIELD(code), AtLeast{1}, "code, below");
    v(2, SLALOM_FIELD(text), Text{}, "why, for people");
    v(3, SLALOM_FIELD(about), Any{},
      "sequence, cursor or session that was refused, where there is one");
  }
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
/// Requires: everything else is within the bounds above.
std::string Encode(const Header& header, std::span<const std::byte> payload);

/// Decodes a header's frame and compares its checksum with the payload. If the bytes are not a
/// message of this protocol, returns the `Refusal` to answer with. Allocates at most 1 MiB and 64
/// bytes for each byte of `frame`, for any bytes.
base::Result<Header, Refusal> Decode(std::span<const std::byte> frame,
                                     std::span<const std::byte> payload);

}  // namespace slalom::proto
