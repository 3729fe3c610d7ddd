#include "proto/transport/peers.h"

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace slalom::transport {
namespace {

constexpr std::chrono::milliseconds kCheckInterval{100};
/// Time in which a refusal reaches its peer before the connection ends.
constexpr std::chrono::milliseconds kFarewell{300};
/// Time in which a handshake succeeds on a busy machine. No younger connection is ended for its
/// silence unless there are more newcomers than the limit.
constexpr std::chrono::milliseconds kGrace{200};
/// An upper bound of the bytes that framing, encryption and heartbeats add to a message.
constexpr std::int64_t kFramingBytes = 256;

}  // namespace

std::string_view ToString(EndReason reason) {
  constexpr std::array<std::string_view, 3> kNames = {"handshakes", "connections", "bytes"};
  return kNames.at(static_cast<std::size_t>(reason));
}

Peers::Admission Peers::Admit(const PeerId& peer, int fd, std::int64_t bytes, bool is_operator,
                              Clock::time_point now) {
  const auto by_rate = [](bool has_token) {
    return has_token ? Admission::kYes : Admission::kTooFast;
  };
  if (fd < 0) return Admission::kYes;
  const base::MutexLock lock(mutex_);
  auto known = peers_.find(peer);
  if (known == peers_.end() || known->second.fd != fd) {
    ReadEvents(now);
    const auto connection = connections_.find(fd);
    if (connection == connections_.end()) return by_rate(TakeToken(strangers_, now));
    const bool has_room = HasRoom(is_operator);
    peers_.erase(connection->second.peer);
    connection->second.peer = peer;
    connection->second.is_operator = is_operator;
    if (!has_room) connection->second.refused = now;
    known = peers_
                .insert_or_assign(peer, Peer{.fd = fd,
                                             .delivered = 0,
                                             .bucket = {limits_.messages_per_second, now},
                                             .has_room = has_room})
                .first;
  }
  known->second.delivered += bytes + kFramingBytes;
  if (!known->second.has_room) return Admission::kNoRoom;
  return by_rate(TakeToken(known->second.bucket, now));
}

bool Peers::HasRoom(bool is_operator) const {
  const auto count =
      std::count_if(connections_.begin(), connections_.end(), [&](const auto& entry) {
        const Connection& connection = entry.second;
        return !connection.peer.empty() && !connection.refused &&
               connection.is_operator == is_operator;
      });
  return count < (is_operator ? limits_.operators : limits_.connections);
}

Peers::Counts Peers::counts() const {
  const base::MutexLock lock(mutex_);
  const auto open = std::count_if(connections_.begin(), connections_.end(), [](const auto& entry) {
    return !entry.second.peer.empty() && !entry.second.refused;
  });
  return {.rejected = rejected_, .ended = ended_, .open = static_cast<int>(open)};
}

bool Peers::TakeToken(Bucket& bucket, Clock::time_point now) {
  const double seconds = std::chrono::duration<double>(now - bucket.filled).count();
  bucket.tokens =
      std::min(limits_.messages_per_second, bucket.tokens + seconds * limits_.messages_per_second);
  bucket.filled = now;
  if (bucket.tokens < 1.0) return false;
  bucket.tokens -= 1.0;
  return true;
}

void Peers::Update(Clock::time_point now) {
  const base::MutexLock lock(mutex_);
  const bool is_due = now >= next_check_;
  if (ReadEvents(now) || is_due) EndNewcomers(now);
  if (!is_due) return;
  next_check_ = now + kCheckInterval;
  EndOverfull();
}

bool Peers::ReadEvents(Clock::time_point now) {
  bool any = false;
  while (const auto event = monitor_.Next()) {
    any = true;
    const int fd = static_cast<int>(event->value);
    if (event->type == ZMQ_EVENT_HANDSHAKE_SUCCEEDED) {
      ++succeeded_;
      continue;
    }
    const auto before = connections_.find(fd);
    if (before != connections_.end()) {
      const auto peer = peers_.find(before->second.peer);
      if (peer != peers_.end() && peer->second.fd == fd) peers_.erase(peer);
      connections_.erase(before);
    }
    if (event->type != ZMQ_EVENT_ACCEPTED) continue;
    ++accepted_;
    connections_[fd].accepted = now;
  }
  if (any) CountRejected(now);
  return any;
}

// ZeroMQ does not report every failed handshake. So a handshake counts as failed if it is neither
// established nor can still be under way, and this server did not end it to make room.
void Peers::CountRejected(Clock::time_point now) {
  const auto may_be_shaking = [&](const auto& entry) {
    const Connection& connection = entry.second;
    return connection.peer.empty() && !connection.ended &&
           now - connection.accepted < limits_.handshake;
  };
  const auto shaking = std::count_if(connections_.begin(), connections_.end(), may_be_shaking);
  const std::int64_t ended = ended_[static_cast<std::size_t>(EndReason::kHandshakes)];
  rejected_ = std::max(rejected_, accepted_ - succeeded_ - shaking - ended);
}

void Peers::EndNewcomers(Clock::time_point now) {
  using Aged = std::vector<std::pair<Clock::time_point, int>>;
  Aged silent;
  Aged refused;
  for (const auto& [fd, connection] : connections_) {
    if (connection.ended) continue;
    if (connection.peer.empty()) silent.emplace_back(connection.accepted, fd);
    if (connection.refused) refused.emplace_back(*connection.refused, fd);
  }
  std::sort(silent.begin(), silent.end());
  std::sort(refused.begin(), refused.end());
  std::size_t num_left = silent.size() + refused.size();
  const auto end_oldest = [&](const Aged& aged, std::size_t most, Clock::duration grace,
                              EndReason reason) REQUIRES(mutex_) {
    for (std::size_t i = 0; i + most < aged.size(); ++i) {
      const bool too_many = num_left > static_cast<std::size_t>(limits_.newcomers);
      if (now - aged[i].first < grace && !too_many) break;
      End(aged[i].second, reason);
      --num_left;
    }
  };
  end_oldest(silent, static_cast<std::size_t>(limits_.handshakes), kGrace, EndReason::kHandshakes);
  end_oldest(refused, 0, kFarewell, EndReason::kConnections);
}

void Peers::EndOverfull() {
  std::map<int, std::int64_t> pending;
  std::int64_t total = 0;
  for (const auto& [fd, connection] : connections_) {
    if (!connection.ended) total += pending[fd] = Pending(fd, connection);
  }
  while (!pending.empty()) {
    const auto most =
        std::max_element(pending.begin(), pending.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    if (most->second <= limits_.connection_bytes && total <= limits_.total_bytes) return;
    total -= most->second;
    End(most->first, EndReason::kBytes);
    pending.erase(most);
  }
}

// ZeroMQ's thread, which owns the descriptor, then reads the end of the stream and closes it. It
// may have closed it a moment ago for another reason. If another connection uses the number by now,
// that one is ended instead and connects again; if something that is not a socket uses it, the call
// has no effect.
void Peers::End(int fd, EndReason reason) {
  connections_.at(fd).ended = true;
  if (shutdown(fd, SHUT_RDWR) == 0) ++ended_[static_cast<std::size_t>(reason)];
}

std::int64_t Peers::Pending(int fd, const Connection& connection) {
  tcp_info info{};
  socklen_t size = sizeof info;
  if (getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return 0;
  const auto received = static_cast<std::int64_t>(info.tcpi_bytes_received);
  const auto peer = peers_.find(connection.peer);
  if (peer == peers_.end()) return received;
  // The allowance may have been too large; the rest must not become a credit for later.
  peer->second.delivered = std::min(peer->second.delivered, received);
  return received - peer->second.delivered;
}

}  // namespace slalom::transport
