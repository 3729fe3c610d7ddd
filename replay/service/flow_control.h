#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <vector>

namespace slalom::replay {

/// Shares the room for payload that is not written yet among the sessions of actors.
///
/// A session's window is the payload that it may have sent without an acknowledgement: the payload
/// that came and is not written, and its credit, for which room is reserved. Payload and credit of
/// all sessions together stay below `room_bytes`, so a session that keeps to its window is never
/// refused. A session without room for a chunk waits, and waiting sessions are granted credit in
/// turn. Credit that a session leaves unused is taken back if others wait.
///
/// A window above 0 admits one chunk of any size if nothing else of the session is unwritten, as
/// the server learns the size of a session's chunks only from those that come. A chunk may also be
/// on its way while its credit is taken back. Such chunks are admitted up to twice `room_bytes` in
/// all.
///
/// Thread-compatible. Cost: `Grant` takes O(sessions granted) and, at most 40 times a second,
/// O(sessions); the other calls O(log(sessions)).
class FlowControl {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Options {
    std::int64_t window_bytes = 256 << 20;  ///< Shared by all connected sessions.
    std::int64_t room_bytes = 64 << 20;     ///< At least the largest message.
    std::int64_t chunk_bytes = 64 << 10;    ///< Size that a session's first chunk probably has.
  };

  explicit FlowControl(const Options& options) : options_(options) {}

  /// Notes that a session's actor has a new connection, on which nothing is granted yet.
  void Attach(std::uint32_t id);
  /// Notes that the connection or the session has ended. Its unwritten payload still counts.
  void Detach(std::uint32_t id);
  /// Notes that another session takes the place of this one, whose unwritten payload counts for
  /// nobody from now on. Also forgets a session that will not come back.
  void Forget(std::uint32_t id);

  /// Whether a chunk of `size` bytes keeps to the window and the room.
  bool Admits(std::uint32_t id, std::int64_t size) const;
  /// Counts an admitted chunk as unwritten payload.
  void Take(std::uint32_t id, std::int64_t size, Time now);
  /// Notes that the session's payload of `size` bytes is written, or dropped.
  void Release(std::uint32_t id, std::int64_t size);
  /// The same for a session that was forgotten.
  void ReleaseForgotten(std::int64_t size) { bytes_ -= size; }

  /// Grants credit to the sessions that wait, in turn, as far as there is room. Returns the
  /// sessions whose windows changed, which have to be told.
  /// `num_present`: number of sessions that share `window_bytes`.
  std::vector<std::uint32_t> Grant(Time now, int num_present);

  std::int64_t window(std::uint32_t id) const;
  /// Unwritten payload of a session, and of all sessions, forgotten ones included.
  std::int64_t bytes(std::uint32_t id) const;
  std::int64_t bytes() const { return bytes_; }
  std::int64_t room_bytes() const { return options_.room_bytes; }

 private:
  struct Session {
    bool attached = false;
    bool waits = false;       ///< Its id is in `waiting_`.
    std::int64_t bytes = 0;   ///< Payload that came and is not written.
    std::int64_t credit = 0;  ///< Payload that may come, for which room is reserved.
    /// Payload that the actor may believe it may send: the credit, and credit that was taken back.
    std::int64_t believed = 0;
    std::int64_t chunk = 0;  ///< Estimate of the size of its chunks.
    Time used;               ///< When credit was last granted or used.
  };

  void Queue(std::uint32_t id, Session& session);
  void SetCredit(Session& session, std::int64_t credit);
  /// Grants what there is room for, and returns whether it suffices for a chunk if one is due.
  bool GrantTo(Session& session, std::int64_t share, Time now);
  void TakeBackUnused(Time now, std::vector<std::uint32_t>* changed);

  const Options options_;
  std::map<std::uint32_t, Session> sessions_;
  std::deque<std::uint32_t> waiting_;
  std::int64_t bytes_ = 0;
  std::int64_t credit_ = 0;  ///< Of all sessions.
  Time checked_;             ///< When unused credit was last looked for.
};

}  // namespace slalom::replay
