#include "learner/service/remote_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "metrics/catalogue.h"
#include "proto/replay_link.h"
#include "tests/learner/filled_replay.h"

/// What a learner reads from a real replay server whose table stands still.

namespace slalom::learner {
namespace {

using std::chrono::milliseconds;

proto::Hello LearnerHello() {
  proto::Hello hello;
  hello.role = "learner";
  hello.name = "learner";
  hello.spec_hash = kSpecHash;
  hello.num_beams = kBeams;
  return hello;
}

// Of two kinds, batch k is of kind k mod 2, and a stream that goes on from a cursor gives the same.
TEST(BatchStreamTest, KindsTakeTurnsAndGoOnFromACursor) {
  FilledReplay replay;
  const std::vector<replay::SampleSpec> kinds = {{.batch = 16, .n_step = 4},
                                                 {.batch = 24, .n_step = 1}};
  const auto read = [&](std::uint64_t cursor, int count, bool reconnects = false) {
    transport::Context context;
    BatchStream stream(context, {.endpoint = replay.endpoint()}, LearnerHello(), kBeams, kinds, 3,
                       cursor);
    std::vector<std::vector<float>> discounts;
    for (int i = 0; i < count; ++i) {
      const RemoteBatches* batches = nullptr;
      WaitUntil([&] { return (batches = stream.Next(milliseconds(100))) != nullptr; });
      EXPECT_EQ(stream.cursor(), cursor + 2 * (i + 1));
      EXPECT_EQ(stream.in_flight(), 3 * 2);
      if (reconnects) stream.link().client().Reconnect();
      for (const replay::SampledRows& rows : batches->rows) {
        discounts.emplace_back(rows.discount.data(), rows.discount.data() + rows.batch);
      }
    }
    return discounts;
  };
  const auto all = read(0, 6);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].size(), static_cast<std::size_t>(kinds[i % 2].batch));
    // Of full windows: gamma^4, or gamma.
    const float full = i % 2 == 0 ? 0.99f * 0.99f * 0.99f * 0.99f : 0.99f;
    EXPECT_TRUE(std::ranges::any_of(all[i], [&](float x) { return std::abs(x - full) < 1e-6f; }));
  }
  const auto later = read(8, 2);
  EXPECT_EQ(later, std::vector(all.begin() + 8, all.end()));
  EXPECT_EQ(read(0, 4, /*reconnects=*/true), std::vector(all.begin(), all.begin() + 8));
  // Two for each update, and six ahead on each connection.
  EXPECT_LE(replay.requests(), 2 * (6 + 2 + 4) + 6 * (1 + 1 + 4));
}

TEST(BatchStreamTest, EndsIfALearnerOfItsNameStartsLater) {
  const FilledReplay replay;
  transport::Context context;
  const auto stream_of = [&](std::uint64_t session) {
    proto::Hello hello = LearnerHello();
    hello.session = session;
    return std::make_unique<BatchStream>(context,
                                         transport::ClientOptions{.endpoint = replay.endpoint()},
                                         hello, kBeams, std::vector<replay::SampleSpec>{{}}, 3, 0);
  };
  const auto older = stream_of(1);
  WaitUntil([&] { return older->Next(milliseconds(100)) != nullptr; });
  const auto newer = stream_of(2);
  WaitUntil([&] { return newer->Next(milliseconds(100)) != nullptr; });
  std::string error;
  WaitUntil([&] {
    try {
      older->Next(milliseconds(100));
    } catch (const base::Error& e) {
      error = e.what();
    }
    return !error.empty();
  });
  EXPECT_THAT(error, ::testing::HasSubstr("another learner named"));
  EXPECT_NE(newer->Next(milliseconds(1000)), nullptr);
}

// The server's limiter has earned kUpdates batches; what is asked for beside them takes none away.
/// The scans and numbers of a sample.
std::vector<float> ContentOf(const replay::SampledRows& rows) {
  std::vector<float> content(rows.state.data(), rows.state.data() + rows.state.size());
  for (const auto* const scans : {&rows.ranges_cm, &rows.next_ranges_cm}) {
    for (const std::uint16_t* const scan : *scans)
      content.insert(content.end(), scan, scan + kBeams);
  }
  return content;
}

