// What nobody should send, to a server that runs.

#include <gtest/gtest.h>

#include <string>

#include "tests/replay/service/rows_source.h"
#include "tests/replay/service/running_server.h"
#include "tests/replay/service/test_peer.h"

namespace slalom::replay {
namespace {

using proto::RefusalCode;

constexpr int kBeams = RunningServer::kBeams;

/// A server, a well-behaved actor, and a peer that has said hello as an actor and has one sound
/// message at hand, its first chunk.
class HostilePeersTest : public testing::Test {
 protected:
  static constexpr std::int64_t kMaxMessageBytes = 65536;

  HostilePeersTest()
      : server_(Config()),
        actor_(context_, server_.endpoint()),
        hostile_(context_, server_.endpoint()) {
    Greet(actor_, "actor");
    Greet(hostile_, "hostile");
    const Chunk chunk = RowsSource(kBeams, 2, 9).Next();
    hostile_steps_ = RowsSource::NumSteps(chunk);
    const transport::Frame rows = RowsSource::Bytes(chunk);
    payload_.assign(reinterpret_cast<const char*>(rows.bytes().data()), rows.size());
    header_ = proto::Encode(InsertOf(chunk, 1, 0), rows.bytes());
    Insert();
  }

  static ReplayServerConfig Config() {
    ReplayServerConfig config;
    config.max_message_bytes = kMaxMessageBytes;
    return config;
  }

  static void Greet(TestPeer& peer, const std::string& name) {
    peer.Send(HelloOf("actor", name, 1));
    EXPECT_TRUE(peer.Expect<proto::Welcome>());
  }

  /// The well-behaved actor is served, and nothing came into the table but what is sound.
  void Insert(std::int64_t hostile_steps = 0) {
    for (int i = 0; i < 5; ++i) {
      const Chunk chunk = source_.Next();
      steps_ += RowsSource::NumSteps(chunk);
      actor_.Send(InsertOf(chunk, 1, sequence_++), RowsSource::Bytes(chunk));
      for (std::uint64_t safe = 0; safe < sequence_;) {
        const auto ack = actor_.Expect<proto::InsertAck>();
        ASSERT_TRUE(ack);
        safe = ack->next_sequence;
      }
    }
    TestPeer learner(context_, server_.endpoint());
    learner.Send(HelloOf("learner", "learner"));
    ASSERT_TRUE(learner.Expect<proto::Welcome>());
    learner.Send(proto::SampleRequest{.cursor = 0, .batch = 4, .history = 1, .n_step = 1});
    const auto reply = learner.Expect<proto::SampleReply>();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->inserted_steps, steps_ + hostile_steps);
    EXPECT_EQ(reply->table_steps, steps_ + hostile_steps);
  }

  void ExpectRefused(const std::string& header, const std::string& payload, RefusalCode code) {
    hostile_.Send(
        transport::Message{transport::Frame::Copy(header), transport::Frame::Copy(payload)});
    const auto refusal = hostile_.Expect<proto::Refusal>();
    ASSERT_TRUE(refusal);
    EXPECT_EQ(refusal->code, code) << refusal->text;
  }

  transport::Context context_;
  RunningServer server_;
  TestPeer actor_;
  TestPeer hostile_;
  RowsSource source_{kBeams, 2, 1};
  std::uint64_t sequence_ = 0;
  std::int64_t steps_ = 0;
  std::string header_, payload_;
  std::int64_t hostile_steps_ = 0;
};

TEST_F(HostilePeersTest, MessagesCutShort) {
  for (std::size_t size = 0; size < header_.size(); ++size) {
    ExpectRefused(header_.substr(0, size), payload_, RefusalCode::kBadMessage);
  }
  for (std::size_t size = 0; size < payload_.size(); ++size) {
    ExpectRefused(header_, payload_.substr(0, size), RefusalCode::kBadMessage);
  }
  Insert();
}

TEST_F(HostilePeersTest, AnyChangedByte) {
  constexpr std::size_t kVersionByte = 4;
  for (std::size_t i = 0; i < header_.size(); ++i) {
    std::string header = header_;
    header[i] = static_cast<char>(header[i] ^ 0x10);
    ExpectRefused(header, payload_,
                  i == kVersionByte ? RefusalCode::kWrongVersion : RefusalCode::kBadMessage);
  }
  for (std::size_t i = 0; i < payload_.size(); ++i) {
    std::string payload = payload_;
    payload[i] = static_cast<char>(payload[i] ^ 0x10);
    ExpectRefused(header_, payload, RefusalCode::kBadMessage);
  }
  Insert();
}

TEST_F(HostilePeersTest, AnotherVersionOfTheProtocol) {
  for (const int version : {0, 2, 255}) {
    std::string header = header_;
    header[4] = static_cast<char>(version);
    ExpectRefused(header, payload_, RefusalCode::kWrongVersion);
  }
  Insert();
}

// Over the bound of a message the connection ends, and the peer may connect anew.
TEST_F(HostilePeersTest, MessagesTooLarge) {
  for (int i = 1; i <= 3; ++i) {
    TestPeer large(context_, server_.endpoint());
    Greet(large, "large");
    large.Send(transport::Message{transport::Frame::Copy(header_),
                                  transport::Frame::Copy(std::string(kMaxMessageBytes + 1, 'x'))});
    while (large.client().connections() < 2) {
      EXPECT_FALSE(large.client().Receive(std::chrono::milliseconds(5)));
    }
    Greet(large, "large");
  }
  Insert();
}

// The same bytes once more are a duplicate of their sender's, and nothing of any other's.
TEST_F(HostilePeersTest, MessagesSentAgain) {
  const auto message = [&] {
    return transport::Message{transport::Frame::Copy(header_), transport::Frame::Copy(payload_)};
  };
  for (int i = 0; i < 10; ++i) {
    hostile_.Send(message());
    const auto ack = hostile_.Expect<proto::InsertAck>();
    ASSERT_TRUE(ack);
    EXPECT_EQ(ack->next_sequence, 1u);
  }
  TestPeer other(context_, server_.endpoint());
  other.Send(message());
  const auto refusal = other.Expect<proto::Refusal>();
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, RefusalCode::kNoSession);
  Insert(hostile_steps_);
}

}  // namespace
}  // namespace slalom::replay
