#include <gmock/gmock.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "tests/proto/transport/service.h"
#include "tests/support/failing_calls.h"

/// What holds of messages and connections whatever the wire.

namespace slalom::transport::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

ServerOptions ServerWithQueue(int messages) {
  ServerOptions options;
  options.queue_messages = messages;
  return options;
}

ClientOptions ClientWithQueue(int messages) {
  ClientOptions options;
  options.queue_messages = messages;
  return options;
}

/// Compares by `memcmp`, which ThreadSanitizer checks as one access. Byte by byte, it would report,
/// and suppress, a race with ZeroMQ's thread for each of 20 million bytes.
bool SameBytes(const Frame& a, const Frame& b) {
  return a.size() == b.size() &&
         (a.size() == 0 || std::memcmp(a.bytes().data(), b.bytes().data(), a.size()) == 0);
}

class MessagesTest : public ::testing::TestWithParam<Wire> {
 protected:
  bool is_inproc() const { return GetParam() == Wire::kInproc; }
};

INSTANTIATE_TEST_SUITE_P(Wires, MessagesTest,
                         ::testing::Values(Wire::kInproc, Wire::kPlaintext, Wire::kCurve),
                         ::testing::PrintToStringParamName());

TEST_P(MessagesTest, ARequestIsAnswered) {
  Service service(GetParam());
  const auto client = service.NewClient();
  SendTo(*client, Text("hello", "raw"));
  const auto received = ReceiveFrom(service.server());
  EXPECT_EQ(HeaderOf(received.message), "hello");
  EXPECT_EQ(PayloadOf(received.message), "raw");
  EXPECT_FALSE(received.too_fast);
  ASSERT_EQ(service.server().Send(received.peer, Text("welcome")), Server::Sent::kYes);
  const Message reply = ReceiveFrom(*client);
  EXPECT_EQ(HeaderOf(reply), "welcome");
  EXPECT_EQ(PayloadOf(reply), "");
  EXPECT_EQ(client->connections(), 1);
  EXPECT_TRUE(client->connected());
  EXPECT_EQ(client->trouble(), "");
  EXPECT_EQ(service.server().connections().rejected, 0);
  EXPECT_EQ(service.server().malformed(), 0);
}

TEST_P(MessagesTest, TheRoleFollowsFromTheKeyAndPlaintextHasNone) {
  Service service(GetParam());
  for (const Role role : kRoles) {
    const auto client = service.NewClient(role);
    SendTo(*client, Text("hello"));
    const auto received = ReceiveFrom(service.server());
    EXPECT_EQ(received.role, GetParam() == Wire::kCurve ? std::optional<Role>(role) : std::nullopt);
  }
}

TEST_P(MessagesTest, EachPeersMessagesComeInTheirOrder) {
  constexpr int kCount = 500;
  Service service(GetParam());
  const std::unique_ptr<Client> clients[] = {service.NewClient(), service.NewClient(),
                                             service.NewClient()};
  std::vector<int> num_sent(std::size(clients), 0);
  std::map<std::string, int> num_received;  // By what the peer calls itself.
  std::map<std::string, PeerId> peers;
  const auto all = [&] {
    return num_received.size() == std::size(clients) &&
           std::all_of(num_received.begin(), num_received.end(),
                       [](const auto& entry) { return entry.second == kCount; });
  };
  Until([&] {
    for (std::size_t i = 0; i < std::size(clients); ++i) {
      while (num_sent[i] < kCount &&
             clients[i]->Send(Text(std::to_string(i), std::to_string(num_sent[i])))) {
        ++num_sent[i];
      }
    }
    while (const auto received = service.server().Receive(1ms)) {
      const std::string name = HeaderOf(received->message);
      EXPECT_EQ(PayloadOf(received->message), std::to_string(num_received[name]++));
      EXPECT_EQ(peers.emplace(name, received->peer).first->second, received->peer);
    }
    return all();
  });
  // And each is answered by its own name.
  for (const auto& [name, peer] : peers) {
    ASSERT_EQ(service.server().Send(peer, Text(name)), Server::Sent::kYes);
  }
  for (std::size_t i = 0; i < std::size(clients); ++i) {
    EXPECT_EQ(HeaderOf(ReceiveFrom(*clients[i])), std::to_string(i));
  }
}