// Whether the mirror holds the whole table, some of it or a single scan, over new connections and
// new hellos, and while windows are asked for.
TEST(BatchStreamTest, AMirrorChangesNoBatchAndHasEachScanSentOnce) {
  const FilledReplay replay(kSteps, 10.0);
  const std::vector<replay::SampleSpec> kinds = {{.batch = 40, .history = 3, .n_step = 4},
                                                 {.batch = 24, .n_step = 1}};
  const replay::SampleSpec windows{.batch = 16, .history = 5};
  const auto read = [&](std::int64_t places, bool is_disturbed) {
    transport::Context context;
    BatchStream stream(context, {.endpoint = replay.endpoint()}, LearnerHello(), kBeams, kinds, 3,
                       0, places);
    std::vector<std::vector<float>> contents;
    int num_scans = 0;
    for (int i = 0; i < 60; ++i) {
      const RemoteBatches* batches = nullptr;
      WaitUntil([&] { return (batches = stream.Next(milliseconds(100))) != nullptr; });
      for (const replay::SampledRows& rows : batches->rows) contents.push_back(ContentOf(rows));
      EXPECT_EQ(batches->header.mirror != 0, places != 0);
      num_scans += batches->header.num_scans;
      if (!is_disturbed) continue;
      if (const auto* const rows = stream.TakeWindows()) EXPECT_EQ(rows->history, 5);
      stream.AskWindows(windows);
      if (i % 20 == 7) stream.link().client().Reconnect();
      if (i % 20 == 17) stream.link().SayHello();
    }
    if (places >= kSteps && !is_disturbed) {
      EXPECT_GT(num_scans, 0);
      EXPECT_LE(num_scans, kSteps + kSteps / 20) << "of steps and of ends of episodes";
    }
    return contents;
  };
  const auto expected = read(0, false);
  for (const std::int64_t places : {std::int64_t{10000}, std::int64_t{100}, std::int64_t{1}}) {
    EXPECT_EQ(read(places, false), expected) << places;
    EXPECT_EQ(read(places, true), expected) << places;
  }
  EXPECT_EQ(read(0, true), expected);
}

TEST(BatchStreamTest, WindowsCostTheRunNoBatch) {
  const FilledReplay replay;
  const replay::SampleSpec batch = {.batch = 4, .history = 2, .n_step = 1};
  const replay::SampleSpec window = {.batch = 8, .history = 5, .n_step = 1};
  const auto read = [&](int every) {
    transport::Context context;
    BatchStream stream(context, {.endpoint = replay.endpoint()}, LearnerHello(), kBeams, {batch}, 3,
                       0);
    std::vector<std::int64_t> sequences;
    int num_windows = 0;
    for (std::int64_t i = 0; i < kUpdates; ++i) {
      const RemoteBatches* batches = nullptr;
      WaitUntil([&] { return (batches = stream.Next(milliseconds(100))) != nullptr; });
      const auto& drawn = batches->rows[0].sequence;
      sequences.insert(sequences.end(), drawn.begin(), drawn.end());
      if (const replay::SampledRows* windows = stream.TakeWindows()) {
        EXPECT_EQ(windows->batch, 8);
        EXPECT_EQ(windows->history, 5);
        ++num_windows;
      }
      if (every > 0 && i % every == 0) stream.AskWindows(window);
      if (every > 0 && i == kUpdates / 2) {  // What was asked for never comes.
        stream.link().client().Reconnect();
        num_windows = 0;
      }
    }
    // One at a time, each of which is told once.
    EXPECT_GE(num_windows, every > 0 ? 3 : 0);
    EXPECT_LE(num_windows, every > 0 ? 1 + kUpdates / every : 0);
    return sequences;
  };
  const auto with_windows = read(10);
  EXPECT_EQ(with_windows, read(0));
}

// The steps have earned no further batch, so the server holds whatever it is asked for.
TEST(BatchStreamTest, WindowsDoNotPileUpWhileTheServerHoldsBack) {
  const FilledReplay replay;
  transport::Context context;
  BatchStream stream(context, {.endpoint = replay.endpoint()}, LearnerHello(), kBeams,
                     {{.batch = 4, .n_step = 1}}, 3, kUpdates);
  WaitUntil([&] {
    stream.Next(milliseconds(1));
    return stream.in_flight() == 3;
  });
  const int welcomes = stream.link().num_welcomes();
  // More than the server lets wait would be refused, upon which the link says hello again.
  for (int i = 0; i < 1200; ++i) {
    stream.AskWindows({.batch = 8, .history = 5, .n_step = 1});
    EXPECT_EQ(stream.Next(milliseconds(1)), nullptr);
  }
  EXPECT_EQ(stream.link().num_welcomes(), welcomes);
}

