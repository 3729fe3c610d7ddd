#include "replay/sessions.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "base/name.h"

namespace slalom::replay {
namespace {

bool Overlap(const Session& a, const Session& b) {
  return a.stream_base < b.stream_base + b.num_streams &&
         b.stream_base < a.stream_base + a.num_streams;
}

}  // namespace

base::Result<Sessions::FreedStreams> Sessions::Put(const Session& session) {
  const auto fail = [&](std::string_view why) {
    return base::Failure{fmt::format("session {} of id {}: {}", session.number, session.id, why)};
  };
  if (session.id == 0 || !base::IsName(session.name)) return fail("no id, or no name");
  if (session.num_streams < 1 || session.stream_base < 0 || session.num_streams > kMaxStreams ||
      session.stream_base > kMaxStreams - session.num_streams) {
    return fail("streams out of range");
  }
  if (session.accepted_steps < 0 || session.earlier_steps < 0) return fail("negative steps");
  const auto named = ids_.find(session.name);
  if (named != ids_.end() && named->second != session.id) return fail("its name has another id");
  const auto old = sessions_.find(session.id);
  if (old == sessions_.end() && sessions_.size() >= kMaxNames) return fail("too many names");
  if (old != sessions_.end() &&
      (old->second.name != session.name || old->second.number > session.number)) {
    return fail("its id has another name or a later session");
  }
  if (!session.ended) {
    for (const auto& [id, other] : sessions_) {
      if (id != session.id && !other.ended && Overlap(session, other)) {
        return fail(fmt::format("its streams are those of id {}", id));
      }
    }
  }

  FreedStreams freed;
  if (old != sessions_.end() && !old->second.ended &&
      (session.ended || session.number != old->second.number)) {
    freed = {old->second.stream_base, old->second.num_streams};
  }
  sessions_[session.id] = session;
  ids_[session.name] = session.id;
  next_id_ = std::max(next_id_, session.id + 1);
  return freed;
}

bool Sessions::Forget(std::uint32_t id) {
  const auto it = sessions_.find(id);
  if (it == sessions_.end() || !it->second.ended) return false;
  ids_.erase(it->second.name);
  sessions_.erase(it);
  return true;
}

std::optional<base::Failure> Sessions::Accept(std::uint32_t id, std::uint64_t sequence,
                                              std::int64_t num_steps) {
  const auto it = sessions_.find(id);
  if (it == sessions_.end() || it->second.ended) {
    return base::Failure{fmt::format("a chunk of id {}, which has no open session", id)};
  }
  if (sequence != it->second.next_sequence || num_steps < 0) {
    return base::Failure{fmt::format("chunk {} of {} steps of id {}, expected chunk {}", sequence,
                                     num_steps, id, it->second.next_sequence)};
  }
  ++it->second.next_sequence;
  it->second.accepted_steps += num_steps;
  accepted_steps_ += num_steps;
  return std::nullopt;
}

const Session* Sessions::Find(std::uint32_t id) const {
  const auto it = sessions_.find(id);
  return it == sessions_.end() ? nullptr : &it->second;
}

const Session* Sessions::FindName(const std::string& name) const {
  const auto it = ids_.find(name);
  return it == ids_.end() ? nullptr : Find(it->second);
}

std::optional<std::int32_t> Sessions::FreeBase(std::int32_t num_streams) const {
  std::vector<std::pair<std::int32_t, std::int32_t>> used;
  for (const auto& [id, session] : sessions_) {
    if (!session.ended) used.emplace_back(session.stream_base, session.num_streams);
  }
  std::sort(used.begin(), used.end());
  std::int32_t base = 0;
  for (const auto& [begin, count] : used) {
    if (begin - base >= num_streams) break;
    base = begin + count;
  }
  if (num_streams > kMaxStreams - base) return std::nullopt;
  return base;
}

Sessions Sessions::Restore(std::uint32_t next_id, std::int64_t accepted_steps) {
  Sessions sessions;
  sessions.next_id_ = std::max<std::uint32_t>(next_id, 1);
  sessions.accepted_steps_ = accepted_steps;
  return sessions;
}

}  // namespace slalom::replay
