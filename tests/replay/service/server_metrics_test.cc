#include "replay/service/server_metrics.h"

#include <gtest/gtest.h>

#include <chrono>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "metrics/catalogue.h"
#include "tests/replay/service/model_actor.h"
#include "tests/replay/service/rows_source.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::replay {
namespace {

using std::chrono::seconds;

constexpr int kBeams = 1;

/// The parts of a server whose figures are shown.
struct Parts {
  explicit Parts(Sessions known = {}) : sessions(std::move(known)) {}

  Sessions sessions;
  ReplayServerSpec spec{.endpoint = "",
                        .table = {.capacity = 100},
                        .shape = kBeams,
                        .updates_per_step = 1.0,
                        .learning_starts = 10};
  metrics::Registry registry{"replay", "replay"};
  ServerMetrics shown{registry, spec};
  Table table{{.capacity = 100}, kBeams};
  RateLimiter limiter{{.updates_per_step = 1.0, .learning_starts = 10}, 0};
  FakeNetwork network;
  NoLog log;
  InsertDesk inserts{
      {.flow = {.window_bytes = 1 << 20, .room_bytes = 1 << 20, .chunk_bytes = 1 << 10}},
      sessions,
      &table,
      &limiter,
      &log,
      &network};
  SampleDesk samples{{.max_sample_bytes = 1 << 20}, &table, &limiter, &network};

