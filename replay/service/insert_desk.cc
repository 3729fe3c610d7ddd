#include "replay/service/insert_desk.h"

#include <fmt/format.h>

#include <numeric>
#include <utility>

#include "base/check.h"

namespace slalom::replay {
namespace {

using proto::RefusalCode;
using transport::PeerId;

constexpr std::size_t kNewestChunks = 64;
// How often a session that waits is told its window. An actor that hears nothing for 5 s says hello
// and sends again (proto/replay_link.cc).
constexpr std::chrono::seconds kRemindAfter{2};
constexpr std::chrono::milliseconds kRemindInterval{500};
// Most times kept between two readings.
constexpr std::size_t kMaxInsertSeconds = 1 << 16;
// An actor counts its starts. Numbers that no actor reaches would lock its name for ever, since
// sessions only rise.
constexpr std::uint64_t kMaxSession = std::uint64_t{1} << 63;
constexpr std::uint64_t kMaxSessionJump = std::uint64_t{1} << 32;
// Each session is a record of the journal, which no rows push out.
constexpr int kSessionsPerMinute = 60;  // Of one name.
constexpr int kSessionsPerMinuteOfAll = 10000;

}  // namespace

InsertDesk::InsertDesk(const Options& options, Sessions sessions, Table* table,
                       RateLimiter* limiter, RecordLog* log, ReplySender* replies)
    : options_(options),
      sessions_(std::move(sessions)),
      table_(table),
      limiter_(limiter),
      log_(log),
      replies_(replies),
      flow_(options.flow) {
  for (const auto& [id, session] : sessions_.all()) {
    Live& live = live_[id];
    live.received = live.safe = session.next_sequence;
  }
}

void InsertDesk::Hello(const PeerId& peer, const proto::Hello& hello, Time now) {
  if (hello.session == 0) {
    return Refuse(peer, RefusalCode::kBadMessage, "an actor's session is 0, expected 1 or more", 0);
  }
  if (hello.num_streams < 1) {
    return Refuse(peer, RefusalCode::kBadMessage, "an actor has 0 streams, expected 1 or more",
                  hello.session);
  }
  const Session* const known = sessions_.FindName(hello.name);
  if (known != nullptr && hello.session < known->number) {
    return Refuse(peer, RefusalCode::kReplaced,
                  fmt::format("session {} of {} was replaced by session {}", hello.session,
                              hello.name, known->number),
                  known->number);
  }
  if (known != nullptr && hello.session == known->number) {
    if (!known->ended && hello.num_streams != known->num_streams) {
      return Refuse(peer, RefusalCode::kBadMessage,
                    fmt::format("session {} of {} has {} streams, expected {}", hello.session,
                                hello.name, hello.num_streams, known->num_streams),
                    hello.session);
    }
    ++counts_.reconnections;
    Attach(known->id, peer, now);
    Live& live = live_.at(known->id);
    live.welcome_at = live.welcome_at.value_or(0);
    return SendOwed(now);
  }

  const std::uint64_t before = known == nullptr ? 0 : known->number;
  if (hello.session >= kMaxSession || hello.session - before > kMaxSessionJump) {
    return Refuse(peer, RefusalCode::kBadMessage,
                  fmt::format("session {} of {} follows session {}, expected at most {} more",
                              hello.session, hello.name, before, kMaxSessionJump),
                  hello.session);
  }
  if (known != nullptr && !live_.at(known->id).begun.Count(now, kSessionsPerMinute)) {
    return Refuse(peer, RefusalCode::kNotReady,
                  fmt::format("more than {} sessions of {} began within a minute",
                              kSessionsPerMinute, hello.name),
                  hello.session);
  }
  if (!begun_.Count(now, kSessionsPerMinuteOfAll)) {
    return Refuse(
        peer, RefusalCode::kNotReady,
        fmt::format("more than {} sessions began within a minute", kSessionsPerMinuteOfAll),
        hello.session);
  }
  if (known != nullptr) PlaceAll(known->id);
  const std::optional<Session> session = BeginSession(hello, known);
  if (!session) {
    return Refuse(peer, RefusalCode::kNotReady,
                  "the server has too many actors or streams to add another", hello.session);
  }
  ++counts_.sessions_started;
  const std::uint64_t position = Put(*session);
  flow_.Forget(session->id);
  Attach(session->id, peer, now);
  Live& live = live_.at(session->id);
  live.received = live.safe = 0;
  live.welcome_at = position;
  acks_owed_.erase(session->id);
  SendOwed(now);
}

bool InsertDesk::PerMinute::Count(Time now, int max) {
  if (now - since >= std::chrono::minutes(1)) *this = {.since = now, .count = 0};
  return ++count <= max;
}

std::optional<Session> InsertDesk::BeginSession(const proto::Hello& hello, const Session* known) {
  Session session;
  if (known != nullptr) {
    session.id = known->id;
    session.earlier_steps = known->earlier_steps + known->accepted_steps;
    // If nothing came of a session, the actor may never have seen its welcome. It must then still
    // learn about the session before.
    const bool empty = known->next_sequence == 0;
    session.previous_number = empty ? known->previous_number : known->number;
    session.previous_accepted_steps =
        empty ? known->previous_accepted_steps : known->accepted_steps;
  }
  if (known == nullptr && !MakeRoom()) return std::nullopt;
  if (known == nullptr) session.id = sessions_.next_id();
  session.name = hello.name;
  session.number = hello.session;
  session.num_streams = hello.num_streams;
  if (known != nullptr && !known->ended && known->num_streams == hello.num_streams) {
    session.stream_base = known->stream_base;
    return session;
  }
  const auto base = sessions_.FreeBase(hello.num_streams);
  if (!base) return std::nullopt;
  session.stream_base = *base;
  return session;
}

// Names come and go if actors are containers. The name that has been silent for longest is removed,
// but never one that is connected.
bool InsertDesk::MakeRoom() {
  if (sessions_.all().size() < static_cast<std::size_t>(Sessions::kMaxNames)) return true;
  std::uint32_t oldest = 0;
  for (const auto& [id, session] : sessions_.all()) {
    if (live_.at(id).peer || flow_.bytes(id) > 0) continue;
    if (oldest == 0 || live_.at(id).heard < live_.at(oldest).heard) oldest = id;
  }
  if (oldest == 0) return false;
  End(oldest);
  log_->Append(ForgetRecord{oldest});
  SLALOM_CHECK(sessions_.Forget(oldest));
  live_.erase(oldest);
  flow_.Forget(oldest);
  acks_owed_.erase(oldest);
  welcomes_owed_.erase(oldest);
  return true;
}

void InsertDesk::Attach(std::uint32_t id, const PeerId& peer, Time now) {
  Live& live = live_[id];
  if (live.peer) ids_.erase(*live.peer);
  if (const auto other = ids_.find(peer); other != ids_.end()) {
    live_.at(other->second).peer.reset();
    flow_.Detach(other->second);
  }
  live.peer = peer;
  live.heard = now;
  live.refusal.reset();
  ids_[peer] = id;
  flow_.Attach(id);
  welcomes_owed_.insert(id);
}

std::uint64_t InsertDesk::Put(const Session& session) {
  const auto freed = sessions_.Put(session);
  SLALOM_CHECK(freed.ok());
  for (int s = freed->base; s < freed->base + freed->count; ++s) {
    counts_.episodes_cut += table_->is_open(s);
    table_->Cut(s);
  }
  return log_->Append(SessionRecord{session});
}

void InsertDesk::End(std::uint32_t id) {
  Session session = *sessions_.Find(id);
  if (session.ended) return;
  session.ended = true;
  Put(session);
  flow_.Detach(id);
}

InsertDesk::Live* InsertDesk::Find(const PeerId& peer, std::uint32_t* id) {
  const auto it = ids_.find(peer);
  if (it == ids_.end()) return nullptr;
  *id = it->second;
  return &live_.at(it->second);
}

void InsertDesk::Insert(const PeerId& peer, const proto::Insert& insert, transport::Frame payload,
                        Time now) {
  std::uint32_t id = 0;
  Live* const live = Find(peer, &id);
  const Session* const session = live == nullptr ? nullptr : sessions_.Find(id);
  if (session == nullptr || session->number != insert.session ||
      (session->ended && insert.sequence >= live->received)) {
    return RefuseChunk(peer, RefusalCode::kNoSession, "no such session is open: say hello", insert);
  }
  live->heard = now;
  if (insert.sequence < live->received) {
    ++counts_.chunks_duplicate;
    counts_.steps_duplicate += insert.num_steps;
    acks_owed_.insert(id);
    return;
  }
  if (insert.sequence > live->received) {
    return RefuseChunk(peer, RefusalCode::kOutOfOrder,
                       fmt::format("found chunk {}, expected {}", insert.sequence, live->received),
                       insert);
  }
  const auto size = static_cast<std::int64_t>(payload.size());
  if (!flow_.Admits(id, size)) {
    return RefuseChunk(peer, RefusalCode::kOverWindow,
                       fmt::format("{} bytes after {} unacknowledged ones exceed the window {}",
                                   size, flow_.bytes(id), flow_.window(id)),
                       insert);
  }
  auto frame = std::make_shared<const transport::Frame>(std::move(payload));
  const auto rows =
      RowBytes::Parse(frame->bytes(), insert.num_rows, table_->shape(), session->num_streams);
  if (!rows) return RefuseChunk(peer, RefusalCode::kBadMessage, rows.failure().text, insert);
  if (insert.num_beams != table_->shape().num_beams || rows->num_steps() != insert.num_steps) {
    return RefuseChunk(
        peer, RefusalCode::kBadMessage,
        fmt::format("found {} steps of {} beams, expected {} of {}", rows->num_steps(),
                    insert.num_beams, insert.num_steps, table_->shape().num_beams),
        insert);
  }
  live->held.push_back({insert, std::move(frame), *rows, now});
  ++live->received;
  flow_.Take(id, size, now);
  ++num_held_;
  held_order_.push_back(id);
  if (num_held_ == 1 && limiter_->MayInsert()) {
    held_order_.clear();
    PlaceFront(id);
  }
}

void InsertDesk::PlaceAll(std::uint32_t id) {
  while (!live_.at(id).held.empty()) PlaceFront(id);
}

void InsertDesk::PlaceFront(std::uint32_t id) {
  Live& live = live_.at(id);
  const Session& session = *sessions_.Find(id);
  const proto::Insert& insert = live.held.front().insert;
  if (const auto fault = table_->CheckEpisodes(live.held.front().rows, session.stream_base)) {
    if (live.peer) RefuseChunk(*live.peer, RefusalCode::kBadMessage, fault->text, insert);
    return DropHeld(id);
  }
  const Held held = std::move(live.held.front());
  live.held.pop_front();
  --num_held_;
  const RowsRecord record{.id = id,
                          .num_rows = held.rows.num_rows(),
                          .num_steps = held.insert.num_steps,
                          .sequence = held.insert.sequence,
                          .first_row = table_->total_inserted(),
                          .rows = held.rows.bytes()};
  const auto fault = sessions_.Accept(id, held.insert.sequence, held.insert.num_steps);
  SLALOM_CHECK(!fault.has_value());
  table_->InsertRows(held.rows, session.stream_base);
  limiter_->AddSteps(held.insert.num_steps);
  const std::uint64_t position = log_->Append(record, held.payload);
  unwritten_.push_back({position, id, session.number, held.insert.sequence,
                        static_cast<std::int64_t>(held.payload->size()), held.arrived});
  ++counts_.chunks_accepted;
  versions_.push_back(0.5 * (static_cast<double>(held.insert.oldest_version) +
                             static_cast<double>(held.insert.newest_version)));
  if (versions_.size() > kNewestChunks) versions_.pop_front();
}

void InsertDesk::DropHeld(std::uint32_t id) {
  Live& live = live_.at(id);
  for (const Held& held : live.held) {
    flow_.Release(id, static_cast<std::int64_t>(held.payload->size()));
  }
  num_held_ -= static_cast<std::int64_t>(live.held.size());
  live.held.clear();
  live.received = sessions_.Find(id)->next_sequence;
}

void InsertDesk::Goodbye(const PeerId& peer, const proto::Goodbye& goodbye, Time now) {
  std::uint32_t id = 0;
  Live* const live = Find(peer, &id);
  if (live == nullptr || sessions_.Find(id)->number != goodbye.session) {
    return Refuse(peer, RefusalCode::kNoSession, "no such session is open", goodbye.session);
  }
  live->heard = now;
  PlaceAll(id);
  End(id);
}

void InsertDesk::Heard(const PeerId& peer, Time now) {
  std::uint32_t id = 0;
  if (Live* const live = Find(peer, &id)) live->heard = now;
}

void InsertDesk::Gone(const PeerId& peer) {
  std::uint32_t id = 0;
  Live* const live = Find(peer, &id);
  if (live == nullptr) return;
  live->peer.reset();
  live->refusal.reset();
  flow_.Detach(id);
  ids_.erase(peer);
  acks_owed_.erase(id);
  welcomes_owed_.erase(id);
}

bool InsertDesk::Advance(Time now, int max_chunks) {
  Retire(now);
  for (int i = 0; i < max_chunks && num_held_ > 0 && limiter_->MayInsert();) {
    const std::uint32_t id = held_order_.front();
    held_order_.pop_front();
    const auto live = live_.find(id);
    if (live == live_.end() || live->second.held.empty()) continue;
    PlaceFront(id);
    ++i;
  }
  if (num_held_ == 0) held_order_.clear();
  SendOwed(now);
  return num_held_ > 0 && limiter_->MayInsert();
}

void InsertDesk::Retire(Time now) {
  const std::uint64_t written = log_->written();
  while (!unwritten_.empty() && unwritten_.front().position <= written) {
    const Unwritten& chunk = unwritten_.front();
    const Session* const session = sessions_.Find(chunk.id);
    if (session != nullptr && session->number == chunk.session) {
      Live& live = live_.at(chunk.id);
      flow_.Release(chunk.id, chunk.bytes);
      live.safe = chunk.sequence + 1;
      if (live.peer) acks_owed_.insert(chunk.id);
    } else {
      flow_.ReleaseForgotten(chunk.bytes);
    }
    if (insert_seconds_.size() < kMaxInsertSeconds) {
      insert_seconds_.push_back(std::chrono::duration<double>(now - chunk.arrived).count());
    }
    unwritten_.pop_front();
  }
}

void InsertDesk::SendOwed(Time now) {
  const std::uint64_t written = log_->written();
  for (const std::uint32_t id : flow_.Grant(now, num_present(now))) acks_owed_.insert(id);
  RemindWaiting(now);
  // Iterates over a copy, as peers that are gone leave the set.
  for (const std::uint32_t id : std::vector(welcomes_owed_.begin(), welcomes_owed_.end())) {
    Live& live = live_.at(id);
    if (!live.peer || live.welcome_at.value_or(0) > written) continue;
    const Session& session = *sessions_.Find(id);
    const auto sent = Answer(
        *live.peer, proto::Welcome{.server = options_.server,
                                   .session = session.number,
                                   .next_sequence = live.safe,
                                   .window_bytes = flow_.window(id),
                                   .previous_session = session.previous_number,
                                   .previous_accepted_steps = session.previous_accepted_steps,
                                   .software = options_.software});
    if (sent != ReplySender::Sent::kYes) continue;
    live.welcome_at.reset();
    live.told = now;
    welcomes_owed_.erase(id);
    acks_owed_.erase(id);
  }
  for (const std::uint32_t id : std::vector(acks_owed_.begin(), acks_owed_.end())) {
    Live& live = live_.at(id);
    // An actor does not know its session before the welcome.
    if (!live.peer || welcomes_owed_.contains(id)) continue;
    const auto sent = Answer(*live.peer, proto::InsertAck{.session = sessions_.Find(id)->number,
                                                          .next_sequence = live.safe,
                                                          .window_bytes = flow_.window(id)});
    if (sent != ReplySender::Sent::kYes) continue;
    live.told = now;
    acks_owed_.erase(id);
  }
}

int InsertDesk::num_present(Time now) const {
  int count = 0;
  for (const auto& [peer, id] : ids_) {
    const Live& live = live_.at(id);
    count += now - live.heard < options_.silence && !sessions_.Find(id)->ended;
  }
  return count;
}

void InsertDesk::RemindWaiting(Time now) {
  if (now - reminded_ < kRemindInterval) return;
  reminded_ = now;
  std::vector<std::uint32_t> refused;
  for (const auto& [peer, id] : ids_) {
    const Live& live = live_.at(id);
    if (live.refusal) refused.push_back(id);
    const bool waits = flow_.bytes(id) > 0 || flow_.window(id) == 0;
    if (waits && !sessions_.Find(id)->ended && now - live.told >= kRemindAfter) {
      acks_owed_.insert(id);
    }
  }
  for (const std::uint32_t id : refused) {
    Live& live = live_.at(id);
    if (Answer(*live.peer, *live.refusal) == ReplySender::Sent::kYes) live.refusal.reset();
  }
}

double InsertDesk::acting_version() const {
  if (versions_.empty()) return 0.0;
  return std::accumulate(versions_.begin(), versions_.end(), 0.0) /
         static_cast<double>(versions_.size());
}

std::vector<double> InsertDesk::TakeInsertSeconds() { return std::exchange(insert_seconds_, {}); }

ReplySender::Sent InsertDesk::Answer(const PeerId& peer, const proto::Header& header) {
  const PeerId to = peer;  // `Gone` destroys `peer`. NOLINT(performance-unnecessary-copy*)
  const auto sent = replies_->Send(to, MakeMessage(header));
  if (sent == ReplySender::Sent::kGone) Gone(to);
  return sent;
}

void InsertDesk::Refuse(const PeerId& peer, RefusalCode code, std::string_view text,
                        std::uint64_t about) {
  replies_->NoteRefusal(peer, code, text);
  (void)Answer(peer, proto::Refusal{.code = code, .text = std::string(text), .about = about});
}

void InsertDesk::RefuseChunk(const PeerId& peer, RefusalCode code, std::string_view text,
                             const proto::Insert& insert) {
  const auto reason = static_cast<std::size_t>(code);
  replies_->NoteRefusal(peer, code, text);
  ++counts_.chunks_rejected[reason];
  counts_.steps_rejected[reason] += insert.num_steps;
  const proto::Refusal refusal{.code = code, .text = std::string(text), .about = insert.sequence};
  if (Answer(peer, refusal) != ReplySender::Sent::kFull) return;
  // Without it, the actor would wait for an acknowledgement that never comes.
  std::uint32_t id = 0;
  if (Live* const live = Find(peer, &id)) live->refusal = refusal;
}

}  // namespace slalom::replay
