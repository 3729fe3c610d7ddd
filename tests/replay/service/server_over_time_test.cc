#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <sstream>
#include <string>

#include "metrics/catalogue.h"
#include "proto/messages.h"
#include "proto/transport/context.h"
#include "tests/replay/service/running_server.h"
#include "tests/replay/service/test_peer.h"
#include "tests/support/held_clock.h"

namespace slalom::replay {
namespace {

/// A server whose clock stands still, and an operator that looks at it.
class ServerOverTimeTest : public testing::Test {
 protected:
  /// Lets the time pass. Returns the server's own report after that.
  proto::Report After(std::chrono::seconds time) {
    clock_.Advance(time);
    for (;;) {
      operator_.Send(proto::StatusRequest{});
      const auto reply = operator_.Expect<proto::StatusReply>();
      if (!reply) return {};
      for (const proto::RoleStatus& role : reply->roles) {
        if (role.report.role == "replay" && role.age_s < 1.0) return role.report;
      }
    }
  }
  /// The value of a metric with a label, as Prometheus gets it; -1 if it is not there.
  double Metric(const metrics::Spec& metric, const std::string& label) const {
    std::istringstream lines(server_.Metrics());
    for (std::string line; std::getline(lines, line);) {
      const std::size_t end = line.rfind(' ');
      if (line.starts_with(std::string(metric.name) + "{") &&
          line.substr(0, end).find('"' + label + '"') != std::string::npos) {
        return std::stod(line.substr(end));
      }
    }
    return -1.0;
  }
  double Lost(const std::string& role) const { return Metric(metrics::kPeersLost, role); }
  double Present(const std::string& role) const { return Metric(metrics::kConnectedPeers, role); }
  void Greet(TestPeer& peer, const std::string& role, const std::string& name) {
    peer.Send(HelloOf(role, name, 1));
    ASSERT_TRUE(peer.Expect<proto::Welcome>());
  }
  void Hear(TestPeer& peer) {
    peer.Send(proto::StatusRequest{});
    ASSERT_TRUE(peer.Expect<proto::StatusReply>());
  }

  static constexpr std::chrono::seconds kSilence{10};  // By default.
  test::HeldClock clock_{/*is_for_this_thread=*/false};
  const RunningServer server_{{}, {}, 64, {{"run.seed", "5"}}, &clock_};
  transport::Context context_;
  TestPeer operator_{context_, server_.endpoint()};
};

TEST_F(ServerOverTimeTest, AnActorThatDiesIsCountedAndOneThatLeavesIsNot) {
  EXPECT_EQ(Lost("actor"), 0.0);
  {
    TestPeer leaves(context_, server_.endpoint());
    Greet(leaves, "operator", "o");
  }
  TestPeer learner(context_, server_.endpoint());
  Greet(learner, "learner", "l");
  for (double dead = 0.0; dead < 2.0; ++dead) {
    auto leaves = std::make_unique<TestPeer>(context_, server_.endpoint());
    auto dies = std::make_unique<TestPeer>(context_, server_.endpoint());
    Greet(*leaves, "actor", "leaves");
    leaves->Send(proto::Goodbye{.session = 1});
    Hear(*leaves);
    // On a new connection it is the same one.
    for (int i = 0; i < 2; ++i) {
      dies = std::make_unique<TestPeer>(context_, server_.endpoint());
      Greet(*dies, "actor", "dies");
    }
    leaves.reset();
    dies.reset();
    After(kSilence / 2);
    Hear(learner);
    EXPECT_EQ(Lost("actor"), dead);
    After(kSilence / 2);
    Hear(learner);
    EXPECT_EQ(Lost("actor"), dead + 1.0);
  }
  EXPECT_EQ(Lost("learner"), 0.0) << "it is there";
  EXPECT_EQ(Lost("operator"), -1.0) << "one asks and leaves";
}

TEST_F(ServerOverTimeTest, WhoeverIsHeardOfAgainIsPresentAndMayBeLostAgain) {
  TestPeer actor(context_, server_.endpoint());
  TestPeer learner(context_, server_.endpoint());
  Greet(actor, "actor", "a");
  Greet(learner, "learner", "l");
  for (double lost = 1.0; lost <= 3.0; ++lost) {
    for (int i = 0; i < 3; ++i) {
      Hear(actor);
      Hear(learner);
      EXPECT_EQ(After(kSilence - std::chrono::seconds(1)).figures.at("sessions"), 1.0);
      EXPECT_EQ(Present("actor"), 1.0);
      EXPECT_EQ(Present("learner"), 1.0);
    }
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(After(std::chrono::seconds(1)).figures.at("sessions"), 0.0);
      EXPECT_EQ(Present("actor"), 0.0);
      EXPECT_EQ(Present("learner"), 0.0);
      EXPECT_EQ(Lost("actor"), lost);
      EXPECT_EQ(Lost("learner"), lost);
    }
  }
  actor.Send(ReportOf("actor", "a"));
  EXPECT_THAT(NamesOf(actor, "actor"), testing::ElementsAre("a"));
  After(5 * kSilence);
  actor.Send(ReportOf("actor", "a"));
  EXPECT_THAT(NamesOf(actor, "actor"), testing::ElementsAre("a"));
  After(6 * kSilence);
  actor.Send(ReportOf("actor", "a"));
  ExpectRefused(actor, proto::RefusalCode::kNoSession);
}

TEST_F(ServerOverTimeTest, TheTimeThatBatchesAndRowsAreHeldIsCounted) {
  TestPeer learner(context_, server_.endpoint());
  Greet(learner, "learner", "l");
  const auto held = [&](const std::string& queue) {
    return Metric(metrics::kBlockedSeconds, queue);
  };
  After(std::chrono::seconds(4));
  EXPECT_EQ(held("samples"), 0.0);
  learner.Send(proto::SampleRequest{.cursor = 0, .batch = 4, .history = 1, .n_step = 1});
  Hear(learner);
  After(std::chrono::seconds(3));
  After(std::chrono::seconds(2));
  EXPECT_EQ(held("samples"), 5.0);
  EXPECT_EQ(held("inserts"), 0.0);
}

}  // namespace
}  // namespace slalom::replay
