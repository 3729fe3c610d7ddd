#include "replay/service/server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "base/error.h"
#include "replay/priority_bytes.h"
#include "replay/sample_bytes.h"
#include "tests/replay/service/rows_source.h"
#include "tests/replay/service/test_peer.h"
#include "tests/support/scratch_directory.h"

namespace slalom::replay {
namespace {

constexpr int kBeams = 3;
constexpr int kStreams = 2;
constexpr std::uint64_t kSpecHash = 77;
constexpr std::uint64_t kSeed = 5;

/// A server that runs in a thread until it goes out of scope.
class RunningServer {
 public:
  explicit RunningServer(ReplayServerConfig config = {}, double updates_per_step = 10.0,
                         const std::string& endpoint = "tcp://127.0.0.1:*")
      : registry_("replay", "replay"),
        server_(config,
                {.endpoint = endpoint,
                 .table = {.capacity = 500},
                 .num_beams = kBeams,
                 .spec_hash = kSpecHash,
                 .seed = kSeed,
                 .updates_per_step = updates_per_step,
                 .learning_starts = 8},
                context_, registry_),
        thread_([this](std::stop_token stop) { server_.Run(stop); }) {}

  std::string endpoint() const { return server_.endpoint(); }

 private:
  transport::Context context_;
  metrics::Registry registry_;
  ReplayServer server_;
  std::jthread thread_;
};

proto::Hello HelloOf(const std::string& role, const std::string& name, std::uint64_t session = 0) {
  return {.role = role,
          .name = name,
          .session = session,
          .spec_hash = kSpecHash,
          .num_beams = kBeams,
          .num_streams = kStreams,
          .software = "test"};
}

proto::Insert InsertOf(const Chunk& chunk, std::uint64_t session, std::uint64_t sequence) {
  return {.session = session,
          .sequence = sequence,
          .num_rows = chunk.num_rows(),
          .num_beams = chunk.num_beams,
          .num_steps = RowsSource::NumSteps(chunk),
          .oldest_version = 3,
          .newest_version = 5};
}

/// Inserts chunks and waits for their acknowledgement.
void InsertAll(TestPeer& actor, RowsSource& source, Table* same, std::uint64_t session,
               std::uint64_t begin, std::uint64_t end) {
  for (std::uint64_t k = begin; k < end; ++k) {
    const Chunk chunk = source.Next(3);
    if (same != nullptr) same->Insert(chunk);
    actor.Send(InsertOf(chunk, session, k), RowsSource::Bytes(chunk));
  }
  for (std::uint64_t safe = begin; safe < end;) {
    const auto ack = actor.Expect<proto::InsertAck>();
    ASSERT_TRUE(ack);
    EXPECT_EQ(ack->session, session);
    EXPECT_GT(ack->next_sequence, safe);
    EXPECT_LE(ack->next_sequence, end);
    safe = ack->next_sequence;
  }
}

void ExpectSameSample(TestPeer& learner, const Table& table, std::uint64_t cursor) {
  learner.Send(
      proto::SampleRequest{.cursor = cursor, .batch = 32, .history = 2, .n_step = 3, .gamma = 0.9});
  transport::Frame payload;
  const auto reply = learner.Expect<proto::SampleReply>(&payload);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->cursor, cursor);
  EXPECT_EQ(reply->table_steps, table.num_steps());
  SampledRows sampled;
  const auto fault = ParseSample(
      payload.bytes(), {.batch = reply->batch, .history = reply->history, .num_beams = kBeams},
      &sampled);
  ASSERT_FALSE(fault) << fault->text;
  base::Random random(base::DeriveSeed(kSeed, "sample", {cursor}));
  SampledRows expected;
  ASSERT_TRUE(
      table.SampleRows({.batch = 32, .history = 2, .n_step = 3, .gamma = 0.9}, random, &expected));
  EXPECT_EQ(sampled.sequence, expected.sequence);
  EXPECT_EQ(sampled.next_sequence, expected.next_sequence);
  for (int b = 0; b < 32; ++b) EXPECT_EQ(sampled.n_step_return[b], expected.n_step_return[b]);
}

TEST(ReplayServerTest, WhatAnActorInsertsALearnerSamples) {
  RunningServer server;
  transport::Context context;
  TestPeer actor(context, server.endpoint());
  TestPeer learner(context, server.endpoint());
  RowsSource source(kBeams, kStreams, 1);
  Table same({.capacity = 500}, kBeams);

  actor.Send(HelloOf("actor", "a", 1));
  const auto welcome = actor.Expect<proto::Welcome>();
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->session, 1u);
  EXPECT_EQ(welcome->next_sequence, 0u);
  EXPECT_EQ(welcome->previous_session, 0u);
  EXPECT_GT(welcome->window_bytes, 0);
  InsertAll(actor, source, &same, 1, 0, 60);