  ServerMetrics::Sources Sources() {
    return {.table = &table, .limiter = &limiter, .inserts = &inserts, .samples = &samples};
  }
  double Blocked(std::string_view queue) {
    return registry.counter(metrics::kBlockedSeconds, {queue}).value();
  }
  double GaugeOf(const metrics::Spec& metric) { return registry.gauge(metric).value(); }
};

TEST(ServerMetricsTest, TimeThatWorkIsHeldCountsAtItsQueue) {
  Parts parts;
  ServerMetrics::Sources sources = parts.Sources();
  sources.held_inserts_s = 1.5;
  sources.held_samples_s = 0.25;
  sources.malformed = 3;
  sources.connections = {.rejected = 4, .ended = {}, .open = 5, .limit = 6};
  for (const transport::EndReason reason : transport::kEndReasons) {
    sources.connections.ended[reason] = 7 + static_cast<int>(reason);
  }
  sources.peers = {{"actor", 2}, {"learner", 1}};
  const auto now = std::chrono::steady_clock::now();
  parts.shown.Show(sources, now + seconds(1));
  parts.shown.Show(sources, now + seconds(2));
  EXPECT_EQ(parts.Blocked("inserts"), 3.0);
  EXPECT_EQ(parts.Blocked("samples"), 0.5);
  EXPECT_EQ(parts.Blocked("journal"), 0.0);
  EXPECT_EQ(parts.registry.counter(metrics::kMessagesMalformed).value(), 3);
  EXPECT_EQ(parts.registry.counter(metrics::kRejectedConnections).value(), 4);
  EXPECT_EQ(parts.GaugeOf(metrics::kServerConnections), 5);
  EXPECT_EQ(parts.GaugeOf(metrics::kServerConnectionsLimit), 6);
  for (const transport::EndReason reason : transport::kEndReasons) {
    EXPECT_EQ(
        parts.registry.counter(metrics::kConnectionsEnded, {transport::ToString(reason)}).value(),
        7 + static_cast<int>(reason));
  }
  EXPECT_EQ(parts.registry.gauge(metrics::kConnectedPeers, {"actor"}).value(), 2);
  EXPECT_EQ(parts.registry.gauge(metrics::kConnectedPeers, {"learner"}).value(), 1);
  EXPECT_EQ(parts.registry.gauge(metrics::kConnectedPeers, {"evaluator"}).value(), 0);
  sources.peers = {{"actor", 1}};
  parts.shown.Show(sources, now + seconds(3));
  EXPECT_EQ(parts.registry.gauge(metrics::kConnectedPeers, {"actor"}).value(), 1);
  EXPECT_EQ(parts.registry.gauge(metrics::kConnectedPeers, {"learner"}).value(), 0);
}

TEST(ServerMetricsTest, RatesAreThoseSinceTheReportBefore) {
  constexpr std::int64_t kRecovered = 40;
  Recovered recovered{.table = Table({.capacity = 100}, kBeams), .sessions = {}, .segments = {}};
  ASSERT_TRUE(recovered.sessions.Put({.id = 1, .name = "a", .number = 1, .num_streams = 2}).ok());
  ASSERT_FALSE(recovered.sessions.Accept(1, 0, kRecovered));
  Parts parts(recovered.sessions);
  parts.limiter.AddSteps(kRecovered);
  parts.shown.ShowRecovery(recovered);
  RowsSource source(kBeams, 2, 1);
  const transport::PeerId learner = parts.network.Connect(), actor = parts.network.Connect();
  const auto now = std::chrono::steady_clock::now();
  const auto take_all = [&](const transport::PeerId& peer) {
    int count = 0;
    while (parts.network.Take(peer)) ++count;
    return count;
  };
  parts.inserts.Hello(actor, {.role = "actor", .name = "a", .session = 1, .num_streams = 2}, now);
  std::uint64_t sequence = 1;
  const auto rates_after = [&](int second, int num_chunks, int num_batches) {
    for (int i = 0; i < num_chunks; ++i) {
      const Chunk chunk = source.Next(1);
      parts.inserts.Insert(actor,
                           {.session = 1,
                            .sequence = sequence++,
                            .num_rows = chunk.num_rows(),
                            .num_beams = kBeams,
                            .num_steps = RowsSource::NumSteps(chunk)},
                           RowsSource::Bytes(chunk), now);
      parts.inserts.Advance(now, 10);
      EXPECT_GT(take_all(actor), 0);
    }
    for (int i = 0; i < num_batches; ++i) {
      parts.samples.Ask(learner, "learner",
                        {.cursor = static_cast<std::uint64_t>(parts.samples.counts().batches),
                         .batch = 4,
                         .history = 1,
                         .n_step = 1});
      parts.samples.Advance(1, 0.0);
      EXPECT_EQ(take_all(learner), 1);
    }
    parts.shown.Show(parts.Sources(), now + seconds(second));
    const auto& figures = parts.shown.report().figures;
    return std::pair(figures.at("steps_per_s"), figures.at("batches_per_s"));
  };
  EXPECT_EQ(rates_after(1, 0, 0).first, 0.0) << "what was recovered is no news";
  EXPECT_EQ(rates_after(2, 9, 6), std::pair(18.0, 6.0));
  EXPECT_EQ(rates_after(4, 6, 4), std::pair(6.0, 2.0));
  EXPECT_EQ(rates_after(5, 0, 0), std::pair(0.0, 0.0));
  // 10 batches of 4 for the steps beyond the first 10.
  EXPECT_DOUBLE_EQ(parts.GaugeOf(metrics::kSamplesPerInsert), 10 * 4.0 / (kRecovered + 30 - 10));
}

TEST(ServerMetricsTest, AJournalThatFailsIsToldAndTheAgeOfItsLastSync) {
  const test::ScratchDirectory scratch;
  Parts parts;
  Journal journal(
      {.directory = scratch.path(), .sync_interval = std::chrono::milliseconds(1), .shape = kBeams},
      JournalLock(scratch.path()), {}, 1, StateRecord{}, [] {});
  ServerMetrics::Sources sources = parts.Sources();
  sources.journal = &journal;
  const auto wall_s = [](auto time) {
    return std::chrono::duration<double>(time.time_since_epoch()).count();
  };
  const double before = wall_s(std::chrono::system_clock::now());
  while (journal.status().syncs < 2) std::this_thread::yield();
  const auto now = std::chrono::steady_clock::now();
  parts.shown.Show(sources, now + seconds(10));
  EXPECT_EQ(parts.Blocked("journal"), 0.0);
  EXPECT_EQ(parts.GaugeOf(metrics::kJournalFailing), 0.0);
  EXPECT_EQ(parts.registry.fault(), "");
  // The start of the sync, on the clock of the wall, which is not the time of this call.
  const double synced =
      wall_s(journal.status().synced) - wall_s(now) + wall_s(std::chrono::system_clock::now());
  EXPECT_GE(parts.GaugeOf(metrics::kJournalSyncTimestamp), before - 0.001);
  EXPECT_LE(parts.GaugeOf(metrics::kJournalSyncTimestamp), synced + 0.001);
  EXPECT_EQ(parts.GaugeOf(metrics::kJournalBytes), journal.status().disk_bytes);
  for (const std::int64_t shown = journal.status().syncs; journal.status().syncs <= shown;) {
    std::this_thread::yield();
  }
  {
    const test::FailingCalls failing(
        {.function = "f*sync", .path = "*", .error = EIO, .last = 1000000}, scratch.path() / "n");
    while (journal.status().failing.empty()) std::this_thread::yield();
  }
  parts.shown.Show(sources, now + seconds(13));
  EXPECT_EQ(parts.Blocked("journal"), 3.0);
  EXPECT_EQ(parts.GaugeOf(metrics::kJournalFailing), 1.0);
  EXPECT_EQ(parts.registry.counter(metrics::kJournalErrors).value(), 1);
  EXPECT_NE(parts.registry.fault(), "");
  EXPECT_EQ(parts.shown.report().facts.at("journal"), parts.registry.fault());
  // Over both calls each sync counts once, with its time.
  const auto total = [&](std::string_view name) {
    std::istringstream lines(parts.registry.Text());
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with(name)) return std::stod(line.substr(line.rfind(' ')));
    }
    return -1.0;
  };
  const std::string name(metrics::kJournalSyncSeconds.name);
  const Journal::Status status = journal.status();
  EXPECT_EQ(total(name + "_count"), static_cast<double>(status.syncs));
  EXPECT_NEAR(total(name + "_sum"), status.sync_s, 1e-6 * status.sync_s);
}

}  // namespace
}  // namespace slalom::replay
