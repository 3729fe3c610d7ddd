#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <variant>

#include "proto/policy_link.h"
#include "proto/replay_link.h"
#include "proto/transport/server.h"
#include "tests/support/held_clock.h"

/// How a role keeps its links to servers that come and go.

namespace slalom::service {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::HeldClock;

/// More than the pause before a client connects again.
constexpr seconds kPause{2};
/// More than the silence after which a link asks.
constexpr seconds kSilence{6};

/// Calls `step` until it says true; the test's time limit ends it otherwise.
void Until(const std::function<bool()>& step) {
  while (!step()) std::this_thread::yield();
}

/// A server at the same endpoint each time, in the thread of the test.
class Far {
 public:
  Far() { Start(); }
  void Start() {
    server_.emplace(context_, transport::ServerOptions{.endpoint = endpoint_});
    endpoint_ = server_->endpoint();
  }
  void Stop() { server_.reset(); }
  const std::string& endpoint() const { return endpoint_; }

  /// The next message of this kind, if one has come.
  template <class Kind>
  std::optional<Kind> Take() {
    const auto received = server_->Receive(milliseconds(0));
    if (!received) return std::nullopt;
    peer_ = received->peer;
    const auto header =
        proto::Decode(received->message.header.bytes(), received->message.payload.bytes());
    const auto* kind = header ? std::get_if<Kind>(&*header) : nullptr;
    return kind ? std::optional(*kind) : std::nullopt;
  }
  /// Number of messages of this kind that the client has sent.
  template <class Kind>
  int Count(transport::Client& client) {
    const std::string last = proto::Encode(proto::StatusRequest{}, {});
    EXPECT_TRUE(client.Send({transport::Frame::Copy(last), {}}));
    for (int count = 0;;) {
      const auto received = server_->Receive(milliseconds(0));
      if (!received) continue;
      const auto header = proto::Decode(received->message.header.bytes(), {});
      if (std::holds_alternative<proto::StatusRequest>(*header)) return count;
      count += std::holds_alternative<Kind>(*header);
    }
  }
  void Answer(const proto::Header& header, std::string_view payload = "") {
    const auto bytes = transport::Frame::Copy(payload);
    const std::string encoded = proto::Encode(header, bytes.bytes());
    EXPECT_EQ(server_->Send(peer_, {transport::Frame::Copy(encoded), bytes.Share()}),
              transport::Server::Sent::kYes);
  }

 private:
  transport::Context context_;
  std::string endpoint_ = "tcp://127.0.0.1:*";
  std::optional<transport::Server> server_;
  transport::PeerId peer_;
};

/// A server, a link to it and a clock that stands still.
class ReplayLinkTest : public ::testing::Test {
 protected:
  ReplayLinkTest() : link_(context_, {.endpoint = far_.endpoint()}, HelloOfTheLink()) {}

  static proto::Hello HelloOfTheLink() {
    proto::Hello hello;
    hello.role = "learner";
    hello.name = "l";
    hello.session = 3;
    return hello;
  }
  /// The next hello of the link.
  proto::Hello ExpectHello() {
    std::optional<proto::Hello> hello;
    Until([&] {
      EXPECT_FALSE(link_.Receive(milliseconds(0)));
      hello = far_.Take<proto::Hello>();
      return hello.has_value();
    });
    return *hello;
  }
  /// Lets the link receive what the server says.
  void Say(const proto::Header& header) {
    far_.Answer(header);
    Until([&] { return link_.Receive(milliseconds(0)).has_value(); });
  }
  void Welcome() { Say(proto::Welcome{.session = 3, .window_bytes = 1, .software = "test"}); }

