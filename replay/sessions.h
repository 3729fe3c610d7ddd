#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "base/result.h"

namespace slalom::replay {

/// Record of an actor in a replay server: its present session and the one before. Plain data.
struct Session {
  std::uint32_t id = 0;  ///< Short for the name; never reused.
  std::string name;
  std::uint64_t number = 0;         ///< The session's number; rises with each start of the actor.
  std::uint64_t next_sequence = 0;  ///< Sequence number of the next expected chunk.
  std::int64_t accepted_steps = 0;  ///< In this session.
  std::int64_t earlier_steps = 0;   ///< In all earlier sessions of this name.
  /// The last earlier session with an accepted chunk; 0 if none is known.
  std::uint64_t previous_number = 0;
  std::int64_t previous_accepted_steps = 0;
  std::int32_t stream_base = 0;  ///< Its streams are [stream_base, stream_base + num_streams).
  std::int32_t num_streams = 0;
  bool ended = false;  ///< The session has ended; its streams are free.

  friend bool operator==(const Session&, const Session&) = default;
};

/// The sessions of a replay server. They must survive a restart, so that no chunk counts twice and
/// every step is accounted for. They change only by the calls below, each of which is one record of
/// the journal; the same calls in the same order restore the same state. Thread-compatible.
class Sessions {
 public:
  static constexpr int kMaxNames = 4096;
  static constexpr std::int32_t kMaxStreams = 1 << 20;  ///< In all sessions together.

  /// Streams that a change has freed. The caller must `Cut` them in the table.
  struct FreedStreams {
    std::int32_t base = 0;
    std::int32_t count = 0;
  };

  /// Adds the session, or replaces the one with the same id. Fails, and changes nothing, if it
  /// contradicts the others: there are too many, the name has another id, the streams belong to
  /// another session, or a number would go backwards.
  base::Result<FreedStreams> Put(const Session& session);

  /// Removes an ended session; its steps stay in the total. Returns false if there is no session of
  /// this id, or it has not ended.
  [[nodiscard]] bool Forget(std::uint32_t id);

  /// Counts an accepted chunk. Fails, and changes nothing, if it is not the expected one.
  [[nodiscard]] std::optional<base::Failure> Accept(std::uint32_t id, std::uint64_t sequence,
                                                    std::int64_t num_steps);

  /// Null if there is no such session.
  const Session* Find(std::uint32_t id) const;
  const Session* FindName(const std::string& name) const;

  /// Returns the lowest base at which `num_streams` streams are free, or nothing if there is none.
  std::optional<std::int32_t> FreeBase(std::int32_t num_streams) const;

  const std::map<std::uint32_t, Session>& all() const { return sessions_; }
  /// The next id, which no session has had.
  std::uint32_t next_id() const { return next_id_; }
  /// Number of steps ever accepted, over all names.
  std::int64_t accepted_steps() const { return accepted_steps_; }

  /// Returns empty sessions with these counts, to which a `StateRecord` adds its sessions.
  static Sessions Restore(std::uint32_t next_id, std::int64_t accepted_steps);

 private:
  std::map<std::uint32_t, Session> sessions_;
  std::map<std::string, std::uint32_t> ids_;  ///< By name.
  std::uint32_t next_id_ = 1;
  std::int64_t accepted_steps_ = 0;
};

}  // namespace slalom::replay
