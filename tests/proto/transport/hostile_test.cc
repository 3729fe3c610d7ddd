#include <gmock/gmock.h>
#include <sys/resource.h>

#include <atomic>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>
#include <zmq.hpp>

#include "base/error.h"
#include "base/random.h"
#include "tests/proto/transport/raw_socket.h"
#include "tests/proto/transport/service.h"
#include "tests/support/log_lines.h"

/// What peers may do to a server, and servers to a client: whatever it is, the others are served.

namespace slalom::transport::test {
namespace {

using namespace std::chrono_literals;

/// A peer that speaks ZeroMQ and minds no rule of ours.
class RawPeer {
 public:
  explicit RawPeer(Service& service, Wire wire, const std::string& id = "")
      : socket_(context_, zmq::socket_type::dealer) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::rcvhwm, 1);
    if (!id.empty()) socket_.set(zmq::sockopt::routing_id, id);
    if (wire == Wire::kCurve) {
      const KeyPair& keys = service.keys(Role::kActor);
      socket_.set(zmq::sockopt::curve_publickey, keys.public_key);
      socket_.set(zmq::sockopt::curve_secretkey, keys.secret_key);
      socket_.set(zmq::sockopt::curve_serverkey, service.keys(Role::kReplay).public_key);
    }
    socket_.connect(service.server().endpoint());
  }

  bool Send(std::string_view part, bool more) {
    const int flags = ZMQ_DONTWAIT | (more ? ZMQ_SNDMORE : 0);
    return zmq_send(socket_.handle(), part.data(), part.size(), flags) >= 0;
  }

  /// The next part, if one has come.
  std::optional<std::string> Receive() {
    zmq::message_t part;
    if (zmq_msg_recv(part.handle(), socket_.handle(), ZMQ_DONTWAIT) < 0) return std::nullopt;
    return part.to_string();
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
};

class HostileTest : public ::testing::TestWithParam<Wire> {
 protected:
  /// Whether somebody honest, who comes now, is served.
  static void ExpectServed(Service& service) {
    const auto client = service.NewClient();
    SendTo(*client, Text("honest"));
    Server::Received received = ReceiveFrom(service.server());
    while (HeaderOf(received.message) != "honest") received = ReceiveFrom(service.server());
    EXPECT_FALSE(received.too_fast);
    ASSERT_EQ(service.server().Send(received.peer, Text("served")), Server::Sent::kYes);
    EXPECT_EQ(HeaderOf(ReceiveFrom(*client)), "served");
  }