TEST(RemoteSourceTest, EachLookTellsWhatIsNewSinceTheOneBefore) {
  const FilledReplay replay;
  transport::Context context;
  metrics::Registry registry("learner", "learner");
  const PolicyServer policies(context, {.endpoint = "tcp://127.0.0.1:*"}, kSpecHash, {}, registry);
  RemoteSource source(context, {{.endpoint = replay.endpoint()}}, LearnerHello(), kBeams,
                      {{.batch = 16, .n_step = 4}, {.batch = 24, .n_step = 1}}, 3, 0, policies,
                      registry);
  source.Restore({}, {{"cursor", 8}, {"steps", 100}});
  source.Start();
  EXPECT_EQ(source.num_drawn(), 4);
  EXPECT_EQ(source.steps(), 100);
  for (std::int64_t drawn = 5; drawn < 7; ++drawn) {
    WaitUntil([&] { return source.Next() != nullptr; });
    source.Start();  // As after a checkpoint.
    EXPECT_EQ(source.num_drawn(), drawn);
    EXPECT_EQ(source.steps(), kSteps);
  }

  proto::Hello hello = LearnerHello();
  hello.role = "actor";
  hello.name = "b";
  hello.session = 1;
  hello.num_streams = kStreams;
  service::ReplayLink actor(context, {.endpoint = replay.endpoint()}, hello);
  run::MetricsRow row;
  const auto hear_of = [&](double episodes, double cost) {
    WaitUntil([&] {
      actor.Receive(milliseconds(1));
      return actor.welcomed();
    });
    proto::Report report;
    report.role = "actor";
    report.name = "b";
    report.figures = {{"episodes", episodes}, {"success_rate", 0.5}, {"mean_cost", cost}};
    ASSERT_TRUE(actor.Send(report));
    WaitUntil([&] {
      source.Next();
      source.Describe(row);
      return static_cast<double>(row.episodes) == episodes;
    });
  };
  hear_of(50.0, 1.0);
  EXPECT_EQ(source.TakeEndedEpisodes().count, 0) << "counted before, for all it knows";
  for (const double cost : {2.0, 3.0}) {
    hear_of(60.0 + 10.0 * cost, cost);
    hear_of(61.0 + 10.0 * cost, cost);
    const EndedEpisodes ended = source.TakeEndedEpisodes();
    EXPECT_EQ(ended.count, cost == 2.0 ? 31 : 10);
    EXPECT_EQ(ended.mean_cost, cost);
    EXPECT_EQ(source.TakeEndedEpisodes().count, 0);
  }

  const auto waited = registry.counter(metrics::kBlockedSeconds, {metrics::queue::kBatches});
  source.Report(row, 0.0, false);
  EXPECT_EQ(registry.gauge(metrics::kPolicyLag).value(), 0.0 - kActingVersion);
  const double seconds = waited.value();
  EXPECT_GT(seconds, 0.0);
  source.Report(row, 0.0, false);
  EXPECT_EQ(waited.value(), seconds);
}

/// A source of batches from several replay servers.
class Shards {
 public:
  Shards(const std::vector<const FilledReplay*>& replays, const replay::SampleSpec& spec,
         const nlohmann::json& state = {{"cursor", 0}, {"steps", 0}})
      : policies_(context_, {.endpoint = "tcp://127.0.0.1:*"}, kSpecHash, {}, registry_),
        source_(context_, Options(replays), LearnerHello(), kBeams, {spec}, 3, kSteps, policies_,
                registry_) {
    source_.Restore({}, state);
    source_.Start();
  }

  const std::vector<replay::SampledRows>* Next() {
    const std::vector<replay::SampledRows>* batches = nullptr;
    WaitUntil([&] { return (batches = source_.Next()) != nullptr; });
    return batches;
  }
  /// Batches that came from each server so far.
  std::vector<int> Drawn() {
    nlohmann::json state;
    source_.Save({}, state);
    std::vector<int> drawn;
    for (const nlohmann::json& shard : state.at("shards")) drawn.push_back(shard.at("cursor"));
    return drawn;
  }
  RemoteSource& source() { return source_; }