  learner.Send(HelloOf("learner", "l"));
  ASSERT_TRUE(learner.Expect<proto::Welcome>());
  for (const std::uint64_t cursor : {0, 1, 2, 1}) ExpectSameSample(learner, same, cursor);
}

TEST(ReplayServerTest, TheTableAndTheSessionsComeBackFromTheJournal) {
  test::ScratchDirectory scratch;
  ReplayServerConfig config;
  config.directory = (scratch.path() / "replay").string();
  config.segment_bytes = 65536;
  RowsSource source(kBeams, kStreams, 1);
  Table same({.capacity = 500}, kBeams);
  transport::Context context;
  for (std::uint64_t start = 0; start < 4; ++start) {
    RunningServer server(config);
    TestPeer actor(context, server.endpoint());
    actor.Send(HelloOf("actor", "a", 1));
    const auto welcome = actor.Expect<proto::Welcome>();
    ASSERT_TRUE(welcome);
    EXPECT_EQ(welcome->next_sequence, start * 100);
    InsertAll(actor, source, &same, 1, start * 100, start * 100 + 100);
    TestPeer learner(context, server.endpoint());
    learner.Send(HelloOf("learner", "l"));
    ASSERT_TRUE(learner.Expect<proto::Welcome>());
    ExpectSameSample(learner, same, start);
  }
}

TEST(ReplayServerTest, PrioritiesComeBackAfterARestart) {
  test::ScratchDirectory scratch;
  ReplayServerConfig config;
  config.directory = (scratch.path() / "replay").string();
  constexpr int kBatch = 64;
  transport::Context context;
  std::int64_t chosen = 0;
  const auto sample = [&](TestPeer& learner, std::uint64_t cursor) {
    learner.Send(proto::SampleRequest{
        .cursor = cursor, .batch = kBatch, .history = 1, .n_step = 1, .prioritized = true});
    transport::Frame payload;
    SampledRows rows;
    if (learner.Expect<proto::SampleReply>(&payload)) {
      const auto fault = ParseSample(
          payload.bytes(), {.batch = kBatch, .history = 1, .num_beams = kBeams, .weighted = true},
          &rows);
      EXPECT_FALSE(fault);
    }
    return rows.sequence;
  };
  {
    RunningServer server(config);
    TestPeer actor(context, server.endpoint());
    RowsSource source(kBeams, kStreams, 1);
    actor.Send(HelloOf("actor", "a", 1));
    ASSERT_TRUE(actor.Expect<proto::Welcome>());
    InsertAll(actor, source, nullptr, 1, 0, 30);
    TestPeer learner(context, server.endpoint());
    learner.Send(HelloOf("learner", "l"));
    ASSERT_TRUE(learner.Expect<proto::Welcome>());
    auto rows = sample(learner, 0);
    // All but one, which then outweighs them by 10^3.6 each.
    chosen = rows[0];
    std::ranges::sort(rows);
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    std::vector<float> priorities;
    for (const std::int64_t row : rows) priorities.push_back(row == chosen ? 1e6f : 1.0f);
    transport::Frame update(PrioritySize(static_cast<int>(rows.size())));
    WritePriorities(rows, priorities, update.mutable_bytes());
    learner.Send(proto::PriorityUpdate{.count = static_cast<std::int32_t>(rows.size())},
                 std::move(update));
    const auto drawn = sample(learner, 1);
    EXPECT_GT(std::ranges::count(drawn, chosen), kBatch / 2);
  }
  RunningServer server(config);
  TestPeer learner(context, server.endpoint());
  learner.Send(HelloOf("learner", "l"));
  ASSERT_TRUE(learner.Expect<proto::Welcome>());
  const auto drawn = sample(learner, 1);
  EXPECT_GT(std::ranges::count(drawn, chosen), kBatch / 2);
}

