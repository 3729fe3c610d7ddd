#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages.h"
#include "replay/journal_record.h"
#include "replay/rate_limiter.h"
#include "replay/rows.h"
#include "replay/service/flow_control.h"
#include "replay/service/reply_sender.h"
#include "replay/sessions.h"
#include "replay/table.h"

namespace slalom::replay {

/// Serves the actors: their sessions, the chunks that they insert, and the acknowledgements.
///
/// A chunk is checked, held while the rate limiter says so, inserted into the table and the log,
/// and acknowledged once the log has written it. If its sequence number is below the expected one,
/// it is a duplicate and only acknowledged again. If the number is above, or the chunk exceeds the
/// session's flow-control window, it is refused. A chunk that does not continue its streams is
/// refused as a whole, together with the chunks of its session that were held behind it.
///
/// If there is no room for further chunks, sessions are told a window of 0 and, in turn, a larger
/// one when there is room (`FlowControl`). A session that waits is told its window every 2 s, so
/// that its actor knows that the server is there.
///
/// Confined to the server's thread. Memory: the unwritten payload is at most `room_bytes`, or twice
/// that if sessions exceed their windows.
class InsertDesk {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Options {
    FlowControl::Options flow;
    std::chrono::duration<double> silence{10.0};  ///< Silence after which an actor counts as gone.
    std::uint64_t server = 0;                     ///< As in `proto::Welcome`.
    std::string software;
  };

  /// Counts since the start. Plain data.
  struct Counts {
    /// Arrays are indexed by RefusalCode, whose numbers begin at 1.
    static constexpr std::size_t kReasons = proto::kRefusalCodes.size() + 1;
    std::int64_t chunks_accepted = 0;
    std::int64_t chunks_duplicate = 0;
    std::int64_t steps_duplicate = 0;
    std::array<std::int64_t, kReasons> chunks_rejected{};
    std::array<std::int64_t, kReasons> steps_rejected{};
    std::int64_t sessions_started = 0;
    std::int64_t reconnections = 0;
    std::int64_t episodes_cut = 0;
  };

  /// `sessions`: the sessions recovered with the table. The pointers must outlive the desk.
  InsertDesk(const Options& options, Sessions sessions, Table* table, RateLimiter* limiter,
             RecordLog* log, ReplySender* replies);

  /// Handles the hello of an actor, which begins or resumes a session. The welcome is sent once
  /// everything that it reports is written. A hello without session or streams is refused, and so
  /// is one whose session is far above the last, or that begins too many within a minute. Requires:
  /// it is within the bounds of `proto::Decode`; its beams and spec are the table's.
  void Hello(const transport::PeerId& peer, const proto::Hello& hello, Time now);
  void Insert(const transport::PeerId& peer, const proto::Insert& insert, transport::Frame payload,
              Time now);
  void Goodbye(const transport::PeerId& peer, const proto::Goodbye& goodbye, Time now);
  /// Notes that the peer sent some other message.
  void Heard(const transport::PeerId& peer, Time now);
  /// Notes that the peer's connection is gone.
  void Gone(const transport::PeerId& peer);

  /// Sends the acknowledgements and welcomes that are due, and inserts at most `max_chunks` held
  /// chunks that the rate limiter now lets in. Returns true if there is more to do at once.
  bool Advance(Time now, int max_chunks);

  const Sessions& sessions() const { return sessions_; }
  const Counts& counts() const { return counts_; }
  /// Number of sessions whose actors are connected.
  int num_present(Time now) const;
  /// Number of chunks held by the rate limiter.
  std::int64_t num_held() const { return num_held_; }
  std::int64_t num_unwritten() const { return static_cast<std::int64_t>(unwritten_.size()); }
  /// Bytes of payload received and not yet written.
  std::int64_t unwritten_bytes() const { return flow_.bytes(); }
  /// Bytes of payload that sessions may have unwritten without exceeding their windows.
  std::int64_t room_bytes() const { return flow_.room_bytes(); }
  /// Mean version of the policies that made the newest chunks.
  double acting_version() const;
  /// Returns the times from arrival to written of all chunks written since the last call, [s].
  std::vector<double> TakeInsertSeconds();

 private:
  struct Held {
    proto::Insert insert;
    std::shared_ptr<const transport::Frame> payload;
    RowBytes rows;
    Time arrived;
  };
  /// Counts events within a minute.
  struct PerMinute {
    Time since;
    int count = 0;
    /// Counts one more. Returns false if that is more than `max` within this minute.
    bool Count(Time now, int max);
  };
  /// The state of a session that need not survive a restart.
  struct Live {
    std::optional<transport::PeerId> peer;
    std::uint64_t received = 0;  ///< Sequence number of the next chunk to come.
    std::uint64_t safe = 0;      ///< All chunks before this one are written.
    std::deque<Held> held;
    std::optional<std::uint64_t> welcome_at;  ///< Send it when the log has written this position.
    std::optional<proto::Refusal> refusal;    ///< Of a chunk; the peer's queue was full.
    Time heard;
    Time told;        ///< When the last welcome or acknowledgement was sent.
    PerMinute begun;  ///< Sessions of this name.
  };
  /// A chunk that is in the log and not yet written.
  struct Unwritten {
    std::uint64_t position = 0;
    std::uint32_t id = 0;
    std::uint64_t session = 0;
    std::uint64_t sequence = 0;
    std::int64_t bytes = 0;
    Time arrived;
  };

  Live* Find(const transport::PeerId& peer, std::uint32_t* id);
  /// Returns the session that a hello with a new number begins, or nothing if it was refused.
  std::optional<Session> BeginSession(const proto::Hello& hello, const Session* known);
  bool MakeRoom();
  void Attach(std::uint32_t id, const transport::PeerId& peer, Time now);
  std::uint64_t Put(const Session& session);
  void End(std::uint32_t id);
  void PlaceAll(std::uint32_t id);
  void PlaceFront(std::uint32_t id);
  void DropHeld(std::uint32_t id);
  void Retire(Time now);
  void SendOwed(Time now);
  void RemindWaiting(Time now);
  ReplySender::Sent Answer(const transport::PeerId& peer, const proto::Header& header);
  void Refuse(const transport::PeerId& peer, proto::RefusalCode code, std::string_view text,
              std::uint64_t about);
  void RefuseChunk(const transport::PeerId& peer, proto::RefusalCode code, std::string_view text,
                   const proto::Insert& insert);

  const Options options_;
  Sessions sessions_;
  Table* const table_;
  RateLimiter* const limiter_;
  RecordLog* const log_;
  ReplySender* const replies_;

  std::map<std::uint32_t, Live> live_;  ///< By id; one for each session.
  std::map<transport::PeerId, std::uint32_t> ids_;
  std::deque<std::uint32_t> held_order_;  ///< Ids, in the order in which chunks came.
  std::int64_t num_held_ = 0;
  std::deque<Unwritten> unwritten_;
  PerMinute begun_;  ///< Sessions of all names.
  FlowControl flow_;
  Time reminded_;
  std::set<std::uint32_t> acks_owed_;
  std::set<std::uint32_t> welcomes_owed_;
  std::deque<double> versions_;  ///< Versions of the newest chunks.
  Counts counts_;
  std::vector<double> insert_seconds_;
};

}  // namespace slalom::replay