TEST_P(MessagesTest, PayloadsOfEverySizeArriveUnchangedAndAligned) {
  Service service(GetParam());
  const auto client = service.NewClient();
  unsigned seed = 0;
  for (const std::size_t size :
       {0, 1, 7, 8, 32, 33, 34, 255, 256, 4096, 8191, 8192, 8193, 95'000, 740'000, 20'000'000}) {
    const Frame payload = Pattern(size, ++seed);
    // The odd header moves what follows it in ZeroMQ's buffers.
    SendTo(*client, {Pattern(seed, seed), payload.Share()});
    auto received = ReceiveFrom(service.server());
    const auto is_aligned = [](const Frame& frame) {
      return reinterpret_cast<std::uintptr_t>(frame.bytes().data()) % 8 == 0;
    };
    EXPECT_EQ(received.message.header.size(), seed);
    EXPECT_TRUE(is_aligned(received.message.header)) << size;
    EXPECT_TRUE(is_aligned(received.message.payload)) << size;
    EXPECT_TRUE(SameBytes(received.message.payload, payload)) << size;
    ASSERT_EQ(service.server().Send(received.peer, std::move(received.message)),
              Server::Sent::kYes);
    EXPECT_TRUE(SameBytes(ReceiveFrom(*client).payload, payload)) << size;
  }
}

TEST(FrameTest, ShareIsAnotherReferenceToTheSameBytes) {
  const Frame first = Pattern(1 << 20, 1);
  const Frame second = first.Share();
  EXPECT_EQ(first.bytes().data(), second.bytes().data());
  EXPECT_EQ(second.size(), first.size());
  const Frame copy = Frame::Copy(first.bytes());
  EXPECT_NE(copy.bytes().data(), first.bytes().data());
  EXPECT_TRUE(SameBytes(copy, first));
}

TEST(FrameTest, WithinAProcessTheBytesAreNotCopied) {
  Service service(Wire::kInproc);
  const auto client = service.NewClient();
  const Frame payload = Pattern(1 << 20, 1);
  SendTo(*client, {Frame::Copy("hello"), payload.Share()});
  const auto received = ReceiveFrom(service.server());
  EXPECT_EQ(received.message.payload.bytes().data(), payload.bytes().data());
}

TEST_P(MessagesTest, AQueueThatIsFullIsSaidAndOthersAreServed) {
  Service service(GetParam(), ServerWithQueue(4));
  const auto reader = service.NewClient(Role::kActor, ClientWithQueue(4));
  SendTo(*reader, Text("hello"));
  const PeerId slow = ReceiveFrom(service.server()).peer;
  // Beyond what the kernel holds.
  const Frame payload = Pattern(1 << 20, 1);
  int num_sent = 0;
  Server::Sent sent = Server::Sent::kYes;
  Until([&] {
    Message message{Frame::Copy(std::to_string(num_sent)), payload.Share()};
    sent = service.server().Send(slow, std::move(message));
    if (sent == Server::Sent::kYes) {
      ++num_sent;
    } else {
      EXPECT_EQ(HeaderOf(message), std::to_string(num_sent)) << "the message must not be taken";
      EXPECT_EQ(message.payload.size(), payload.size());
    }
    return sent != Server::Sent::kYes;
  });
  EXPECT_EQ(sent, Server::Sent::kFull);
  const auto other = service.NewClient();
  SendTo(*other, Text("me"));
  const auto received = ReceiveFrom(service.server());
  EXPECT_EQ(service.server().Send(received.peer, Text("you")), Server::Sent::kYes);
  EXPECT_EQ(HeaderOf(ReceiveFrom(*other)), "you");
  // What may still have been on its way into the kernel only makes room.
  int num_received = 0;
  Until([&] {
    if (service.server().Send(slow, {Frame::Copy(std::to_string(num_sent)), payload.Share()}) ==
        Server::Sent::kYes) {
      ++num_sent;
      return true;
    }
    if (const auto message = reader->Receive(1ms)) {
      EXPECT_EQ(HeaderOf(*message), std::to_string(num_received++));
    }
    return false;
  });
  for (; num_received < num_sent; ++num_received) {
    EXPECT_EQ(HeaderOf(ReceiveFrom(*reader)), std::to_string(num_received));
  }
}

TEST_P(MessagesTest, AClientsQueueThatIsFullIsSaid) {
  Service service(GetParam(), ServerWithQueue(4));
  const auto client = service.NewClient(Role::kActor, ClientWithQueue(4));
  SendTo(*client, Text("0"));
  const Frame payload = Pattern(1 << 20, 1);
  int num_sent = 1;
  Until([&] {
    Message message{Frame::Copy(std::to_string(num_sent)), payload.Share()};
    if (client->Send(std::move(message))) {
      ++num_sent;
      return false;
    }
    EXPECT_EQ(HeaderOf(message), std::to_string(num_sent)) << "the message must not be taken";
    EXPECT_EQ(message.payload.size(), payload.size());
    return true;
  });
  for (int i = 0; i < num_sent; ++i) {
    EXPECT_EQ(HeaderOf(ReceiveFrom(service.server()).message), std::to_string(i));
  }
}

