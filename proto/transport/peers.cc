#include "proto/transport/peers.h"

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>

namespace slalom::transport {
namespace {

constexpr std::chrono::milliseconds kCheckInterval{100};
/// An upper bound of the bytes that framing, encryption and heartbeats add to a message.
constexpr std::int64_t kFramingBytes = 256;

}  // namespace

bool Peers::Admit(const PeerId& peer, int fd, std::int64_t bytes, Clock::time_point now) {
  if (fd < 0) return true;
  if (now >= next_check_) Update(now);
  auto known = peers_.find(peer);
  if (known == peers_.end() || known->second.fd != fd) {
    ReadEvents(now);
    const auto connection = connections_.find(fd);
    if (connection == connections_.end()) return TakeToken(strangers_, now);
    peers_.erase(connection->second.peer);
    connection->second.peer = peer;
    known = peers_.insert_or_assign(peer, Peer{fd, 0, {limits_.messages_per_second, now}}).first;
  }
  known->second.delivered += bytes + kFramingBytes;
  return TakeToken(known->second.bucket, now);
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
  ReadEvents(now);
  if (now < next_check_) return;
  next_check_ = now + kCheckInterval;
  EndOverfull();
}

void Peers::ReadEvents(Clock::time_point now) {
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
    if (static_cast<int>(connections_.size()) >= limits_.connections) {
      End(fd);
    } else {
      connections_[fd] = {now, ""};
    }
  }
  if (any) CountRejected(now);
}

// ZeroMQ does not report every failed handshake. So a handshake counts as failed if it is neither
// established nor can still be under way.
void Peers::CountRejected(Clock::time_point now) {
  const auto may_be_shaking = [&](const auto& entry) {
    return entry.second.peer.empty() && now - entry.second.accepted < limits_.handshake;
  };
  const auto shaking = std::count_if(connections_.begin(), connections_.end(), may_be_shaking);
  rejected_ = std::max(rejected_, accepted_ - succeeded_ - shaking);
}

void Peers::EndOverfull() {
  std::map<int, std::int64_t> pending;
  std::int64_t total = 0;
  for (const auto& [fd, connection] : connections_) total += pending[fd] = Pending(fd, connection);
  while (!pending.empty()) {
    const auto most =
        std::max_element(pending.begin(), pending.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    if (most->second <= limits_.connection_bytes && total <= limits_.total_bytes) return;
    total -= most->second;
    End(most->first);
    pending.erase(most);
  }
}

// ZeroMQ's thread, which owns the descriptor, then reads the end of the stream and closes it. It
// may have closed it a moment ago for another reason. If another connection uses the number by now,
// that one is ended instead and connects again; if something that is not a socket uses it, the call
// has no effect.
void Peers::End(int fd) {
  if (shutdown(fd, SHUT_RDWR) == 0) ++ended_;
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