// Producers with reconnections, consumers with priorities, the journal's threads: for
// ThreadSanitizer, and for the sum of it all.
TEST(ReplayServerTest, TwoProducersAndTwoConsumersAtOnce) {
  test::ScratchDirectory scratch;
  ReplayServerConfig config;
  config.directory = (scratch.path() / "replay").string();
  config.max_ahead_steps = 0;  // Learners that are done hold nobody up.
  config.segment_bytes = 65536;
  config.sync_interval = 0.01;
  constexpr std::uint64_t kChunks = 150;
  std::int64_t steps = 0;
  {
    RunningServer server(config);
    std::vector<std::jthread> threads;
    std::vector<std::int64_t> made(2, 0);
    for (std::size_t i = 0; i < 2; ++i) {
      threads.emplace_back([&, i] {
        transport::Context context;
        RowsSource source(kBeams, kStreams, 10 + i);
        const std::string name = "actor-" + std::to_string(i);
        for (std::uint64_t start = 0; start < 3; ++start) {
          // The same session over three connections.
          TestPeer actor(context, server.endpoint());
          actor.Send(HelloOf("actor", name, 1));
          const auto welcome = actor.Expect<proto::Welcome>();
          ASSERT_TRUE(welcome);
          ASSERT_EQ(welcome->next_sequence, start * kChunks);
          InsertAll(actor, source, nullptr, 1, start * kChunks, (start + 1) * kChunks);
        }
        made[i] = 3 * kChunks * 3 * kStreams;
      });
      threads.emplace_back([&, i] {
        transport::Context context;
        TestPeer learner(context, server.endpoint());
        learner.Send(HelloOf("learner", "learner-" + std::to_string(i)));
        ASSERT_TRUE(learner.Expect<proto::Welcome>());
        for (std::uint64_t k = 0; k < 200; ++k) {
          learner.Send(proto::SampleRequest{.cursor = k,
                                            .batch = 16,
                                            .history = 2,
                                            .n_step = 2,
                                            .gamma = 0.9,
                                            .prioritized = i == 1,
                                            .importance_exponent = 0.5});
          transport::Frame payload;
          const auto reply = learner.Expect<proto::SampleReply>(&payload);
          ASSERT_TRUE(reply);
          ASSERT_EQ(reply->cursor, k);
          SampledRows rows;
          const auto fault = ParseSample(payload.bytes(),
                                         {.batch = reply->batch,
                                          .history = reply->history,
                                          .num_beams = kBeams,
                                          .weighted = reply->weighted},
                                         &rows);
          ASSERT_FALSE(fault) << fault->text;
          const std::vector<float> priorities(rows.sequence.size(), 0.5f);
          transport::Frame update(PrioritySize(reply->batch));
          WritePriorities(rows.sequence, priorities, update.mutable_bytes());
          learner.Send(proto::PriorityUpdate{.count = reply->batch}, std::move(update));
        }
      });
    }
    threads.clear();
    steps = made[0] + made[1];
  }
  const Recovered recovered =
      RecoverJournal({.directory = config.directory, .num_beams = kBeams, .spec_hash = kSpecHash},
                     {.capacity = 500});
  EXPECT_EQ(recovered.sessions.accepted_steps(), steps);
  EXPECT_THAT(recovered.notes, testing::IsEmpty());
}

TEST(ReplayServerTest, TwoServersInOneDirectoryAreRefused) {
  test::ScratchDirectory scratch;
  ReplayServerConfig config;
  config.directory = (scratch.path() / "replay").string();
  RunningServer server(config);
  EXPECT_THROW(RunningServer other(config), base::Error);
}

TEST(ReplayServerTest, RolesMaySendOnlyWhatIsTheirs) {
  RunningServer server;
  transport::Context context;
  TestPeer stranger(context, server.endpoint());
  const auto expect_refused = [](TestPeer& peer, proto::RefusalCode code) {
    const auto refusal = peer.Expect<proto::Refusal>();
    ASSERT_TRUE(refusal);
    EXPECT_EQ(refusal->code, code) << refusal->text;
  };
  stranger.Send(proto::Goodbye{.session = 1});
  expect_refused(stranger, proto::RefusalCode::kNoSession);
  stranger.Send(HelloOf("king", "k"));
  expect_refused(stranger, proto::RefusalCode::kNotAllowed);
  stranger.Send(proto::StatusRequest{});
  EXPECT_TRUE(stranger.Expect<proto::StatusReply>());

  TestPeer evaluator(context, server.endpoint());
  evaluator.Send(HelloOf("evaluator", "e"));
  ASSERT_TRUE(evaluator.Expect<proto::Welcome>());
  evaluator.Send(proto::SampleRequest{.cursor = 0, .batch = 1, .history = 1, .n_step = 1});
  expect_refused(evaluator, proto::RefusalCode::kNotAllowed);

  TestPeer actor(context, server.endpoint());
  proto::Hello hello = HelloOf("actor", "a", 1);
  hello.spec_hash = 1;
  actor.Send(hello);
  expect_refused(actor, proto::RefusalCode::kWrongSpec);
}

}  // namespace
}  // namespace slalom::replay