TEST_P(MessagesTest, APeerThatVanishedIsGone) {
  Service service(GetParam());
  auto client = service.NewClient();
  SendTo(*client, Text("hello"));
  const PeerId peer = ReceiveFrom(service.server()).peer;
  client.reset();
  Message message = Text("still there?", "payload");
  Until([&] {
    service.server().Receive(1ms);
    const auto sent = service.server().Send(peer, std::move(message));
    if (sent == Server::Sent::kYes) message = Text("still there?", "payload");
    return sent == Server::Sent::kGone;
  });
  EXPECT_EQ(PayloadOf(message), "payload") << "the message must not be taken";
  EXPECT_EQ(service.server().Send("nobody", Text("hello")), Server::Sent::kGone);
  EXPECT_EQ(service.server().Send("", Text("hello")), Server::Sent::kGone);
}

TEST_P(MessagesTest, WithoutAConnectionNothingIsTaken) {
  if (is_inproc()) GTEST_SKIP() << "a server in the process is there or comes; ZeroMQ queues";
  Service service(GetParam());
  service.StopServer();
  const auto client = service.NewClient();
  Message message = Text("hello", "payload");
  EXPECT_FALSE(client->Send(std::move(message)));
  EXPECT_EQ(PayloadOf(message), "payload");
  EXPECT_FALSE(client->Receive(1ms));
  EXPECT_EQ(client->connections(), 0);
  Until([&] {
    client->Receive(10ms);
    return client->trouble() == "nobody listens there";
  });
}

TEST_P(MessagesTest, AServerThatComesBackOnItsPortIsFoundAgain) {
  if (is_inproc()) GTEST_SKIP() << "both ends live and die together";
  Service service(GetParam());
  const auto client = service.NewClient();
  for (int i = 1; i <= 3; ++i) {
    SendTo(*client, Text("hello"));
    EXPECT_EQ(client->connections(), i);
    const auto received = ReceiveFrom(service.server());
    ASSERT_EQ(service.server().Send(received.peer, Text("welcome")), Server::Sent::kYes);
    EXPECT_EQ(HeaderOf(ReceiveFrom(*client)), "welcome");
    service.StopServer();
    Until([&] {
      client->Receive(1ms);
      return !client->connected();
    });
    EXPECT_NE(client->trouble(), "");
    service.StartServer();
  }
}

// With ZMQ_IMMEDIATE, libzmq 4.3.4 aborts here: it handles the break between two parts of a
// message.
TEST_P(MessagesTest, AConnectionMayBreakWhileMessagesWait) {
  if (is_inproc()) GTEST_SKIP() << "both ends live and die together";
  constexpr int kMessages = 400;
  Service service(GetParam(), ServerWithQueue(kMessages));
  const auto client = service.NewClient();
  for (int connection = 1; connection <= 3; ++connection) {
    SendTo(*client, Text("hello"));
    EXPECT_EQ(client->connections(), connection);
    const PeerId peer = ReceiveFrom(service.server()).peer;
    for (int i = 0; i < kMessages; ++i) {
      ASSERT_EQ(service.server().Send(peer, Text(std::to_string(i))), Server::Sent::kYes);
    }
    int num_received = 0;
    for (; num_received < kMessages / 2; ++num_received) {
      EXPECT_EQ(HeaderOf(ReceiveFrom(*client)), std::to_string(num_received));
    }
    service.StopServer();
    Until([&] { return !client->connected(); });
    while (const auto message = client->Receive(0ms)) {
      EXPECT_EQ(HeaderOf(*message), std::to_string(num_received++));
    }
    service.StartServer();
  }
}

TEST_P(MessagesTest, ReconnectStartsAnewAsAnotherPeer) {
  Service service(GetParam());
  const auto client = service.NewClient();
  SendTo(*client, Text("first"));
  const auto first = ReceiveFrom(service.server());
  ASSERT_EQ(service.server().Send(first.peer, Text("lost")), Server::Sent::kYes);
  client->Reconnect();
  SendTo(*client, Text("second"));
  const auto second = ReceiveFrom(service.server());
  EXPECT_EQ(HeaderOf(second.message), "second");
  EXPECT_NE(second.peer, first.peer);
  EXPECT_EQ(client->connections(), 2);
  ASSERT_EQ(service.server().Send(second.peer, Text("found")), Server::Sent::kYes);
  EXPECT_EQ(HeaderOf(ReceiveFrom(*client)), "found");
}

