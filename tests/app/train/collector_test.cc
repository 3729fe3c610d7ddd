#include "app/train/collector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "app/train/table_source.h"
#include "learner/learner.h"
#include "metrics/catalogue.h"
#include "policy/network_agent.h"
#include "tests/support/fake_environment.h"
#include "tests/support/scratch_directory.h"

namespace slalom::train {
namespace {

constexpr int kBeams = 8;

policy::PolicySpec SmallSpec() {
  policy::PolicySpec spec;
  spec.observation.num_beams = kBeams;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {4};
  return spec;
}

struct Fixture {
  explicit Fixture(std::uint64_t seed = 1)
      : environments(4, {0.5, 0.5}, 30, kBeams),
        agent(learner::Learner({}, SmallSpec(), seed).Snapshot()),
        actor(actor::ActorConfig{}, environments, agent, 7) {}

  slalom::testing::FakeEnvironment environments;
  policy::NetworkAgent agent;
  actor::Actor actor;
};

std::int64_t CountSteps(const replay::Chunk& chunk) {
  std::int64_t steps = 0;
  for (const auto flags : chunk.flags) steps += (flags & replay::kRowFinal) == 0;
  return steps;
}

TEST(ThreadedCollectorTest, NoStepOfTheActorIsLostWhenItIsStopped) {
  for (const int take : {0, 1, 50}) {
    Fixture f;
    ThreadedCollector collector(f.actor, f.agent, kBeams, 3);
    std::int64_t steps = 0;
    for (int i = 0; i < take; ++i) {
      auto chunk = collector.Next();
      ASSERT_NE(chunk, nullptr);
      steps += CountSteps(*chunk);
      collector.Recycle(std::move(chunk));
    }
    collector.Stop();
    while (auto chunk = collector.Next()) {
      steps += CountSteps(*chunk);
      collector.Recycle(std::move(chunk));
    }
    EXPECT_EQ(steps, f.actor.stats().num_steps);
    EXPECT_GE(steps, 4 * take);
  }
}

TEST(ThreadedCollectorTest, GivesTheSameRowsAsInline) {
  Fixture a;
  Fixture b;
  InlineCollector in_line(a.actor, a.agent, kBeams);
  ThreadedCollector threaded(b.actor, b.agent, kBeams, 2);
  for (int i = 0; i < 100; ++i) {
    auto expected = in_line.Next();
    auto found = threaded.Next();
    ASSERT_EQ(found->action, expected->action);
    ASSERT_EQ(found->ranges_cm, expected->ranges_cm);
    in_line.Recycle(std::move(expected));
    threaded.Recycle(std::move(found));
  }
}

TEST(ThreadedCollectorTest, APublishedPolicyReachesTheAgent) {
  Fixture f;
  auto other = learner::Learner({}, SmallSpec(), 99).Snapshot();
  other.version = 42;
  ThreadedCollector collector(f.actor, f.agent, kBeams, 1);
  collector.Publish(other);
  for (int i = 0; i < 10; ++i) collector.Recycle(collector.Next());
  collector.Stop();
  while (collector.Next()) {
  }
  EXPECT_EQ(f.agent.snapshot().version, 42);
}

// A checkpoint stops the collector and begins another one, which must not act by an older policy.
TEST(ThreadedCollectorTest, APolicyPublishedAfterTheLastStepReachesTheAgentAllTheSame) {
  Fixture f;
  auto other = learner::Learner({}, SmallSpec(), 99).Snapshot();
  other.version = 42;
  ThreadedCollector collector(f.actor, f.agent, kBeams, 1);
  // The actor has filled all chunks and waits for one to come back.
  std::vector<std::unique_ptr<replay::Chunk>> taken;
  for (int i = 0; i < 3; ++i) taken.push_back(collector.Next());
  collector.Publish(other);
  collector.Stop();
  EXPECT_EQ(collector.Next(), nullptr);
  EXPECT_EQ(f.agent.snapshot().version, 42);
}

class ThrowingEnvironment : public slalom::testing::FakeEnvironment {
 public:
  using FakeEnvironment::FakeEnvironment;
  void Step(std::span<const float>, std::span<env::StepResult>) override {
    throw std::runtime_error("the robot is on fire");
  }
};

TEST(ThreadedCollectorTest, WhatTheActorThrowsReachesTheLearner) {
  ThrowingEnvironment environments(2, {0.5}, 30, kBeams);
  policy::NetworkAgent agent(learner::Learner({}, SmallSpec(), 1).Snapshot());
  actor::Actor actor(actor::ActorConfig{}, environments, agent, 7);
  ThreadedCollector collector(actor, agent, kBeams, 2);
  EXPECT_THROW(
      {
        while (auto chunk = collector.Next()) collector.Recycle(std::move(chunk));
      },
      std::runtime_error);
}

/// A source whose batches nobody learns from.
struct Source : Fixture {
  Source(const std::filesystem::path& checkpoints, bool deterministic)
      : table({.capacity = 1000}, kBeams),
        source(Config(deterministic), {kSpec}, actor, agent, table, checkpoints, registry) {
    source.Start();
  }
  static RunConfig Config(bool deterministic) {
    RunConfig config;
    config.run.deterministic = deterministic;
    config.run.updates_per_step = 0.1;
    config.run.learning_starts = 100;
    return config;
  }

  static constexpr replay::SampleSpec kSpec{.batch = 4, .history = 1, .n_step = 1};
  metrics::Registry registry{"train", "test"};
  replay::Table table;
  TableSource source;
};

TEST(TableSourceTest, TellsEachEpisodeOnceAndSamplesForFiguresChangeNoBatch) {
  const slalom::test::ScratchDirectory scratch;
  Source plain(scratch.path() / "a", true), asked(scratch.path() / "b", true);
  std::int64_t num_ended = 0;
  int num_batches = 0;
  for (int turn = 0; turn < 600; ++turn) {
    const auto *expected = plain.source.Next(), *found = asked.source.Next();
    ASSERT_EQ(found == nullptr, expected == nullptr);
    if (found != nullptr) {
      EXPECT_TRUE(std::ranges::equal(found->at(0).sequence, expected->at(0).sequence)) << turn;
      ++num_batches;
    }
    (void)asked.source.SampleForFigures(Source::kSpec);
    if (turn % 50 == 49) num_ended += plain.source.TakeEndedEpisodes().count;
  }
  run::MetricsRow row;
  plain.source.Describe(row);
  EXPECT_GT(row.episodes, 10);
  EXPECT_EQ(num_ended, row.episodes);
  EXPECT_EQ(plain.source.num_drawn(), num_batches);
  const auto waited = [](Source& source) {
    return source.registry.counter(metrics::kBlockedSeconds, {metrics::queue::kBatches}).value();
  };
  EXPECT_EQ(waited(plain), 0.0) << "it steps the actor itself";
}

TEST(TableSourceTest, NoStepIsLostHoweverOftenItIsStopped) {
  const slalom::test::ScratchDirectory scratch;
  Source threads(scratch.path(), false);
  for (int round = 0; round < 10; ++round) {
    threads.source.Start();
    for (int turn = 0; turn < 5 * round; ++turn) (void)threads.source.Next();
    threads.source.Stop();
    EXPECT_EQ(threads.source.steps(), threads.actor.stats().num_steps);
    EXPECT_EQ(threads.table.num_steps(), std::min<std::int64_t>(threads.source.steps(), 1000));
  }
}

}  // namespace
}  // namespace slalom::train
