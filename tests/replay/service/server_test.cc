#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/file.h"
#include "proto/replay_link.h"
#include "replay/sample_bytes.h"
#include "tests/replay/service/rows_source.h"
#include "tests/replay/service/running_server.h"
#include "tests/replay/service/test_peer.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/wait_until.h"

namespace slalom::replay {
namespace {

constexpr int kBeams = RunningServer::kBeams;
constexpr int kStreams = 2;
constexpr std::uint64_t kSpecHash = RunningServer::kSpecHash;
constexpr std::uint64_t kSeed = RunningServer::kSeed;

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
  const auto fault =
      ParseSample(payload.bytes(),
                  {.batch = reply->batch, .history = reply->history, .step = kBeams}, &sampled);
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
  config.segment_bytes = 65536;
  config.sync_interval = 0.01;
  config.max_ahead_steps = 0;
  constexpr int kBatch = 64;
  transport::Context context;
  std::int64_t chosen = 0;
  const auto sample = [&](TestPeer& learner, std::uint64_t cursor) {
    learner.Send(proto::SampleRequest{
        .cursor = cursor, .batch = kBatch, .history = 1, .n_step = 1, .prioritized = true});
    transport::Frame payload;
    SampledRows rows;
    if (learner.Expect<proto::SampleReply>(&payload)) {
      const auto fault =
          ParseSample(payload.bytes(),
                      {.batch = kBatch, .history = 1, .step = kBeams, .weighted = true}, &rows);
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
  // A kill leaves those behind that are saved whenever a segment is full.
  const std::filesystem::path saved = PrioritiesPath(config.directory);
  ASSERT_TRUE(std::filesystem::remove(saved));
  TestPeer actor(context, server.endpoint());
  actor.Send(HelloOf("actor", "a", 2));
  ASSERT_TRUE(actor.Expect<proto::Welcome>());
  RowsSource source(kBeams, kStreams, 2);
  for (std::uint64_t k = 0; !std::filesystem::exists(saved); ++k) {
    InsertAll(actor, source, nullptr, 2, k, k + 1);
  }
}

// Else a restart while no learner is there would hold actors back as if nothing had been granted.
TEST(ReplayServerTest, WhatLearnersWereGrantedComesBackAfterARestart) {
  test::ScratchDirectory scratch;
  ReplayServerConfig config;
  config.directory = (scratch.path() / "replay").string();
  config.max_ahead_steps = 20;
  config.sync_interval = 0.01;
  transport::Context context;
  RowsSource source(kBeams, kStreams, 1);
  std::uint64_t sent = 0;
  {
    RunningServer server(config);
    TestPeer learner(context, server.endpoint());
    learner.Send(HelloOf("learner", "l"));
    ASSERT_TRUE(learner.Expect<proto::Welcome>());
    // As after a checkpoint. It lets in as many steps as earn it, and is answered then.
    learner.Send(proto::SampleRequest{.cursor = 600, .batch = 4, .history = 1, .n_step = 1});
    TestPeer actor(context, server.endpoint());
    actor.Send(HelloOf("actor", "a", 1));
    ASSERT_TRUE(actor.Expect<proto::Welcome>());
    for (; sent < 13; ++sent) InsertAll(actor, source, nullptr, 1, sent, sent + 1);
    ASSERT_TRUE(learner.Expect<proto::SampleReply>());
    // What a kill leaves behind: they are saved every second.
    for (const std::uint64_t cursor : {601, 650}) {
      const std::string line = std::to_string(cursor) + " l";
      const auto saved = CursorsPath(config.directory);
      test::WaitUntil([&] {
        return std::filesystem::exists(saved) && base::ReadFile(saved).find(line) != line.npos;
      });
      if (cursor == 650) break;
      learner.Send(proto::SampleRequest{.cursor = 649, .batch = 4, .history = 1, .n_step = 1});
      ASSERT_TRUE(learner.Expect<proto::SampleReply>());
    }
  }
  // Far more than `max_ahead_steps`, and fewer than what the learner was granted allows.
  RunningServer server(config);
  TestPeer actor(context, server.endpoint());
  actor.Send(HelloOf("actor", "a", 1));
  ASSERT_TRUE(actor.Expect<proto::Welcome>());
  InsertAll(actor, source, nullptr, 1, sent, sent + 1);
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
                                          .step = kBeams,
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
  const Recovered recovered = RecoverJournal(
      {.directory = config.directory, .shape = kBeams, .spec_hash = kSpecHash}, {.capacity = 500});
  EXPECT_EQ(recovered.sessions.accepted_steps(), steps);
  EXPECT_THAT(recovered.notes, testing::IsEmpty());
  // Two or three hold the table's rows; the others are deleted.
  EXPECT_GE(recovered.next_index, 6u);
  EXPECT_LE(recovered.segments.size(), 3u);
}

TEST(ReplayServerTest, APeerWithoutRoomIsToldTheKey) {
  RunningServer server({}, {}, 1);
  transport::Context context;
  TestPeer actor(context, server.endpoint());
  actor.Send(HelloOf("actor", "a", 1));
  ASSERT_TRUE(actor.Expect<proto::Welcome>());
  service::ReplayLink link(context, {.endpoint = server.endpoint()}, HelloOf("learner", "l"));
  while (link.trouble().find("service.max_connections") == std::string::npos) {
    EXPECT_FALSE(link.Receive(std::chrono::milliseconds(5)));
  }
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
  stranger.Send(proto::Goodbye{.session = 1});
  ExpectRefused(stranger, proto::RefusalCode::kNoSession);
  stranger.Send(HelloOf("king", "k"));
  ExpectRefused(stranger, proto::RefusalCode::kNotAllowed);
  stranger.Send(proto::StatusRequest{});
  EXPECT_TRUE(stranger.Expect<proto::StatusReply>());

  TestPeer evaluator(context, server.endpoint());
  evaluator.Send(HelloOf("evaluator", "e"));
  ASSERT_TRUE(evaluator.Expect<proto::Welcome>());
  evaluator.Send(proto::SampleRequest{.cursor = 0, .batch = 1, .history = 1, .n_step = 1});
  ExpectRefused(evaluator, proto::RefusalCode::kNotAllowed);

  TestPeer actor(context, server.endpoint());
  proto::Hello hello = HelloOf("actor", "a", 1);
  hello.spec_hash = 1;
  actor.Send(hello);
  ExpectRefused(actor, proto::RefusalCode::kWrongSpec);
  // What a reader makes of a field that is left out.
  hello = HelloOf("actor", "a", 1);
  hello.num_streams = 0;
  actor.Send(hello);
  ExpectRefused(actor, proto::RefusalCode::kBadMessage);
  actor.Send(HelloOf("actor", "a", 1));
  EXPECT_TRUE(actor.Expect<proto::Welcome>());
}

// Reports become the status, and the learner's idea of what actors do.
TEST(ReplayServerTest, OfTwoLearnersOfANameTheOneThatStartedLastIsServed) {
  RunningServer server;
  transport::Context context;
  TestPeer older(context, server.endpoint());
  TestPeer newer(context, server.endpoint());
  const auto expect_replaced = [&older] {
    const auto refusal = older.Expect<proto::Refusal>();
    ASSERT_TRUE(refusal);
    EXPECT_EQ(refusal->code, proto::RefusalCode::kReplaced);
    EXPECT_EQ(refusal->about, 9u);
    EXPECT_THAT(refusal->text, ::testing::HasSubstr("another learner named 'l'"));
  };
  older.Send(HelloOf("learner", "l", 5));
  ASSERT_TRUE(older.Expect<proto::Welcome>());
  newer.Send(HelloOf("learner", "l", 9));
  ASSERT_TRUE(newer.Expect<proto::Welcome>());
  expect_replaced();
  older.Send(HelloOf("learner", "l", 5));
  expect_replaced();

  // The same process on a new connection, another name and another role are welcome.
  TestPeer again(context, server.endpoint());
  again.Send(HelloOf("learner", "l", 9));
  EXPECT_TRUE(again.Expect<proto::Welcome>());
  older.Send(HelloOf("learner", "m", 5));
  EXPECT_TRUE(older.Expect<proto::Welcome>());
  newer.Send(HelloOf("evaluator", "l", 5));
  EXPECT_TRUE(newer.Expect<proto::Welcome>());
}

TEST(ReplayServerTest, AProcessOfAnotherRunIsToldWhichKeysDiffer) {
  RunningServer server;
  transport::Context context;
  TestPeer actor(context, server.endpoint());
  proto::Hello hello = HelloOf("actor", "a", 1);
  hello.run = {{"courses.train", "\"dynamic-box\""}, {"run.seed", "5"}};
  actor.Send(hello);
  const auto refusal = actor.Expect<proto::Refusal>();
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, proto::RefusalCode::kWrongSpec);
  EXPECT_THAT(refusal->text,
              ::testing::HasSubstr("courses.train is \"dynamic-box\", expected the default"));
  hello.run = {{"run.seed", "5"}};
  actor.Send(hello);
  EXPECT_TRUE(actor.Expect<proto::Welcome>());
}

TEST(ReplayServerTest, AJournalOfAnotherRunIsRefusedOnceItHasRows) {
  const test::ScratchDirectory scratch;
  ReplayServerConfig config;
  config.directory = (scratch.path() / "replay").string();
  const proto::RunIdentity other = {{"courses.train", "\"dynamic-box\""}};
  { const RunningServer empty(config, {}, 64, other); }
  {
    RunningServer server(config);
    transport::Context context;
    TestPeer actor(context, server.endpoint());
    actor.Send(HelloOf("actor", "a", 1));
    ASSERT_TRUE(actor.Expect<proto::Welcome>());
    RowsSource source(kBeams, kStreams, 1);
    Table same({.capacity = 500}, kBeams);
    InsertAll(actor, source, &same, 1, 0, 2);
  }
  try {
    const RunningServer server(config, {}, 64, other);
    FAIL() << "rows of two runs are mixed";
  } catch (const base::Error& error) {
    EXPECT_EQ(std::string(error.what()),
              config.directory +
                  ": holds rows of another run: courses.train is \"dynamic-box\", expected the "
                  "default; run.seed is the default, expected 5; set these keys back, or give this "
                  "run another service.state");
  }
  { const RunningServer again(config); }
  std::filesystem::remove(RunPath(config.directory));  // As an earlier version leaves it.
  { const RunningServer adopts(config, {}, 64, other); }
  EXPECT_THROW(const RunningServer server(config), base::Error);
}

TEST(ReplayServerTest, NobodyReportsForAnother) {
  RunningServer server;
  transport::Context context;
  TestPeer actor(context, server.endpoint());
  actor.Send(ReportOf("actor", "a"));
  ExpectRefused(actor, proto::RefusalCode::kNoSession);
  actor.Send(HelloOf("actor", "a", 1));
  ASSERT_TRUE(actor.Expect<proto::Welcome>());
  actor.Send(ReportOf("learner", "a"));
  ExpectRefused(actor, proto::RefusalCode::kNotAllowed);
  actor.Send(ReportOf("actor", "b"));
  ExpectRefused(actor, proto::RefusalCode::kNotAllowed);
  actor.Send(ReportOf("actor", "a"));
  EXPECT_THAT(NamesOf(actor, "actor"), testing::ElementsAre("a"));
  EXPECT_THAT(NamesOf(actor, "learner"), testing::IsEmpty());
}

// With the key of one machine nobody ends or locks the actors of another.
TEST(ReplayServerTest, AKeyThatIsBoundToNamesMayHaveNoOthers) {
  const transport::KeyPair own = transport::NewKeyPair(), actors = transport::NewKeyPair();
  transport::Allowed allowed(transport::Role::kActor);
  allowed.names = "gpu-1 lab.*";
  RunningServer server({}, {.keys = own, .allowed = {{actors.public_key, allowed}}});
  transport::Context context;
  for (const char* name : {"gpu-2", "lab", "gpu-1", "lab.7"}) {
    SCOPED_TRACE(name);
    TestPeer actor(context, server.endpoint(), {.keys = actors, .server_key = own.public_key});
    actor.Send(HelloOf("actor", name, 1));
    if (transport::AllowsName(allowed.names, name)) {
      EXPECT_TRUE(actor.Expect<proto::Welcome>());
    } else {
      ExpectRefused(actor, proto::RefusalCode::kNotAllowed);
    }
  }
}

TEST(ReplayServerTest, AKeysRoleCountsAndNotWhatIsSaid) {
  const transport::KeyPair own = transport::NewKeyPair(), actors = transport::NewKeyPair(),
                           learners = transport::NewKeyPair();
  RunningServer server({}, {.keys = own,
                            .allowed = {{actors.public_key, transport::Role::kActor},
                                        {learners.public_key, transport::Role::kLearner}}});
  transport::Context context;
  TestPeer actor(context, server.endpoint(), {.keys = actors, .server_key = own.public_key});
  TestPeer learner(context, server.endpoint(), {.keys = learners, .server_key = own.public_key});
  const proto::SampleRequest request{.cursor = 0, .batch = 1, .history = 1, .n_step = 1};
  RowsSource source(kBeams, kStreams, 1);
  const Chunk chunk = source.Next();

  actor.Send(HelloOf("learner", "l"));
  ExpectRefused(actor, proto::RefusalCode::kNotAllowed);
  actor.Send(request);
  ExpectRefused(actor, proto::RefusalCode::kNotAllowed);
  actor.Send(HelloOf("actor", "a", 1));
  ASSERT_TRUE(actor.Expect<proto::Welcome>());
  actor.Send(request);
  ExpectRefused(actor, proto::RefusalCode::kNotAllowed);
  actor.Send(proto::PriorityUpdate{.count = 1});
  ExpectRefused(actor, proto::RefusalCode::kNotAllowed);
  actor.Send(ReportOf("learner", "a"));
  ExpectRefused(actor, proto::RefusalCode::kNotAllowed);

  learner.Send(HelloOf("actor", "a", 2));
  ExpectRefused(learner, proto::RefusalCode::kNotAllowed);
  learner.Send(HelloOf("learner", "l"));
  ASSERT_TRUE(learner.Expect<proto::Welcome>());
  learner.Send(InsertOf(chunk, 1, 0), RowsSource::Bytes(chunk));
  ExpectRefused(learner, proto::RefusalCode::kNotAllowed);
  // The actor's session is still its own.
  actor.Send(InsertOf(chunk, 1, 0), RowsSource::Bytes(chunk));
  EXPECT_TRUE(actor.Expect<proto::InsertAck>());
  EXPECT_THAT(NamesOf(learner, "learner"), testing::IsEmpty());
}

}  // namespace
}  // namespace slalom::replay