TEST_P(MessagesTest, WakeEndsAReceive) {
  Service service(GetParam());
  // Before it, so that the next one ends; then while one waits, from another thread.
  service.server().Wake();
  EXPECT_FALSE(service.server().Receive(kPatience));
  std::jthread waker([&] { service.server().Wake(); });
  EXPECT_FALSE(service.server().Receive(kPatience));
  // Several are one, and a message is not lost over them.
  const auto client = service.NewClient();
  SendTo(*client, Text("hello"));
  for (int i = 0; i < 3; ++i) service.server().Wake();
  EXPECT_EQ(HeaderOf(ReceiveFrom(service.server()).message), "hello");
}

TEST_P(MessagesTest, OneThreadWaitsForSeveralClients) {
  Service first(GetParam());
  Service second(GetParam());
  const auto a = first.NewClient();
  const auto b = second.NewClient();
  SendTo(*a, Text("hello"));
  SendTo(*b, Text("hello"));
  ReceiveFrom(first.server());
  const auto received = ReceiveFrom(second.server());
  ASSERT_EQ(second.server().Send(received.peer, Text("from the second")), Server::Sent::kYes);
  Client::WaitForAny({a.get(), b.get()}, kPatience);
  EXPECT_FALSE(a->Receive(0ms));
  const auto reply = b->Receive(0ms);
  ASSERT_TRUE(reply);
  EXPECT_EQ(HeaderOf(*reply), "from the second");
}

TEST_P(MessagesTest, ServersOfOneContextKeepTheirPeersApart) {
  Context context;
  ServerOptions options{.endpoint = is_inproc() ? "inproc://a" : "tcp://127.0.0.1:*"};
  ClientSecurity security;
  const KeyPair mine = NewKeyPair();
  if (GetParam() == Wire::kCurve) {
    options.security = {NewKeyPair(), {{mine.public_key, Role::kActor}}};
    security = {mine, options.security.keys->public_key};
  }
  Server first(context, options);
  if (is_inproc()) options.endpoint = "inproc://b";
  // Here the same key has another role.
  if (GetParam() == Wire::kCurve) options.security.allowed = {{mine.public_key, Role::kLearner}};
  Server second(context, options);
  Client a(context, {.endpoint = first.endpoint(), .security = security});
  Client b(context, {.endpoint = second.endpoint(), .security = security});
  SendTo(a, Text("a"));
  SendTo(b, Text("b"));
  const auto at_first = ReceiveFrom(first);
  const auto at_second = ReceiveFrom(second);
  EXPECT_EQ(HeaderOf(at_first.message), "a");
  EXPECT_EQ(HeaderOf(at_second.message), "b");
  if (GetParam() == Wire::kCurve) {
    EXPECT_EQ(at_first.role, Role::kActor);
    EXPECT_EQ(at_second.role, Role::kLearner);
  }
}

TEST(ContextTest, AThreadThatCannotBeStartedIsAnError) {
  for (const int first : {1, 2, 3}) {
    const slalom::test::FailingCalls failing({.function = "pthread_create",
                                              .path = "thread",
                                              .error = EAGAIN,
                                              .first = first,
                                              .last = 1000},
                                             "none");
    EXPECT_THAT([] { Context context(2); },
                ::testing::ThrowsMessage<base::Error>(HasSubstr("a thread for ZeroMQ")));
  }
}

TEST(EndpointTest, OneThatCannotBeUsedIsNamedWithTheReason) {
  Context context;
  const auto message_of = [](auto make) -> std::string {
    try {
      make();
    } catch (const base::Error& error) {
      return error.what();
    }
    return "no error";
  };
  const auto serve = [&](const std::string& endpoint) {
    return message_of([&] { Server server(context, {.endpoint = endpoint}); });
  };
  const auto connect = [&](const std::string& endpoint) {
    return message_of([&] { Client client(context, {.endpoint = endpoint}); });
  };
  for (const std::string endpoint :
       {"", "nonsense", "tcp://", "tcp://127.0.0.1", "tcp://127.0.0.1:x", "tcp://127.0.0.1:99999",
        "tcp://127.0.0.1:-1", "tcp://:5550", "udp://127.0.0.1:5550", "inproc://", "ipc://"}) {
    EXPECT_THAT(serve(endpoint),
                HasSubstr("'" + endpoint + "' is not an endpoint; expected tcp://"));
    EXPECT_THAT(connect(endpoint),
                HasSubstr("'" + endpoint + "' is not an endpoint; expected tcp://"));
  }
  EXPECT_THAT(connect("tcp://no host:1"), HasSubstr("tcp://no host:1: cannot connect ("));
  Server server(context, {.endpoint = "tcp://127.0.0.1:*"});
  EXPECT_THAT(serve(server.endpoint()), HasSubstr("Address already in use"));
  EXPECT_THAT(serve("tcp://192.0.2.1:5550"), HasSubstr("cannot listen ("));
}

}  // namespace
}  // namespace slalom::transport::test
