#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>

#include "proto/messages.h"
#include "transport/frame.h"

namespace slalom::actor {

/// A chunk on its way to the replay server.
struct OutgoingChunk {
  proto::Insert header;
  transport::Frame payload;  ///< Rows, as `replay::RowBytes` writes them.
};

/// What an actor made and the replay server has not acknowledged, in order, to be sent and, after a
/// broken connection, sent again. Confined to one thread.
class Outbox {
 public:
  /// Is `full` from `max_bytes` of payload on.
  explicit Outbox(std::int64_t max_bytes) : max_bytes_(max_bytes) {}

  /// Forgets everything and begins a session.
  void Begin(std::uint64_t session);

  bool full() const { return bytes_ >= max_bytes_; }
  bool empty() const { return chunks_.empty(); }

  /// Adds a chunk and gives it session and sequence number, even where it is full.
  void Add(proto::Insert header, transport::Frame payload);

  /// The next chunk to be sent that keeps the payload sent and not acknowledged within
  /// `window_bytes` (one chunk always may be); null: none. Call `MarkSent` when it is.
  const OutgoingChunk* NextToSend(std::int64_t window_bytes) const;
  void MarkSent();

  /// Forgets the chunks before `next_sequence`, which are safe. Returns the steps in them.
  std::int64_t Acknowledge(std::uint64_t next_sequence);

  /// Sends again from `next_sequence` on. False: chunks from there on are no longer here, or were
  /// never made: the server and this actor do not speak of the same session.
  [[nodiscard]] bool Resume(std::uint64_t next_sequence);

  std::uint64_t session() const { return session_; }
  std::int64_t bytes() const { return bytes_; }
  std::int64_t steps() const { return steps_; }
  int num_chunks() const { return static_cast<int>(chunks_.size()); }
  /// Chunks that were sent more than once, so far.
  std::int64_t resent() const { return resent_; }

  /// Writes what is unacknowledged into a file (docs/protocol.md), whole or not at all, or removes
  /// the file where there is nothing. Throws `base::Error` where that fails.
  void SaveSpool(const std::filesystem::path& path, int num_streams) const;

  /// Takes over the session and the chunks of a spool file. Returns its number of streams; none: no
  /// such file. Throws `base::Error` naming the file where it is damaged.
  std::optional<int> LoadSpool(const std::filesystem::path& path);

 private:
  const std::int64_t max_bytes_;
  std::uint64_t session_ = 0;
  std::uint64_t next_sequence_ = 0;  // Of the next chunk added.
  std::deque<OutgoingChunk> chunks_;
  std::size_t num_sent_ = 0;       // Of `chunks_`, from the front.
  std::uint64_t sent_before_ = 0;  // Sequences below were sent at least once.
  std::int64_t bytes_ = 0;
  std::int64_t sent_bytes_ = 0;
  std::int64_t steps_ = 0;
  std::int64_t resent_ = 0;
};

}  // namespace slalom::actor
