#include "proto/transport/queued_bytes.h"

#include <algorithm>

namespace slalom::transport {
namespace {

constexpr std::size_t kSmall = 1024;

/// A part on its way: ZeroMQ reads its bytes, and destroys this once it needs them no more.
struct Underway {
  zmq::message_t part;
  std::shared_ptr<std::atomic<std::int64_t>> counter;
};

void Sent(void*, void* underway) {
  const std::unique_ptr<Underway> sent(static_cast<Underway*>(underway));
  sent->counter->fetch_sub(static_cast<std::int64_t>(sent->part.size()));
}

}  // namespace

std::int64_t QueuedBytes::Counted(const zmq::message_t& part) {
  return part.size() > kSmall ? static_cast<std::int64_t>(part.size()) : 0;
}

std::int64_t QueuedBytes::Of(const PeerId& peer) const {
  const auto found = peers_.find(peer);
  return found == peers_.end() ? 0 : found->second->load();
}

void QueuedBytes::Count(const PeerId& peer, zmq::message_t& part) {
  const std::int64_t size = Counted(part);
  if (size == 0) return;
  if (peers_.size() >= sweep_at_) {
    std::erase_if(peers_, [](const auto& entry) { return entry.second->load() == 0; });
    sweep_at_ = std::max<std::size_t>(64, 2 * peers_.size());
  }
  std::shared_ptr<Counter>& counter = peers_[peer];
  if (!counter) counter = std::make_shared<Counter>(0);
  counter->fetch_add(size);
  auto underway = std::make_unique<Underway>();
  underway->part.swap(part);
  underway->counter = counter;
  void* const bytes = underway->part.data();
  part.rebuild(bytes, static_cast<std::size_t>(size), Sent, underway.release());
}

}  // namespace slalom::transport
