#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>

#include "base/error.h"
#include "proto/messages.h"
#include "proto/transport/frame.h"

namespace slalom::actor {

/// A chunk on its way to the replay server.
struct OutgoingChunk {
  proto::Insert header;
  transport::Frame payload;  ///< Rows, as `replay::RowBytes` writes them.
};

/// A spool file that is damaged, or no spool.
struct DamagedSpool : base::Error {
  using Error::Error;
};

/// The chunks that an actor made and the replay server has not acknowledged, in order. They are
/// sent and, after a broken connection, sent again. Confined to one thread.
class Outbox {
 public:
  /// The outbox counts as full once its payload reaches `max_bytes`.
  explicit Outbox(std::int64_t max_bytes) : max_bytes_(max_bytes) {}

  /// Forgets everything and begins a session.
  void Begin(std::uint64_t session);

  bool full() const { return bytes_ >= max_bytes_; }
  bool empty() const { return chunks_.empty(); }

  /// Adds a chunk and gives it session and sequence number. A full outbox accepts it, too.
  void Add(proto::Insert header, transport::Frame payload);

  /// Returns the next chunk to send, or null if there is none or it would take the unacknowledged
  /// payload beyond `window_bytes`. If the window is above 0 and nothing is unacknowledged, a chunk
  /// of any size may be sent. Call `MarkSent` after sending it.
  const OutgoingChunk* NextToSend(std::int64_t window_bytes) const;
  void MarkSent();

  /// Removes the chunks before `next_sequence`, which are acknowledged. Returns their number.
  int Acknowledge(std::uint64_t next_sequence);

  /// Starts sending again from `next_sequence` on. Returns false if that chunk is no longer here,
  /// or was never made: then the server and this actor do not mean the same session.
  [[nodiscard]] bool Resume(std::uint64_t next_sequence);

  std::uint64_t session() const { return session_; }
  std::int64_t bytes() const { return bytes_; }
  std::int64_t steps() const { return steps_; }
  int num_chunks() const { return static_cast<int>(chunks_.size()); }
  /// Number of chunks so far that were sent more than once.
  std::int64_t resent() const { return resent_; }

  /// Writes the chunks to a spool file (docs/protocol.md), completely or not at all. If there are
  /// none, removes the file. Throws `base::Error` if that fails.
  void SaveSpool(const std::filesystem::path& path, int num_streams) const;

  /// Takes over the session and the chunks of a spool file. Returns its number of streams, or
  /// nothing if there is no such file. Throws `DamagedSpool`, naming the file, if it is damaged;
  /// the outbox then holds some of its chunks until `Begin`. Throws `base::Error` if it cannot be
  /// read.
  std::optional<int> LoadSpool(const std::filesystem::path& path);

 private:
  const std::int64_t max_bytes_;
  std::uint64_t session_ = 0;
  std::uint64_t next_sequence_ = 0;  // Sequence number of the next chunk added.
  std::deque<OutgoingChunk> chunks_;
  std::size_t num_sent_ = 0;       // This many chunks from the front were sent.
  std::uint64_t sent_before_ = 0;  // Chunks with lower numbers were sent at least once.
  std::int64_t bytes_ = 0;
  std::int64_t sent_bytes_ = 0;
  std::int64_t steps_ = 0;
  std::int64_t resent_ = 0;
};

}  // namespace slalom::actor