 private:
  static std::vector<transport::ClientOptions> Options(
      const std::vector<const FilledReplay*>& replays) {
    std::vector<transport::ClientOptions> options;
    for (const FilledReplay* const replay : replays) {
      options.push_back({.endpoint = replay->endpoint()});
    }
    return options;
  }

  transport::Context context_;
  metrics::Registry registry_{"learner", "learner"};
  PolicyServer policies_;
  RemoteSource source_;
};

TEST(RemoteSourceTest, BatchesComeFromEachServer) {
  const FilledReplay small(200, 10.0);
  const FilledReplay large(600, 10.0);
  Shards shards({&small, &large}, {.batch = 16});
  for (int i = 0; i < 400; ++i) shards.Next();
  EXPECT_EQ(shards.source().steps(), 800);
  EXPECT_EQ(shards.source().num_drawn(), 400);
  const std::vector<int> drawn = shards.Drawn();
  EXPECT_EQ(drawn[0] + drawn[1], 400);
  // In proportion to what they hold only as far as each has a batch when its turn comes.
  EXPECT_GE(drawn[0], 20);
  EXPECT_GE(drawn[1], 20);
  run::MetricsRow row;
  shards.source().Describe(row);
  EXPECT_EQ(row.table_steps, 800);
}

TEST(RemoteSourceTest, PrioritiesGoToTheServerThatSentTheRows) {
  FilledReplay first(200, 10.0);
  FilledReplay second(200, 10.0);
  Shards shards({&first, &second}, {.batch = 16, .prioritized = true});
  const std::vector<float> priorities(16, 0.5F);
  for (int i = 0; i < 50; ++i) {
    const int before = shards.Drawn()[0];
    const auto& sequence = shards.Next()->front().sequence;
    if (shards.Drawn()[0] == before) continue;
    shards.source().SetPriorities({sequence.data(), sequence.size()}, priorities);
  }
  WaitUntil([&] { return first.priorities_updated() > 0.0; });
  EXPECT_EQ(second.priorities_updated(), 0.0);
}

TEST(RemoteSourceTest, OthersTakeTheTurnsOfAServerThatIsGone) {
  FilledReplay first;
  const FilledReplay second;
  Shards shards({&first, &second}, {.batch = 16});
  while (shards.Drawn()[0] < 5 || shards.Drawn()[1] < 5) shards.Next();
  first.Stop();
  const int before = shards.Drawn()[1];
  for (int i = 0; i < 50; ++i) shards.Next();
  EXPECT_GE(shards.Drawn()[1], before + 45) << "up to three were on their way from the first";
  EXPECT_EQ(shards.source().steps(), 2 * kSteps);
}

TEST(RemoteSourceTest, EachServerGoesOnAtItsCursorAndANewOneBeginsAtTheFirst) {
  const FilledReplay first;
  const FilledReplay second;
  const FilledReplay third;
  const nlohmann::json state = {
      {"shards", {{{"cursor", 7}, {"steps", 90}}, {{"cursor", 20}, {"steps", 50}}}}};
  Shards shards({&first, &second, &third}, {.batch = 16}, state);
  EXPECT_EQ(shards.Drawn(), std::vector<int>({7, 20, 0}));
  EXPECT_EQ(shards.source().steps(), 140);
  EXPECT_EQ(shards.source().num_drawn(), 27);
  nlohmann::json saved;
  shards.source().Save({}, saved);
  EXPECT_EQ(saved.at("shards")[1], state.at("shards")[1]);
  EXPECT_THROW(Shards({&first}, {.batch = 16}, state), base::Error);

  // One server's checkpoint, to which another is added.
  Shards more({&first, &second}, {.batch = 16}, {{"cursor", 8}, {"steps", 100}});
  EXPECT_EQ(more.Drawn(), std::vector<int>({8, 0}));
}

TEST(StreamMetricsTest, ALearnerThatWaitsForLongIsNotWellUntilABatchComes) {
  metrics::Registry registry("learner", "learner");
  StreamMetrics metrics(registry);
  metrics.AddWait(6.0);
  metrics.AddBatch();
  metrics.AddWait(6.0);
  EXPECT_EQ(registry.fault(), "");
  metrics.AddWait(6.0);
  EXPECT_EQ(registry.fault(), "no batch came from the replay server for 12 s");
  metrics.AddBatch();
  EXPECT_EQ(registry.fault(), "");
}

}  // namespace
}  // namespace slalom::learner
