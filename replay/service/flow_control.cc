#include "replay/service/flow_control.h"

#include <algorithm>

#include "base/check.h"

namespace slalom::replay {
namespace {

// Longer than a message takes to an actor and back on a busy machine. If it is not, the chunk that
// is on its way is admitted all the same.
constexpr std::chrono::milliseconds kUnused{100};
constexpr std::chrono::milliseconds kCheckInterval{25};

}  // namespace

void FlowControl::Attach(std::uint32_t id) {
  Session& session = sessions_[id];
  session.attached = true;
  SetCredit(session, 0);
  session.believed = 0;
  if (session.chunk == 0) session.chunk = options_.chunk_bytes;
  Queue(id, session);
}

void FlowControl::Detach(std::uint32_t id) {
  const auto it = sessions_.find(id);
  if (it == sessions_.end()) return;
  it->second.attached = false;
  SetCredit(it->second, 0);
}

void FlowControl::Forget(std::uint32_t id) {
  Detach(id);
  sessions_.erase(id);
}

bool FlowControl::Admits(std::uint32_t id, std::int64_t size) const {
  const Session& session = sessions_.at(id);
  const bool within = size <= session.believed || (session.bytes == 0 && session.believed > 0);
  return within && bytes_ + size <= 2 * options_.room_bytes;
}

void FlowControl::Take(std::uint32_t id, std::int64_t size, Time now) {
  Session& session = sessions_.at(id);
  session.bytes += size;
  bytes_ += size;
  SetCredit(session, std::max<std::int64_t>(0, session.credit - size));
  session.believed = std::max<std::int64_t>(0, session.believed - size);
  // Follows larger chunks at once and smaller ones slowly, so that credit rarely falls short.
  session.chunk = std::max(size, session.chunk - session.chunk / 4);
  session.used = now;
}

void FlowControl::Release(std::uint32_t id, std::int64_t size) {
  Session& session = sessions_.at(id);
  SLALOM_CHECK_GE(session.bytes, size);
  session.bytes -= size;
  bytes_ -= size;
  Queue(id, session);
}

std::vector<std::uint32_t> FlowControl::Grant(Time now, int num_present) {
  std::vector<std::uint32_t> changed;
  const std::int64_t share = options_.window_bytes / std::max(1, num_present);
  while (!waiting_.empty()) {
    const std::uint32_t id = waiting_.front();
    if (const auto it = sessions_.find(id); it != sessions_.end() && it->second.waits) {
      const std::int64_t before = it->second.credit;
      if (!GrantTo(it->second, share, now)) break;
      it->second.waits = false;
      if (it->second.credit != before) changed.push_back(id);
    }
    waiting_.pop_front();
  }
  if (!waiting_.empty() && now - checked_ >= kCheckInterval) {
    checked_ = now;
    TakeBackUnused(now, &changed);
  }
  return changed;
}

std::int64_t FlowControl::window(std::uint32_t id) const {
  const auto it = sessions_.find(id);
  return it == sessions_.end() ? 0 : it->second.bytes + it->second.credit;
}

std::int64_t FlowControl::bytes(std::uint32_t id) const {
  const auto it = sessions_.find(id);
  return it == sessions_.end() ? 0 : it->second.bytes;
}

void FlowControl::Queue(std::uint32_t id, Session& session) {
  if (session.waits || !session.attached) return;
  session.waits = true;
  waiting_.push_back(id);
}

void FlowControl::SetCredit(Session& session, std::int64_t credit) {
  credit_ += credit - session.credit;
  session.credit = credit;
}

bool FlowControl::GrantTo(Session& session, std::int64_t share, Time now) {
  if (!session.attached) return true;
  const std::int64_t wanted = std::max(share, session.chunk) - session.bytes;
  // Its payload fills the window. It is queued again when some of that is written.
  if (wanted < session.chunk) return true;
  const std::int64_t room = std::max<std::int64_t>(0, options_.room_bytes - bytes_ - credit_);
  const std::int64_t credit = std::min(wanted, session.credit + room);
  if (credit < std::min(session.chunk, options_.room_bytes)) return false;
  if (credit > session.credit) {
    SetCredit(session, credit);
    session.believed = std::max(session.believed, credit);
    session.used = now;
  }
  return true;
}

void FlowControl::TakeBackUnused(Time now, std::vector<std::uint32_t>* changed) {
  std::size_t needed = waiting_.size();
  for (auto& [id, session] : sessions_) {
    if (session.credit == 0 || now - session.used < kUnused) continue;
    SetCredit(session, 0);
    Queue(id, session);
    changed->push_back(id);
    if (--needed == 0) return;
  }
}

}  // namespace slalom::replay