  HeldClock clock_;
  Far far_;
  transport::Context context_;
  ReplayLink link_;
};

TEST_F(ReplayLinkTest, SaysHelloOnceOnEachConnection) {
  for (int connection = 1; connection <= 3; ++connection) {
    EXPECT_EQ(ExpectHello().session, 3u);
    EXPECT_FALSE(link_.welcomed());
    far_.Answer(proto::Welcome{.session = 2, .window_bytes = 1, .software = "test"});
    Say(proto::StatusReply{});
    EXPECT_FALSE(link_.welcomed()) << "an answer to an earlier hello";
    int num_reports = 0;
    const auto report = [&] {
      link_.ReportEverySecond([&] {
        ++num_reports;
        return proto::Report{.role = "learner", .name = "l", .figures = {}, .facts = {}};
      });
      return num_reports;
    };
    EXPECT_EQ(report(), 0) << "before the welcome";
    Welcome();
    EXPECT_TRUE(link_.welcomed());
    EXPECT_EQ(link_.num_welcomes(), connection);
    EXPECT_EQ(link_.connections(), connection);
    EXPECT_EQ(far_.Count<proto::Hello>(link_.client()), 0);
    EXPECT_EQ(report(), 1);
    EXPECT_EQ(report(), 1);
    clock_.Advance(seconds(1));
    EXPECT_EQ(report(), 2);
    EXPECT_EQ(far_.Count<proto::Report>(link_.client()), 2);
    far_.Stop();
    Until([&] {
      link_.Receive(milliseconds(0));
      return !link_.client().connected();
    });
    far_.Start();
    clock_.Advance(kPause);
  }
}

TEST_F(ReplayLinkTest, AsksASilentServerAndDropsAConnectionThatDoesNotAnswer) {
  ExpectHello();
  Welcome();
  // Whatever the server says counts.
  for (int i = 0; i < 4; ++i) {
    clock_.Advance(seconds(4));
    Say(proto::StatusReply{});
  }
  EXPECT_EQ(far_.Count<proto::Hello>(link_.client()), 0);
  for (int i = 0; i < 4; ++i) {
    clock_.Advance(kSilence);
    ExpectHello();
    Welcome();
  }
  EXPECT_EQ(link_.connections(), 1);
  EXPECT_EQ(link_.num_welcomes(), 1) << "nothing that was asked for is lost";
  for (int i = 0; i < 2; ++i) {
    clock_.Advance(kSilence);
    ExpectHello();
    clock_.Advance(seconds(1));
    EXPECT_FALSE(link_.Receive(milliseconds(0)));
    EXPECT_EQ(far_.Count<proto::Hello>(link_.client()), 0) << "one each time";
  }
  clock_.Advance(kSilence);
  ExpectHello();
  EXPECT_EQ(link_.connections(), 2);
  Welcome();
  EXPECT_EQ(link_.num_welcomes(), 2);
}

TEST_F(ReplayLinkTest, SaysHelloAgainAfterARefusal) {
  ExpectHello();
  for (int welcomes = 1; welcomes <= 3; ++welcomes) {
    far_.Answer(proto::Refusal{.code = proto::RefusalCode::kNoSession, .text = "who", .about = 0});
    Say(proto::StatusReply{});
    EXPECT_EQ(link_.trouble(), "") << "for a message from before the hello";
    far_.Answer(proto::Refusal{.code = proto::RefusalCode::kNotReady, .text = "no", .about = 0});
    Say(proto::StatusReply{});
    EXPECT_EQ(link_.trouble(), "no (not_ready)");
    Welcome();
    EXPECT_EQ(link_.trouble(), "");
    EXPECT_EQ(link_.num_welcomes(), welcomes);
    clock_.Advance(seconds(1));
    Say(proto::Refusal{.code = proto::RefusalCode::kOverWindow, .text = "full", .about = 0});
    EXPECT_FALSE(link_.welcomed());
    EXPECT_EQ(link_.trouble(), "");
    ExpectHello();
  }
  EXPECT_EQ(link_.connections(), 1);
}

/// A policy link of a reader that takes policies of one byte alone.
class PolicyLinkTest : public ::testing::Test {
 protected:
  PolicyLinkTest()
      : link_(context_, {.endpoint = far_.endpoint()}, "reader",
              [](std::span<const std::byte> bytes) -> std::optional<base::Failure> {
                if (bytes.size() == 1) return std::nullopt;
                return base::Failure{"damaged"};
              }) {}

  void ExpectRequest(std::int64_t held) {
    std::optional<proto::SnapshotRequest> request;
    Until([&] {
      EXPECT_FALSE(link_.Poll());
      request = far_.Take<proto::SnapshotRequest>();
      return request.has_value();
    });
    EXPECT_EQ(request->held_version, held);
    EXPECT_FALSE(link_.Poll());
    EXPECT_EQ(far_.Count<proto::SnapshotRequest>(link_.client()), 0) << "one each time";
  }
  void Publish(std::int64_t version, std::string_view policy) {
    proto::Snapshot snapshot;
    snapshot.version = version;
    snapshot.published_ns = 1'000'000'000 * version;
    far_.Answer(snapshot, policy);
  }

  HeldClock clock_;
  Far far_;
  transport::Context context_;
  PolicyLink link_;
};

TEST_F(PolicyLinkTest, AsksOnEachConnectionAndAfterEachAnswer) {
  std::int64_t seen = -1;
  for (int connection = 1; connection <= 3; ++connection) {
    ExpectRequest(seen);
    if (connection == 3) seen = 0;  // The learner has gone back to a checkpoint.
    Publish(++seen, "1");
    Until([&] { return link_.Poll(); });
    EXPECT_EQ(link_.version(), seen);
    EXPECT_DOUBLE_EQ(link_.published_s(), static_cast<double>(seen));
    for (int i = 0; i < 2; ++i) {
      ExpectRequest(seen);
      Publish(++seen, "no policy");
    }
    ExpectRequest(seen);
    EXPECT_EQ(link_.version(), seen - 2);
    EXPECT_EQ(link_.received(), connection);
    EXPECT_EQ(link_.rejected(), 2 * connection);
    EXPECT_EQ(link_.connections(), connection);
    far_.Stop();
    Until([&] {
      EXPECT_FALSE(link_.Poll());
      return !link_.client().connected();
    });
    far_.Start();
    clock_.Advance(kPause);
  }
}

TEST_F(PolicyLinkTest, AsksASilentLearnerAndDropsAConnectionThatDoesNotAnswer) {
  ExpectRequest(-1);
  Publish(0, "1");
  Until([&] { return link_.Poll(); });
  for (int i = 0; i < 4; ++i) {
    ExpectRequest(0);
    clock_.Advance(kSilence);
    ExpectRequest(0);
    Publish(0, "");  // There is no newer policy.
  }
  EXPECT_EQ(link_.connections(), 1);
  for (int i = 0; i < 3; ++i) {
    ExpectRequest(0);
    clock_.Advance(kSilence);
  }
  ExpectRequest(0);
  EXPECT_EQ(link_.connections(), 2);
  EXPECT_EQ(link_.received(), 1);
}

}  // namespace
}  // namespace slalom::service
