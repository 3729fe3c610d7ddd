#include "learner/service/policy_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "learner/learner.h"
#include "proto/policy_link.h"
#include "tests/learner/filled_replay.h"
#include "tests/support/held_clock.h"

namespace slalom::learner {
namespace {

using std::chrono::milliseconds;

TEST(PolicyServerTest, TheOldestVersionHeldIsThatOfTheReaderFurthestBehind) {
  transport::Context context;
  metrics::Registry registry("learner", "learner");
  PolicyServer server(context, {.endpoint = "tcp://127.0.0.1:*"}, kSpecHash, {}, registry);
  EXPECT_EQ(server.oldest_held(), std::nullopt);
  std::vector<std::unique_ptr<transport::Client>> readers;
  for (const std::int64_t held : {5, 1, 4}) {
    readers.push_back(std::make_unique<transport::Client>(
        context, transport::ClientOptions{.endpoint = server.endpoint()}));
    proto::SnapshotRequest request;
    request.held_version = held;
    request.name = "reader-" + std::to_string(held);
    WaitUntil([&] {
      return readers.back()->Send({transport::Frame::Copy(proto::Encode(request, {})), {}});
    });
  }
  WaitUntil([&] {
    server.Poll(milliseconds(1));
    return server.num_readers() == 3;
  });
  EXPECT_EQ(server.oldest_held(), 1);
}

// A reader asks again within 5 s, and at once after an answer.
TEST(PolicyServerTest, ASecondRequestIsAnsweredAndASilentReaderForgotten) {
  test::HeldClock clock;
  transport::Context context;
  metrics::Registry registry("learner", "learner");
  PolicyServer server(context, {.endpoint = "tcp://127.0.0.1:*"}, kSpecHash, {}, registry);
  server.Publish(Learner({}, SmallSpec(), 1).Snapshot(), {}, 0);
  transport::Client reader(context, {.endpoint = server.endpoint()});
  const std::string request = proto::Encode(proto::SnapshotRequest{0, "reader", false, false}, {});
  const std::string other = proto::Encode(proto::SnapshotRequest{5, "reader", false, false}, {});
  for (int round = 0; round < 2; ++round) {
    std::optional<transport::Message> answer;
    int num_asked = 0;
    for (; !answer; answer = reader.Receive(milliseconds(0))) {
      server.Poll(milliseconds(0));
      if (num_asked < 2) num_asked += reader.Send({transport::Frame::Copy(request), {}});
    }
    const auto header = proto::Decode(answer->header.bytes(), answer->payload.bytes());
    EXPECT_EQ(std::get<proto::Snapshot>(*header).version, 0);
    EXPECT_EQ(answer->payload.size(), 0u) << "it has the newest";
    // The third waits again, until it asks for another.
    EXPECT_TRUE(reader.Send({transport::Frame::Copy(request), {}}));
    EXPECT_TRUE(reader.Send({transport::Frame::Copy(other), {}}));
    clock.Advance(std::chrono::seconds(19));
    for (answer.reset(); !answer; answer = reader.Receive(milliseconds(0))) {
      server.Poll(milliseconds(0));
    }
    EXPECT_GT(answer->payload.size(), 0u);
    for (const int seconds : {19, 2}) {
      EXPECT_EQ(server.num_readers(), 1);
      clock.Advance(std::chrono::seconds(seconds));
      server.Poll(milliseconds(0));
    }
    EXPECT_EQ(server.num_readers(), 0);
  }
}

TEST(PolicyServerTest, AReaderGetsEachPolicyOnceAsItLastAskedForIt) {
  transport::Context context;
  metrics::Registry registry("learner", "learner");
  PolicyServer server(context, {.endpoint = "tcp://127.0.0.1:*"}, kSpecHash, {}, registry);
  policy::PolicySnapshot acting = Learner({}, SmallSpec(), 1).Snapshot();
  const auto publish = [&](std::int64_t version) {
    acting.version = version;
    const ShippedPolicy shipped = [version](const nn::Metadata&) {
      return PolicyFile{version, "shipped " + std::to_string(version)};
    };
    server.Publish(acting, shipped, 100 * version);
  };
  transport::Client reader(context, {.endpoint = server.endpoint()});
  const auto ask = [&](std::int64_t held, bool shipped) {
    const proto::SnapshotRequest request{held, "reader", shipped, false};
    WaitUntil([&] {
      return reader.Send({transport::Frame::Copy(proto::Encode(request, {})), {}});
    });
  };
  std::int64_t published_ns = 0;
  const auto expect = [&](std::int64_t version, bool shipped) {
    std::optional<transport::Message> message;
    WaitUntil([&] {
      server.Poll(milliseconds(1));
      message = reader.Receive(milliseconds(1));
      return message.has_value();
    });
    const auto header = proto::Decode(message->header.bytes(), message->payload.bytes());
    const auto snapshot = std::get<proto::Snapshot>(*header);
    EXPECT_EQ(snapshot.version, version);
    EXPECT_EQ(snapshot.learner_steps, 100 * version);
    EXPECT_GT(snapshot.published_ns, std::exchange(published_ns, snapshot.published_ns));
    const auto bytes = message->payload.bytes();
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (shipped) {
      EXPECT_EQ(text, "shipped " + std::to_string(version));
    } else {
      EXPECT_EQ(policy::ParsePolicy(bytes, "policy").snapshot.version, version);
    }
  };
  const auto expect_nothing = [&] {
    for (int i = 0; i < 20; ++i) {
      server.Poll(milliseconds(1));
      EXPECT_FALSE(reader.Receive(milliseconds(1)));
    }
  };
  publish(1);
  ask(0, false);
  expect(1, false);
  ask(1, false);
  expect_nothing();
  EXPECT_EQ(server.oldest_held(), 1);
  publish(2);
  expect(2, false);
  publish(3);
  expect_nothing();  // It has not asked since.
  ask(2, true);
  expect(3, true);
  ask(3, true);
  expect_nothing();
  publish(4);
  expect(4, true);
  EXPECT_EQ(server.oldest_held(), 3);
}

}  // namespace
}  // namespace slalom::learner