  static void UntilRejected(Service& service, std::int64_t count) {
    Until([&] {
      EXPECT_FALSE(service.server().Receive(1ms));
      return service.server().connections().rejected >= count;
    });
    EXPECT_EQ(service.server().connections().rejected, count);
  }
};

INSTANTIATE_TEST_SUITE_P(Wires, HostileTest, ::testing::Values(Wire::kPlaintext, Wire::kCurve),
                         ::testing::PrintToStringParamName());

TEST_P(HostileTest, BytesThatAreNotZeroMqAreRejectedAndCounted) {
  Service service(GetParam());
  std::string zeros(1000, '\0');
  base::Random random(1);
  std::string noise(100'000, '\0');
  for (char& c : noise) c = static_cast<char>(random.UniformInt(256));
  const std::string strangers[] = {
      "GET /metrics HTTP/1.1\r\nHost: localhost\r\nAccept: */*\r\n\r\n",
      "SSH-2.0-OpenSSH_9.2p1\r\n" + zeros,
      noise,
      "\x01" + zeros,                                         // Oldest ZeroMQ, empty id.
      std::string("\xff\0\0\0\0\0\0\0\x01\x7f", 10) + noise,  // Greeting, then noise.
      ""};
  std::int64_t count = 0;
  for (const std::string& bytes : strangers) {
    {
      RawSocket stranger(service.server().endpoint());
      stranger.Write(bytes);
    }
    UntilRejected(service, ++count);
  }
  EXPECT_EQ(service.server().malformed(), 0);
  ExpectServed(service);
}

TEST_P(HostileTest, MessagesOfOtherThanTwoPartsAreCountedAndPassedOver) {
  Service service(GetParam());
  RawPeer peer(service, GetParam());
  ASSERT_TRUE(peer.Send("alone", false));
  ASSERT_TRUE(peer.Send("one", true) && peer.Send("two", true) && peer.Send("three", false));
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(peer.Send("many", i < 999));
  ASSERT_TRUE(peer.Send("a", true) && peer.Send("pair", false));
  const auto received = ReceiveFrom(service.server());
  EXPECT_EQ(HeaderOf(received.message), "a");
  EXPECT_EQ(PayloadOf(received.message), "pair");
  EXPECT_EQ(service.server().malformed(), 3);
}

TEST_P(HostileTest, BytesThatWaitForAPeerThatDoesNotReadAreBounded) {
#ifdef __SANITIZE_THREAD__
  // It reports, and suppresses, a race with ZeroMQ's thread for each byte of 36 MB.
  GTEST_SKIP() << "too slow under ThreadSanitizer";
#endif
  constexpr std::size_t kSize = 256 << 10;
  constexpr int kBound = 16;    // Messages of that size.
  constexpr int kKernel = 128;  // More than the kernel and the peer's socket take.
  ServerOptions options;
  options.queue_messages = 10000;
  options.max_queued_bytes = kBound * kSize;
  Service service(GetParam(), options);
  Server& server = service.server();
  RawPeer deaf(service, GetParam());
  ASSERT_TRUE(deaf.Send("hello", true) && deaf.Send("", false));
  const PeerId peer = ReceiveFrom(server).peer;
  const Frame payload = Frame::Copy(std::string(kSize, 'x'));
  int num_sent = 0;
  for (int i = 0; i < 10000; ++i) {
    Message message{Frame::Copy(std::to_string(num_sent)), payload.Share()};
    if (server.Send(peer, std::move(message)) == Server::Sent::kYes) ++num_sent;
  }
  EXPECT_GE(num_sent, kBound);
  EXPECT_LT(num_sent, kBound + kKernel);
  EXPECT_EQ(server.Send(peer, Text("small")), Server::Sent::kYes);
  ExpectServed(service);

  // Each message that was taken arrives, and then there is room.
  int num_received = 0;
  Until([&] {
    server.Receive(1ms);
    const auto header = deaf.Receive();
    if (!header) return false;
    std::optional<std::string> body;
    Until([&] { return (body = deaf.Receive()).has_value(); });
    if (*header == "small") return true;
    EXPECT_EQ(*header, std::to_string(num_received++));
    EXPECT_EQ(body->size(), kSize);
    return false;
  });
  EXPECT_EQ(num_received, num_sent);
  Until([&] { return server.Send(peer, {{}, payload.Share()}) == Server::Sent::kYes; });
}

TEST_P(HostileTest, APartOverTheBoundEndsTheConnection) {
  ServerOptions options;
  options.max_message_bytes = 1 << 16;
  Service service(GetParam(), options);
  const auto client = service.NewClient();
  SendTo(*client, Text("fits", std::string(60'000, 'x')));
  EXPECT_EQ(PayloadOf(ReceiveFrom(service.server()).message).size(), 60'000u);
  SendTo(*client, Text("does not", std::string(70'000, 'x')));
  Until([&] {
    EXPECT_FALSE(service.server().Receive(1ms));
    return !client->connected();
  });
  // It may come again.
  SendTo(*client, Text("fits"));
  EXPECT_EQ(HeaderOf(ReceiveFrom(service.server()).message), "fits");
  EXPECT_EQ(client->connections(), 2);
  ExpectServed(service);
}

TEST_P(HostileTest, AClientsBoundOnPartsHoldsToo) {
  Service service(GetParam());
  ClientOptions options;
  options.max_message_bytes = 1 << 16;
  const auto client = service.NewClient(Role::kActor, options);
  SendTo(*client, Text("hello"));
  const auto received = ReceiveFrom(service.server());
  ASSERT_EQ(service.server().Send(received.peer, Text("", std::string(70'000, 'x'))),
            Server::Sent::kYes);
  // ZeroMQ itself would never connect again.
  Until([&] {
    EXPECT_FALSE(client->Receive(1ms));
    return client->connections() == 2;
  });
  SendTo(*client, Text("hello again"));
  EXPECT_EQ(HeaderOf(ReceiveFrom(service.server()).message), "hello again");
}

/// A part of 48 KiB after which the message goes on. By hand, as ZeroMQ sends nothing of a message
/// before it is whole.
std::string LongPart() {
  constexpr char kMoreAndLong = 3;
  const std::string size("\0\0\0\0\0\0\xc0\0", 8);
  return kMoreAndLong + size + std::string(48 << 10, 'x');
}

TEST(EndlessTest, AMessageWithoutEndEndsTheConnection) {
  ServerOptions options;
  options.max_message_bytes = 1 << 16;
  options.max_pending_bytes = 1 << 20;
  Service service(Wire::kPlaintext, options);
  RawSocket peer(service.server().endpoint());
  peer.ShakeHands();
  const std::string part = LongPart();
  Until([&] {
    const bool is_open = peer.Write(part);
    EXPECT_FALSE(service.server().Receive(1ms));
    return !is_open;
  });
  EXPECT_EQ(service.server().connections().ended.at(EndReason::kBytes), 1);
  EXPECT_EQ(service.server().malformed(), 0);
}

// What framing may add is allowed for generously, and small messages need little of it.
TEST(EndlessTest, SmallMessagesSaveNothingForALongOne) {
  ServerOptions options;
  options.max_message_bytes = 1 << 16;
  options.max_pending_bytes = 1 << 20;
  options.max_messages_per_second = 1e9;
  Service service(Wire::kPlaintext, options);
  RawSocket peer(service.server().endpoint());
  peer.ShakeHands();
  const std::string of_two_parts("\1\1h\0\0", 5);
  for (int i = 0; i < 8000; ++i) {
    ASSERT_TRUE(peer.Write(of_two_parts));
    EXPECT_EQ(HeaderOf(ReceiveFrom(service.server()).message), "h");
  }
  // Long enough for the server to look at its connections.
  EXPECT_FALSE(service.server().Receive(300ms));
  EXPECT_FALSE(service.server().Receive(1ms));
  const std::string part = LongPart();
  for (int i = 0; i < 40; ++i) peer.Write(part);
  Until([&] {
    EXPECT_FALSE(service.server().Receive(1ms));
    return service.server().connections().ended.at(EndReason::kBytes) == 1;
  });
}

TEST_P(HostileTest, HonestTrafficIsFarFromTheBoundOnPendingBytes) {
  ServerOptions options;
  options.max_pending_bytes = 1 << 20;
  options.max_messages_per_second = 1e9;
  Service service(GetParam(), options);
  const auto client = service.NewClient();
  // In all a hundred times the bound, in small messages and in large ones.
  const Frame large = Pattern(100'000, 1);
  for (int i = 0; i < 1000; ++i) {
    SendTo(*client, {Frame::Copy("large"), large.Share()});
    EXPECT_EQ(HeaderOf(ReceiveFrom(service.server()).message), "large");
    for (int j = 0; j < 10; ++j) SendTo(*client, Text("small"));
    for (int j = 0; j < 10; ++j) {
      EXPECT_EQ(HeaderOf(ReceiveFrom(service.server()).message), "small");
    }
  }
  EXPECT_EQ(client->connections(), 1);
  for (const auto& [reason, count] : service.server().connections().ended) EXPECT_EQ(count, 0);
}

TEST_P(HostileTest, WhoIsOverTheRateIsSaidToBeAndOthersAreNot) {
  ServerOptions options;
  options.max_messages_per_second = 10.0;
  Service service(GetParam(), options);
  const auto client = service.NewClient();
  int num_admitted = 0;
  const auto begin = std::chrono::steady_clock::now();
  constexpr int kCount = 2000;
  for (int i = 0; i < kCount; ++i) {
    SendTo(*client, Text("flood"));
    num_admitted += ReceiveFrom(service.server()).too_fast ? 0 : 1;
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  EXPECT_GE(num_admitted, 10);
  EXPECT_LE(num_admitted, 10 + 10 * seconds.count() + 1);
  EXPECT_LT(num_admitted, kCount);
  ExpectServed(service);
}

// The next one learns why, and those that were there stay.
TEST_P(HostileTest, AConnectionBeyondTheBoundIsToldSoAndEnds) {
  ServerOptions options;
  options.max_connections = 3;
  Service service(GetParam(), options);
  std::vector<std::unique_ptr<Client>> clients;
  PeerId last;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(service.NewClient());
    SendTo(*clients.back(), Text("hello"));
    const auto received = ReceiveFrom(service.server());
    EXPECT_FALSE(received.no_room);
    last = received.peer;
  }
  const auto one_more = service.NewClient();
  SendTo(*one_more, Text("hello"));
  const auto received = ReceiveFrom(service.server());
  EXPECT_TRUE(received.no_room);
  ASSERT_EQ(service.server().Send(received.peer, Text("no room")), Server::Sent::kYes);
  EXPECT_EQ(HeaderOf(ReceiveFrom(*one_more)), "no room");
  Until([&] {
    EXPECT_FALSE(service.server().Receive(1ms));
    return !one_more->connected();
  });
  const auto connections = service.server().connections();
  EXPECT_EQ(connections.ended.at(EndReason::kConnections), 1);
  EXPECT_EQ(connections.rejected, 0);
  EXPECT_EQ(connections.open, 3);
  EXPECT_EQ(connections.limit, 3);
  clients.pop_back();
  Until([&] {
    EXPECT_FALSE(service.server().Receive(1ms));
    return service.server().Send(last, Text("gone?")) == Server::Sent::kGone;
  });
  ExpectServed(service);
  for (const auto& client : clients) EXPECT_EQ(client->connections(), 1);
}

TEST(OperatorTest, AnOperatorIsServedWhereOthersFindNoRoom) {
  ServerOptions options;
  options.max_connections = 1;
  Service service(Wire::kCurve, options);
  const auto actor = service.NewClient(Role::kActor);
  SendTo(*actor, Text("hello"));
  EXPECT_FALSE(ReceiveFrom(service.server()).no_room);
  const auto second = service.NewClient(Role::kActor);
  SendTo(*second, Text("hello"));
  EXPECT_TRUE(ReceiveFrom(service.server()).no_room);
  const auto operator_ = service.NewClient(Role::kOperator);
  SendTo(*operator_, Text("hello"));
  EXPECT_FALSE(ReceiveFrom(service.server()).no_room);
}

// Whoever comes first, operators have eight places, and others as many as the limit says.
TEST(OperatorTest, OperatorsAndOthersHavePlacesOfTheirOwn) {
  ServerOptions options;
  options.max_connections = 9;
  Service service(Wire::kCurve, options);
  std::vector<std::unique_ptr<Client>> clients;
  const auto has_room = [&](Role role) {
    clients.push_back(service.NewClient(role));
    SendTo(*clients.back(), Text("hello"));
    return !ReceiveFrom(service.server()).no_room;
  };
  for (int i = 0; i < 8; ++i) {
    EXPECT_TRUE(has_room(Role::kActor)) << i;
    EXPECT_TRUE(has_room(Role::kOperator)) << i;
  }
  EXPECT_FALSE(has_room(Role::kOperator));
  EXPECT_TRUE(has_room(Role::kActor));
  EXPECT_FALSE(has_room(Role::kActor));
}

// A learner that writes a checkpoint looks after nobody, and ZeroMQ takes every connection.
TEST_P(HostileTest, BoundsHoldWhileTheServerIsBusy) {
  ServerOptions options;
  options.max_handshakes = 1;
  options.heartbeat = 30min;  // ZeroMQ itself ends no handshake while this test lasts.
  std::vector<RawSocket> strangers;
  std::atomic<int> num_ended = 0;
  std::vector<std::jthread> readers;
  Service service(GetParam(), options);  // Its end is that of the last stranger.
  for (int i = 0; i < 40; ++i) strangers.emplace_back(service.server().endpoint());
  for (RawSocket& stranger : strangers) {
    readers.emplace_back([&] {
      stranger.ReadToEnd();
      ++num_ended;
    });
  }
  while (num_ended < 39) std::this_thread::yield();
  ExpectServed(service);
}

// Whatever a process may have open, something is left for files and for those that come between two
// looks at the connections.
TEST(PlacesTest, FollowFromTheDescriptorsOfTheProcess) {
  const ServerOptions options{.endpoint = "tcp://*:5550"};
  for (int descriptors = 320; descriptors <= 70000; descriptors += 40) {
    const Places places = PlacesWithin(descriptors, options);
    const int shared = descriptors - 256 - 8 - places.connections - places.newcomers;
    EXPECT_GE(shared, descriptors < 16384 ? (descriptors - 264) / 3 : 4096) << descriptors;
    EXPECT_GE(places.handshakes, 4) << descriptors;
    EXPECT_GE(places.newcomers, places.handshakes) << descriptors;
    EXPECT_GE(places.connections, 28) << descriptors;
  }
  EXPECT_EQ(PlacesWithin(1024, options).connections, 380);
  const Places places = PlacesWithin(65536, options);
  EXPECT_EQ(places.connections, options.max_connections);
  EXPECT_EQ(places.handshakes, options.max_handshakes);
  EXPECT_THAT([&] { PlacesWithin(319, options); },
              ::testing::ThrowsMessage<base::Error>(::testing::AllOf(
                  ::testing::HasSubstr("found a limit of 319"), ::testing::HasSubstr("320"))));
}

TEST(PlacesTest, FewerThanAreConfiguredAreSaid) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit low{.rlim_cur = 1024, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  const slalom::test::LogLines log;
  Service service(Wire::kPlaintext);
  EXPECT_EQ(service.server().max_connections(), 380);
  EXPECT_EQ(service.server().connections().limit, 380);
  EXPECT_TRUE(log.Has("takes 380 connections at most, fewer than service.max_connections (4096)"));
  setrlimit(RLIMIT_NOFILE, &before);
}

// They have places of their own, and of those the oldest give way.
TEST_P(HostileTest, StrangersWhoSayNothingTakeNobodysPlace) {
  ServerOptions options;
  options.max_connections = 3;
  options.max_handshakes = 5;
  Service service(GetParam(), options);
  const auto client = service.NewClient();
  SendTo(*client, Text("hello"));
  ReceiveFrom(service.server());
  std::vector<RawSocket> strangers;
  for (int i = 0; i < 50; ++i) strangers.emplace_back(service.server().endpoint());
  ExpectServed(service);
  Until([&] {
    EXPECT_FALSE(service.server().Receive(1ms));
    return service.server().connections().ended.at(EndReason::kHandshakes) >= 45;
  });
  strangers[0].ReadToEnd();
  ExpectServed(service);
  // Nobody showed a wrong key.
  EXPECT_EQ(service.server().connections().rejected, 0);
  EXPECT_EQ(client->connections(), 1);
}

// Each connection is a new peer, and none of them may leave anything behind: in a sanitizer's run
// growth would be seen as such, and here as a connection that is refused.
TEST_P(HostileTest, PeersThatComeAndGoLeaveRoomForTheNext) {
  ServerOptions options;
  options.max_connections = 4;
  Service service(GetParam(), options);
  for (int i = 0; i < 100; ++i) {
    const auto client = service.NewClient();
    SendTo(*client, Text("hello"));
    EXPECT_FALSE(ReceiveFrom(service.server()).too_fast);
  }
  ExpectServed(service);
}

TEST_P(HostileTest, AnIdChosenByAPeerTakesNothingFromAnother) {
  Service service(GetParam());
  const auto honest = service.NewClient();
  SendTo(*honest, Text("hello"));
  const PeerId victim = ReceiveFrom(service.server()).peer;
  RawPeer thief(service, GetParam(), victim);
  ASSERT_TRUE(thief.Send("mine now", true) && thief.Send("", false));
  // Its connection is there before the next one is served.
  ExpectServed(service);
  ASSERT_EQ(service.server().Send(victim, Text("for the honest")), Server::Sent::kYes);
  EXPECT_EQ(HeaderOf(ReceiveFrom(*honest)), "for the honest");
}

TEST(SilenceTest, AServerEndsAConnectionThatFallsSilent) {
  ServerOptions options;
  options.heartbeat = 20ms;
  Service service(Wire::kPlaintext, options);
  RawSocket peer(service.server().endpoint());
  peer.ShakeHands();
  peer.ReadToEnd();
}

TEST(SilenceTest, AServerEndsAConnectionThatNeverShakesHands) {
  ServerOptions options;
  options.heartbeat = 20ms;
  Service service(Wire::kPlaintext, options);
  RawSocket peer(service.server().endpoint());
  peer.ReadToEnd();
  Until([&] {
    EXPECT_FALSE(service.server().Receive(1ms));
    return service.server().connections().rejected == 1;
  });
}

/// The next connection of `client`, which connects again only when it is polled.
RawSocket Accept(RawListener& listener, Client& client) {
  auto accepted = std::async(std::launch::async, [&] { return listener.Accept(); });
  Until([&] {
    EXPECT_FALSE(client.Receive(1ms));
    return accepted.wait_for(0s) == std::future_status::ready;
  });
  return accepted.get();
}

TEST(SilenceTest, AClientTriesAgainWhereAListenerAcceptsAndNeverAnswers) {
  RawListener listener;
  Context context;
  ClientOptions options;
  options.endpoint = listener.endpoint();
  options.heartbeat = 20ms;
  Client client(context, options);
  for (int i = 0; i < 3; ++i) {
    RawSocket connection = Accept(listener, client);
    EXPECT_FALSE(client.Send(Text("hello")));
    connection.ReadToEnd();
    EXPECT_EQ(client.connections(), 0);
  }
}

TEST(SilenceTest, AClientTriesAgainWhereAServerFallsSilent) {
  RawListener listener;
  Context context;
  ClientOptions options;
  options.endpoint = listener.endpoint();
  options.heartbeat = 20ms;
  Client client(context, options);
  for (int i = 1; i <= 2; ++i) {
    RawSocket connection = Accept(listener, client);
    connection.ShakeHands();
    Until([&] {
      EXPECT_FALSE(client.Receive(1ms));
      return client.connections() == i;
    });
    connection.ReadToEnd();
  }
}

TEST(SilenceTest, ReconnectLeavesAListenerThatNeverAnswersAtOnce) {
  RawListener listener;
  Context context;
  ClientOptions options;
  options.endpoint = listener.endpoint();
  options.heartbeat = 10min;
  Client client(context, options);
  RawSocket first = listener.Accept();
  client.Reconnect();
  RawSocket second = listener.Accept();
  first.ReadToEnd();
}

TEST(SilenceTest, AClientOutlivesAServerThatIsNone) {
  RawListener listener;
  Context context;
  ClientOptions options;
  options.endpoint = listener.endpoint();
  Client client(context, options);
  {
    RawSocket connection = Accept(listener, client);
    connection.Write("HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n");
  }
  Accept(listener, client);
  EXPECT_EQ(client.connections(), 0);
  EXPECT_NE(client.trouble(), "");
}

}  // namespace
}  // namespace slalom::transport::test
