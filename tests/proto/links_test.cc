#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <variant>

#include "proto/policy_link.h"
#include "proto/replay_link.h"
#include "proto/transport/server.h"

/// How a role keeps its links to servers that come and go.

namespace slalom::service {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// Less than the seconds after which links ask again whatever happens, and far more than a
/// connection takes.
constexpr std::chrono::seconds kSoon{4};

/// Calls `step`, which waits a little at most, until it says true.
void Until(const std::function<bool()>& step) {
  const auto give_up = steady_clock::now() + std::chrono::seconds(20);
  while (!step()) ASSERT_LT(steady_clock::now(), give_up) << "what was waited for did not come";
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
    const auto received = server_->Receive(milliseconds(1));
    if (!received) return std::nullopt;
    peer_ = received->peer;
    const auto header =
        proto::Decode(received->message.header.bytes(), received->message.payload.bytes());
    const auto* kind = header ? std::get_if<Kind>(&*header) : nullptr;
    return kind ? std::optional(*kind) : std::nullopt;
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

TEST(ReplayLinkTest, SaysHelloOnceOnEachConnection) {
  Far far;
  transport::Context context;
  proto::Hello hello;
  hello.role = "learner";
  hello.name = "l";
  hello.session = 3;
  ReplayLink link(context, {.endpoint = far.endpoint()}, hello);
  for (int connection = 1; connection <= 3; ++connection) {
    int num_hellos = 0;
    const auto began = steady_clock::now();
    const auto turn = [&] {
      link.Receive(milliseconds(1));
      if (const auto said = far.Take<proto::Hello>()) {
        EXPECT_EQ(said->session, 3u);
        EXPECT_FALSE(link.welcomed());
        ++num_hellos;
        far.Answer(proto::Welcome{.session = 2, .window_bytes = 1, .software = "test"});
        link.Receive(milliseconds(200));
        EXPECT_FALSE(link.welcomed()) << "an answer to an earlier hello";
        far.Answer(proto::Welcome{.session = 3, .window_bytes = 1, .software = "test"});
      }
      return link.num_welcomes() == connection;
    };
    Until(turn);
    EXPECT_LT(steady_clock::now() - began, kSoon);
    for (int i = 0; i < 20; ++i) turn();
    EXPECT_EQ(num_hellos, 1) << connection;
    EXPECT_TRUE(link.welcomed());
    EXPECT_EQ(link.connections(), connection);
    int num_reports = 0;
    const auto report = [&] {
      link.ReportEverySecond([&] {
        ++num_reports;
        return proto::Report{.role = "learner", .name = "l", .figures = {}, .facts = {}};
      });
      return num_reports;
    };
    Until([&] {
      link.Receive(milliseconds(1));
      return report() == 1;
    });
    EXPECT_EQ(report(), 1);
    far.Stop();
    Until([&] {
      link.Receive(milliseconds(1));
      return !link.client().connected();
    });
    far.Start();
  }
}

TEST(PolicyLinkTest, AsksOnEachConnectionAndAfterEachAnswer) {
  Far far;
  transport::Context context;
  PolicyLink link(context, {.endpoint = far.endpoint()}, "reader",
                  [](std::span<const std::byte> bytes) -> std::optional<base::Failure> {
                    if (bytes.size() == 1) return std::nullopt;
                    return base::Failure{"damaged"};
                  });
  std::int64_t seen = -1;
  const auto expect_request = [&] {
    std::optional<proto::SnapshotRequest> request;
    const auto began = steady_clock::now();
    Until([&] {
      EXPECT_FALSE(link.Poll());
      request = far.Take<proto::SnapshotRequest>();
      return request.has_value();
    });
    EXPECT_EQ(request->held_version, seen);
    EXPECT_LT(steady_clock::now() - began, kSoon);
  };
  const auto publish = [&](std::string_view policy) {
    proto::Snapshot snapshot;
    snapshot.version = ++seen;
    far.Answer(snapshot, policy);
  };
  for (int connection = 1; connection <= 3; ++connection) {
    expect_request();
    if (connection == 3) seen = 0;  // The learner has gone back to a checkpoint.
    publish("1");
    Until([&] { return link.Poll(); });
    EXPECT_EQ(link.version(), seen);
    for (int i = 0; i < 2; ++i) {
      expect_request();
      publish("no policy");
    }
    expect_request();
    EXPECT_EQ(link.version(), seen - 2);
    EXPECT_EQ(link.received(), connection);
    EXPECT_EQ(link.rejected(), 2 * connection);
    EXPECT_EQ(link.connections(), connection);
    far.Stop();
    Until([&] {
      EXPECT_FALSE(link.Poll());
      return !link.client().connected();
    });
    far.Start();
  }
}

}  // namespace
}  // namespace slalom::service
