#include "replay/service/status_board.h"

#include <algorithm>

namespace slalom::replay {
namespace {

// Size of a reply, well within the limit of a message.
constexpr std::size_t kMaxReplyBytes = proto::kMaxHeaderBytes / 2;
// Size of a number, and of the lengths and field numbers around a text.
constexpr std::size_t kOverhead = 16;

/// Returns an upper bound of the size of a report in a message.
std::size_t SizeOf(const proto::Report& report) {
  std::size_t size = report.role.size() + report.name.size() + 4 * kOverhead;
  for (const auto& [name, value] : report.figures) size += name.size() + 2 * kOverhead;
  for (const auto& [name, text] : report.facts) size += name.size() + text.size() + 2 * kOverhead;
  return size;
}

}  // namespace

void StatusBoard::Put(proto::Report report, Time now) {
  const auto erase = [this](auto it) {
    bytes_ -= it->second.bytes;
    entries_.erase(it);
  };
  const std::pair key(report.role, report.name);
  if (const auto it = entries_.find(key); it != entries_.end()) erase(it);
  const std::size_t bytes = SizeOf(report);
  while (!entries_.empty() && (entries_.size() >= static_cast<std::size_t>(proto::kMaxRoles) ||
                               bytes_ + bytes > kMaxBytes)) {
    erase(std::min_element(entries_.begin(), entries_.end(), [](const auto& a, const auto& b) {
      return a.second.came < b.second.came;
    }));
  }
  entries_[key] = {std::move(report), now, bytes};
  bytes_ += bytes;
}

proto::StatusReply StatusBoard::Reply(Time now) const {
  proto::StatusReply reply;
  std::size_t size = 0;
  // Of actors there are many. The others come first, so that none of them is left out.
  for (const bool actors : {false, true}) {
    for (const auto& [key, entry] : entries_) {
      if ((entry.report.role == "actor") != actors) continue;
      size += entry.bytes;
      if (size > kMaxReplyBytes) break;
      const std::chrono::duration<double> age = now - entry.came;
      reply.roles.push_back(
          {.report = entry.report, .age_s = age.count(), .connected = age < silence_});
    }
  }
  reply.omitted = static_cast<int>(entries_.size() - reply.roles.size());
  return reply;
}

}  // namespace slalom::replay
