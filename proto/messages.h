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

/// The messages between roles, as plain structs; protobuf types never leave this folder.
/// docs/protocol.md gives their bytes and says who sends which. A message consists of a header,
/// which is encoded and decoded here, and a payload of raw bytes (rows, samples, a policy), which
/// is not.

namespace slalom::proto {

/// A peer with another major version is refused. A newer minor version may add fields, which older
/// peers ignore, and messages, which they refuse with `kUnknownMessage`, without any other effect.
inline constexpr int kMajorVersion = 1;
inline constexpr int kMinorVersion = 0;

/// The number of bytes before the header's protobuf.
inline constexpr std::size_t kPrefixBytes = 16;

/// Bounds on what a header may hold. A header beyond them is refused with `kBadMessage`.
inline constexpr std::size_t kMaxHeaderBytes = 1 << 20;  ///< Of protobuf.
inline constexpr std::size_t kMaxTextBytes = 1024;
inline constexpr int kMaxBeams = 4096;
inline constexpr int kMaxStreams = 4096;
inline constexpr int kMaxRows = 1 << 16;
inline constexpr int kMaxBatch = 1 << 16;
inline constexpr int kMaxHistory = 256;
inline constexpr int kMaxFrames = 1 << 17;  ///< Batch times history of a sample.
inline constexpr int kMaxNStep = 1024;
inline constexpr int kMaxFigures = 256;  ///< Of a report. The same bound holds for its facts.
inline constexpr int kMaxRoles = 4096;   ///< Of a status.

/// Why a message was refused. The numbers are part of the protocol.
enum class RefusalCode : std::uint32_t {
  kBadMessage = 1,      ///< Cut short, damaged, or a value out of range.
  kWrongVersion = 2,    ///< Another major version of the protocol.
  kUnknownMessage = 3,  ///< A message of a newer minor version.
  kNotAllowed = 4,      ///< The sender's role may not send this message.
  kWrongSpec = 5,       ///< Observations or actions are not those of this service.
  kNoSession = 6,       ///< An insert without an open session. Say hello first.
  kOutOfOrder = 7,      ///< A chunk before this one is missing. Say hello again.
  kOverWindow = 8,      ///< More unacknowledged payload than the window.
  kTooFast = 9,         ///< More messages than the rate bound.
  kNotReady = 10,       ///< Not now, for example while loading.
  kReplaced = 11,       ///< A hello of a session that session `about` replaced.
};
/// "bad_message", ...; "other" for one of a newer minor version.
inline constexpr RefusalCode kRefusalCodes[] = {
    RefusalCode::kBadMessage, RefusalCode::kWrongVersion, RefusalCode::kUnknownMessage,
    RefusalCode::kNotAllowed, RefusalCode::kWrongSpec,    RefusalCode::kNoSession,
    RefusalCode::kOutOfOrder, RefusalCode::kOverWindow,   RefusalCode::kTooFast,
    RefusalCode::kNotReady};
std::string_view ToString(RefusalCode code);

/// proto/slalom.proto says what the fields mean. A `role`, a `name` and the keys of a report are
/// names (`IsName`). `software`, `text` and the values of facts are texts: printable ASCII, at
/// most `kMaxTextBytes`.
struct Hello {
  std::string role;
  std::string name;
  std::uint64_t session = 0;
  std::uint64_t spec_hash = 0;
  int num_beams = 0;
  int num_streams = 0;
  std::string software;
};

struct Welcome {
  std::uint64_t server = 0;
  std::uint64_t session = 0;
  std::uint64_t next_sequence = 0;
  std::int64_t window_bytes = 0;
  std::uint64_t previous_session = 0;
  std::int64_t previous_accepted_steps = 0;
  std::string software;
};

struct Insert {
  std::uint64_t session = 0;
  std::uint64_t sequence = 0;
  int num_rows = 0;
  int num_beams = 0;
  int num_steps = 0;
  std::int64_t oldest_version = 0;
  std::int64_t newest_version = 0;
};

struct InsertAck {
  std::uint64_t session = 0;
  std::uint64_t next_sequence = 0;
  std::int64_t window_bytes = 0;
};

struct Goodbye {
  std::uint64_t session = 0;
};

struct SampleRequest {
  std::uint64_t cursor = 0;
  int batch = 0;
  int history = 0;
  int n_step = 0;
  double gamma = 0.0;
  bool prioritized = false;
  double importance_exponent = 0.0;
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
};

struct PriorityUpdate {
  int count = 0;
};

struct SnapshotRequest {
  std::int64_t held_version = -1;
  std::string name;
};

struct Snapshot {
  std::int64_t version = 0;
  std::uint64_t spec_hash = 0;
  std::int64_t published_ns = 0;
  std::int64_t learner_steps = 0;
};

struct Report {
  std::string role;
  std::string name;
  std::map<std::string, double> figures;
  std::map<std::string, std::string> facts;
};

struct StatusRequest {};

struct RoleStatus {
  Report report;
  double age_s = 0.0;
  bool connected = false;
};

struct StatusReply {
  std::vector<RoleStatus> roles;
  int omitted = 0;  ///< Roles that did not fit.
};

struct Refusal {
  RefusalCode code = RefusalCode::kBadMessage;
  std::string text;
  std::uint64_t about = 0;
};

/// All headers. Their places in the list, counted from 1, are the messages' numbers on the wire.
using Header = std::variant<Hello, Welcome, Insert, InsertAck, Goodbye, SampleRequest, SampleReply,
                            PriorityUpdate, SnapshotRequest, Snapshot, Report, StatusRequest,
                            StatusReply, Refusal>;

/// The name of a message for logs and metrics: "Hello", "Insert", ...
std::string_view NameOf(const Header& header);

/// Encodes a header's frame: a prefix of `kPrefixBytes`, which holds a checksum of header and
/// payload, and then protobuf. The same header always gives the same bytes.
///
/// Texts are made to fit: they are cut, and '?' replaces what is not printable ASCII. A status is
/// made to fit, too: roles for which there is no room are counted in `omitted`.
/// Requires: everything else is within the bounds above.
std::string Encode(const Header& header, std::span<const std::byte> payload);

/// Decodes a header's frame and compares its checksum with the payload. If the bytes are not a
/// message of this protocol, returns the `Refusal` to answer with. Whatever `frame` holds, at most
/// 1 MiB and 64 bytes for each of its bytes are allocated.
base::Result<Header, Refusal> Decode(std::span<const std::byte> frame,
                                     std::span<const std::byte> payload);

}  // namespace slalom::proto
