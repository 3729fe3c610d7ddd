#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"

namespace slalom::replay {

/// What is kept of an actor that inserts: its present session and the one before. Plain data.
struct Session {
  std::uint32_t id = 0;  ///< Of the name; never used twice.
  std::string name;
  std::uint64_t number = 0;         ///< Of the session; rises with each start of the actor.
  std::uint64_t next_sequence = 0;  ///< Of the chunk that is expected.
  std::int64_t accepted_steps = 0;  ///< In this session.
  std::int64_t earlier_steps = 0;   ///< In all sessions of this name before.
  /// The last session before of which a chunk was accepted; 0: none is known.
  std::uint64_t previous_number = 0;
  std::int64_t previous_accepted_steps = 0;
  std::int32_t stream_base = 0;  ///< Its streams are [stream_base, stream_base + num_streams).
  std::int32_t num_streams = 0;
  bool ended = false;  ///< Its streams are free.

  friend bool operator==(const Session&, const Session&) = default;
};

/// The sessions of a replay server: what must outlive it, so that no chunk counts twice and every
/// step can be accounted for. It changes only by the calls below, each of which is one record of
/// the journal, and the same calls in the same order make the same book again.
///
/// Thread-compatible.
class Sessions {
 public:
  static constexpr int kMaxNames = 4096;
  static constexpr std::int32_t kMaxStreams = 1 << 20;  ///< Of all sessions together.

  /// Streams that a change has set free; the table is to `Cut` them.
  struct FreedStreams {
    std::int32_t base = 0;
    std::int32_t count = 0;
  };

  /// Puts the session in the place of that with its id. Fails, and changes nothing, where it does
  /// not go together with the others: too many, a name of two ids, streams of another's, a step
  /// backwards.
  base::Result<FreedStreams> Put(const Session& session);

  /// Strikes an ended session out; its steps stay in the total. False: there is none of this id,
  /// or it has not ended.
  [[nodiscard]] bool Forget(std::uint32_t id);

  /// A chunk was accepted. Fails, and changes nothing, where it is not the one expected.
  [[nodiscard]] std::optional<base::Failure> Accept(std::uint32_t id, std::uint64_t sequence,
                                                    std::int64_t num_steps);

  /// None: no such session.
  const Session* Find(std::uint32_t id) const;
  const Session* FindName(const std::string& name) const;

  /// The lowest base at which so many streams are free. None: there are too many.
  std::optional<std::int32_t> FreeBase(std::int32_t num_streams) const;

  const std::map<std::uint32_t, Session>& all() const { return sessions_; }
  /// An id that no session has had.
  std::uint32_t next_id() const { return next_id_; }
  /// Steps ever accepted, of all names.
  std::int64_t accepted_steps() const { return accepted_steps_; }

  /// For the journal's own record of the whole.
  static Sessions Restore(std::uint32_t next_id, std::int64_t accepted_steps);

 private:
  std::map<std::uint32_t, Session> sessions_;
  std::map<std::string, std::uint32_t> ids_;  ///< By name.
  std::uint32_t next_id_ = 1;
  std::int64_t accepted_steps_ = 0;
};

}  // namespace slalom::replay
