#include "proto/transport/peers.h"

#include <gtest/gtest.h>

#include <chrono>
#include <zmq.hpp>

#include "proto/transport/context.h"
#include "proto/transport/monitor.h"

namespace slalom::transport {
namespace {

// A peer that was silent for long may not send as much at once as it might have sent meanwhile.
TEST(PeersTest, ASilentPeerSavesNoMoreThanASecond) {
  Context context;
  zmq::context_t nobody;  // The socket has no events.
  zmq::socket_t socket(nobody, zmq::socket_type::router);
  Monitor monitor(context, socket, Peers::kEvents);
  Peers peers(monitor, {.messages_per_second = 10.0, .connections = 4, .handshakes = 4});
  Peers::Clock::time_point now = Peers::Clock::now();
  const auto admitted = [&] {
    int count = 0;
    for (int i = 0; i < 100; ++i) {
      // A descriptor that no event tells of: all such share a rate.
      count += peers.Admit("peer", 12345, 10, false, now) == Peers::Admission::kYes;
    }
    return count;
  };
  admitted();
  now += std::chrono::seconds(1);
  EXPECT_EQ(admitted(), 10);
  now += std::chrono::milliseconds(300);
  EXPECT_EQ(admitted(), 3);
  now += std::chrono::hours(1);
  EXPECT_EQ(admitted(), 10);
}

}  // namespace
}  // namespace slalom::transport
