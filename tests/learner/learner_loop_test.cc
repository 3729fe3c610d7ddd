#include "learner/loop/learner_loop.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "learner/run/metrics_table.h"
#include "metrics/catalogue.h"
#include "tests/learner/random_rows.h"
#include "tests/support/held_clock.h"
#include "tests/support/scratch_directory.h"

/// The loop between a source and a sink that only write down what they are asked.

namespace slalom::learner {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

constexpr int kBeams = 8;
constexpr std::int64_t kStepsPerUpdate = 8;

policy::PolicySpec Spec(const MethodConfig& method) {
  policy::PolicySpec spec;
  spec.planning = PlanningOf(method);
  spec.observation.num_beams = kBeams;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {8};
  return spec;
}

MethodConfig Method(bool prioritized = false) {
  MethodConfig method;
  method.learner.batch_size = 8;
  method.learner.prioritized = prioritized;
  return method;
}

/// Batch k is random numbers of seed k, and k updates are earned by 8 k steps. It is at rest after
/// every second batch.
class FakeSource final : public BatchSource {
 public:
  explicit FakeSource(std::vector<replay::SampleSpec> specs) : specs_(std::move(specs)) {}

  void Start() override { started = true; }
  void Stop() override {
    ahead += started ? steps_at_stop : 0;
    started = false;
  }
  const std::vector<replay::SampledRows>* Next() override {
    EXPECT_TRUE(started);
    ++position;
    if (on_next) on_next(position);
    if (gives_none) return nullptr;
    batches_ =
        std::make_unique<RandomBatches>(specs_, kBeams, static_cast<std::uint64_t>(position));
    replay::SampledRows& rows = batches_->batches[0];
    for (int i = 0; i < rows.batch; ++i) rows.n_step_return[i] *= scale;
    return &batches_->batches;
  }
  bool IsWaiting() const override { return waits; }
  bool IsAtRest() const override { return position % 2 == 0; }
  std::int64_t num_drawn() const override { return position; }
  std::int64_t steps() const override { return position * kStepsPerUpdate + ahead; }
  EndedEpisodes TakeEndedEpisodes() override {
    ++num_episode_looks;
    return {};
  }
  void SetPriorities(std::span<const std::int64_t> sequence,
                     std::span<const float> priority) override {
    EXPECT_EQ(sequence.data(), batches_->batches[0].sequence.data());
    EXPECT_EQ(sequence.size(), 8u);
    EXPECT_EQ(priority.size(), 8u);
    ++num_priorities;
  }
  const replay::SampledRows* SampleForFigures(const replay::SampleSpec&) override {
    return nullptr;
  }
  void Describe(run::MetricsRow& row) override { row.episodes = 3; }
  void Report(const run::MetricsRow& row, double, bool) override { reported = row; }
  void Save(const fs::path&, nlohmann::json& state) override {
    EXPECT_FALSE(started);
    if (fails) throw base::Error("no space");
    state["position"] = position;
    state["ahead"] = ahead;
    saved_at.push_back(steps());
  }
  void Restore(const fs::path&, const nlohmann::json& state) override {
    position = state.at("position").get<std::int64_t>();
    ahead = state.at("ahead").get<std::int64_t>();
    EXPECT_EQ(state.at("steps"), steps());
  }
  void KeepOnly(const std::vector<fs::path>& checkpoints) override {
    if (cannot_clear) throw base::Error("cannot be read");
    kept = checkpoints.size();
  }

  std::int64_t position = 0;
  std::int64_t steps_at_stop = 0;  ///< That come while it stops, as from a thread.
  std::int64_t ahead = 0;          ///< All of these.
  bool waits = false;
  bool started = false;
  bool gives_none = false;
  bool fails = false;
  bool cannot_clear = false;
  float scale = 1.0f;
  int num_priorities = 0;
  int num_episode_looks = 0;
  std::size_t kept = 0;
  run::MetricsRow reported;
  std::vector<std::int64_t> saved_at;
  std::function<void(std::int64_t)> on_next;

 private:
  const std::vector<replay::SampleSpec> specs_;
  std::unique_ptr<RandomBatches> batches_;
};

struct FakeSink final : PolicySink {
  void Publish(policy::PolicySnapshot acting, ShippedPolicy shipped, std::int64_t) override {
    versions.push_back(acting.version);
    EXPECT_EQ(shipped({}).version, acting.version);
  }
  void Serve() override { ++num_served; }

  std::vector<std::int64_t> versions;
  int num_served = 0;
};

/// A run of 100 updates in a directory of its own, unless told otherwise.
struct Loop {
  explicit Loop(const fs::path& directory, const MethodConfig& method = Method())
      : learner(method, Spec(method), 4), source(learner.sample_specs()) {
    plan.run.directory.root = directory;
    plan.run.settings.max_steps = 100 * kStepsPerUpdate;
    plan.run.settings.log_interval = 0.0;
    plan.run.settings.checkpoint_seconds = 0.0;
    plan.run.settings.publish_interval = 7;
    base::MakeDirectories(directory);
  }

  TrainingEnd Run(bool resume = false, std::stop_token stop = {}) {
    // A clock that goes forward by 10 ms at each look.
    const run::TrainingClock clock([this] {
      now_s += 0.01;
      return run::ClockReading{.wall_s = now_s, .processor_s = now_s};
    });
    LearnerLoop loop(plan, learner, source, sink, registry, clock);
    if (resume) EXPECT_TRUE(loop.Restore());
    return loop.Run(stop);
  }

  bool HasPolicy() const { return fs::exists(plan.run.directory.policy()); }

  LoopPlan plan;
  Learner learner;
  FakeSource source;
  FakeSink sink;
  metrics::Registry registry{"learner", "test"};
  double now_s = 0.0;
};

TEST(LearnerLoopTest, PublishesLogsAndEndsAtItsLimit) {
  const test::ScratchDirectory scratch;
  MethodConfig method = Method();
  method.learner.final_learning_rate_fraction = 0.0;
  Loop loop(scratch.path(), method);
  double half_way = 0.0;
  loop.source.on_next = [&](std::int64_t position) {
    if (position == 51) half_way = loop.source.reported.learning.critic_learning_rate;
  };
  EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
  EXPECT_NEAR(half_way, 0.5 * method.learner.critic_learning_rate, 1e-2 * half_way);
  std::vector<std::int64_t> expected;
  for (std::int64_t version = 7; version <= 100; version += 7) expected.push_back(version);
  EXPECT_EQ(loop.sink.versions, expected);
  EXPECT_EQ(loop.sink.num_served, 100);
  const auto policy = policy::LoadPolicy(loop.plan.run.directory.policy());
  EXPECT_EQ(policy.snapshot.version, 100);
  EXPECT_EQ(policy.metadata.at("steps"), "800");
  // A row after each turn; the last one says nothing new but its time.
  const std::string rows = base::ReadFile(loop.plan.run.directory.metrics());
  EXPECT_GE(std::count(rows.begin(), rows.end(), '\n'), 101);
  EXPECT_EQ(loop.source.reported.updates, 100);
  EXPECT_EQ(loop.source.reported.episodes, 3);
  EXPECT_EQ(loop.registry.counter(metrics::kUpdates).value(), 100.0);
  EXPECT_EQ(loop.registry.gauge(metrics::kRunFinished).value(), 1.0);
  EXPECT_EQ(loop.registry.gauge(metrics::kCheckpointUpdates).value(), 100.0);
  EXPECT_EQ(loop.source.num_priorities, 0);
}

// The constraint's multiplier depends on the updates between two looks, not on the clock.
TEST(LearnerLoopTest, PublishesNoMoreOftenThanTheSecondsSayButLooksAtEpisodesAllTheSame) {
  const test::ScratchDirectory scratch;
  test::HeldClock clock;
  Loop part(scratch.path()), rest(scratch.path());
  std::stop_source stop;
  for (Loop* loop : {&part, &rest}) {
    loop->plan.publish_seconds = 20.0;
    loop->source.on_next = [&](std::int64_t position) {
      clock.Advance(std::chrono::seconds(1));
      if (position == 64) stop.request_stop();
    };
  }
  EXPECT_EQ(part.Run(false, stop.get_token()), TrainingEnd::kStopped);
  EXPECT_THAT(part.sink.versions, ElementsAre(7, 27, 47));
  EXPECT_EQ(part.source.num_episode_looks, 64 / 7);
  EXPECT_EQ(rest.Run(true), TrainingEnd::kFinished);
  EXPECT_THAT(rest.sink.versions, ElementsAre(65, 85));
  EXPECT_EQ(rest.source.num_episode_looks, 100 / 7 - 64 / 7);
}

TEST(LearnerLoopTest, CheckpointsAndSnapshotsWaitUntilTheSourceIsAtRest) {
  const test::ScratchDirectory scratch;
  Loop loop(scratch.path());
  loop.plan.run.settings.checkpoint_steps = 200;  // Of 8 steps a turn, and at rest every 16.
  loop.plan.run.settings.snapshot_steps = {304};
  EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
  EXPECT_THAT(loop.source.saved_at, ElementsAre(208, 400, 608, 800));
  EXPECT_EQ(loop.source.kept, 2u);
  EXPECT_TRUE(fs::exists(loop.plan.run.directory.snapshots() / "step-000000000304.safetensors"));
}

TEST(LearnerLoopTest, CheckpointsByTimeAreAsFarApartAsTheSecondsSay) {
  const test::ScratchDirectory scratch;
  Loop loop(scratch.path());
  loop.plan.run.settings.checkpoint_seconds = 0.2;
  std::vector<double> saved_at_s;
  loop.source.on_next = [&](std::int64_t) {
    if (loop.source.saved_at.size() > saved_at_s.size()) saved_at_s.push_back(loop.now_s);
  };
  EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
  ASSERT_GE(saved_at_s.size(), 3u);
  for (std::size_t i = 1; i < saved_at_s.size(); ++i) {
    EXPECT_NEAR(saved_at_s[i] - saved_at_s[i - 1], 0.2, 0.1) << i;
  }
  Loop lockstep(scratch.path() / "lockstep");
  lockstep.plan.run.settings.checkpoint_seconds = 0.2;
  lockstep.plan.run.settings.deterministic = true;
  EXPECT_EQ(lockstep.Run(), TrainingEnd::kFinished);
  EXPECT_THAT(lockstep.source.saved_at, ElementsAre(800)) << "the clock decides nothing";
}

// Two waits of 0.6 s, and one of 4 s, of which a second counts.
TEST(LearnerLoopTest, TimeCountsWhileItWaitsForAMoment) {
  const test::ScratchDirectory scratch;
  Loop loop(scratch.path());
  const auto wait_s = [](std::int64_t position) {
    if (position == 30 || position == 50) return 0.6;
    return position >= 70 && position < 80 ? 0.4 : 0.0;
  };
  loop.source.on_next = [&](std::int64_t position) {
    loop.source.waits = wait_s(position) > 0.0;
    loop.now_s += wait_s(position);
  };
  EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
  EXPECT_NEAR(loop.now_s - loop.source.reported.training_s, 10 * 0.4 - 1.0, 0.45);
}

// A learner of a service makes the updates that its steps have earned; its time ends all the same.
TEST(LearnerLoopTest, MakesAllUpdatesThatTheStepsHaveEarned) {
  const test::ScratchDirectory scratch;
  for (const double max_seconds : {0.0, 1e-9}) {
    Loop loop(scratch.path() / std::to_string(max_seconds));
    loop.plan.makes_all_updates = true;
    loop.plan.run.settings.updates_per_step = 0.151;
    loop.plan.run.settings.learning_starts = 80;
    loop.plan.run.settings.max_seconds = max_seconds;
    EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
    EXPECT_EQ(loop.learner.num_updates(),
              max_seconds > 0.0 ? 1 : 108);  // 0.151 (800 - 80) = 108.7.
  }
}

// A stop makes a checkpoint; after a kill, the run goes on from the one before.
TEST(LearnerLoopTest, ARunStoppedOrKilledAndResumedEndsWithTheSameBitsAndPublishedTheSame) {
  const test::ScratchDirectory scratch;
  for (const bool is_killed : {false, true}) {
    const fs::path root = scratch.path() / (is_killed ? "killed" : "stopped");
    Loop whole(root / "whole"), part(root / "parts"), rest(root / "parts");
    for (Loop* loop : {&whole, &part, &rest}) loop->plan.run.settings.checkpoint_steps = 160;
    EXPECT_EQ(whole.Run(), TrainingEnd::kFinished);
    std::stop_source stop;
    part.source.on_next = [&](std::int64_t position) {
      if (position == 38 && is_killed) throw base::Error("killed");
      if (position == 38) stop.request_stop();
    };
    if (is_killed) {
      EXPECT_THROW(part.Run(), base::Error);
    } else {
      EXPECT_EQ(part.Run(false, stop.get_token()), TrainingEnd::kStopped);
    }
    const std::int64_t resumed_at = part.source.saved_at.back() / kStepsPerUpdate;
    EXPECT_EQ(resumed_at, is_killed ? 20 : 38);
    EXPECT_EQ(rest.Run(true), TrainingEnd::kFinished);
    EXPECT_EQ(*rest.learner.Snapshot().weights, *whole.learner.Snapshot().weights);
    std::vector<std::int64_t> published = part.sink.versions;
    std::erase_if(published, [=](std::int64_t version) { return version > resumed_at; });
    published.insert(published.end(), rest.sink.versions.begin(), rest.sink.versions.end());
    EXPECT_EQ(published, whole.sink.versions);
    EXPECT_EQ(rest.source.num_episode_looks, rest.sink.versions.size());
    EXPECT_EQ(part.source.saved_at.front(), whole.source.saved_at.front());
    EXPECT_EQ(rest.source.saved_at.front(), 320);
    if (is_killed) {
      const auto rows = run::ReadMetrics(rest.plan.run.directory.metrics(), 1000);
      const auto expected = run::ReadMetrics(whole.plan.run.directory.metrics(), 1000);
      EXPECT_EQ(rows.Column("steps"), expected.Column("steps"));
      EXPECT_LT(std::ranges::max(rows.Column("steps_per_s")),
                1.5 * std::ranges::max(expected.Column("steps_per_s")));
    }
    // At its limit already: nothing is done again but what a crash may have left undone.
    fs::remove(rest.plan.run.directory.policy());
    Loop again(root / "parts");
    EXPECT_EQ(again.Run(true), TrainingEnd::kWasFinished);
    EXPECT_TRUE(again.HasPolicy());
    EXPECT_EQ(again.sink.num_served, 0);
  }
}

// The steps of a checkpoint are those of its data.
TEST(LearnerLoopTest, StepsThatComeWhileItStopsCount) {
  const test::ScratchDirectory scratch;
  std::stop_source stop;
  Loop part(scratch.path()), rest(scratch.path());
  part.plan.run.settings.checkpoint_steps = 200;
  part.source.steps_at_stop = 3;
  part.source.on_next = [](std::int64_t position) {
    if (position == 38) throw base::Error("killed");
  };
  EXPECT_THROW(part.Run(), base::Error);
  rest.source.steps_at_stop = 3;
  EXPECT_EQ(rest.Run(true), TrainingEnd::kFinished);
  EXPECT_EQ(rest.source.reported.steps, rest.source.steps());
  EXPECT_EQ(rest.source.saved_at.back(), rest.source.steps());
}

TEST(LearnerLoopTest, SnapshotsFallOnTheSamePlaceWhereverTheRunWasStopped) {
  const test::ScratchDirectory scratch;
  for (const std::int64_t stopped_at : {36, 37, 38, 60}) {
    const fs::path directory = scratch.path() / std::to_string(stopped_at);
    std::stop_source stop;
    Loop part(directory);
    part.plan.run.settings.snapshot_steps = {290};  // Passed at turn 37, which ends without rest.
    part.source.on_next = [&stop, stopped_at](std::int64_t position) {
      if (position == stopped_at) stop.request_stop();
    };
    EXPECT_EQ(part.Run(false, stop.get_token()), TrainingEnd::kStopped);
    Loop rest(directory);
    rest.plan.run.settings.snapshot_steps = {290};
    EXPECT_EQ(rest.Run(true), TrainingEnd::kFinished);
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(rest.plan.run.directory.snapshots())) {
      names.push_back(entry.path().filename().string());
    }
    EXPECT_THAT(names, ElementsAre("step-000000000304.safetensors")) << stopped_at;
  }
}

TEST(LearnerLoopTest, ASnapshotByTimeIsNotMadeAgainByARunThatResumesLater) {
  const test::ScratchDirectory scratch;
  std::stop_source stop;
  Loop part(scratch.path()), rest(scratch.path());
  part.source.on_next = [&stop](std::int64_t position) {
    if (position == 60) stop.request_stop();
  };
  for (Loop* loop : {&part, &rest}) loop->plan.run.settings.snapshot_seconds = {0.1};
  const auto num_snapshots = [&] {
    return std::distance(fs::directory_iterator(rest.plan.run.directory.snapshots()), {});
  };
  EXPECT_EQ(part.Run(false, stop.get_token()), TrainingEnd::kStopped);
  EXPECT_EQ(num_snapshots(), 1);
  EXPECT_EQ(rest.Run(true), TrainingEnd::kFinished);
  EXPECT_EQ(num_snapshots(), 1);
}

TEST(LearnerLoopTest, APolicyThatIsNotWrittenEndsOnlyAProcessThatDoesNotLiveOn) {
  const test::ScratchDirectory scratch;
  for (const bool lives_on : {false, true}) {
    Loop loop(scratch.path() / (lives_on ? "service" : "process"));
    loop.plan.lives_on = lives_on;
    base::MakeDirectories(loop.plan.run.directory.policy() / "in-the-way");
    if (lives_on) {
      EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
      Loop again(scratch.path() / "service");
      again.plan.lives_on = true;
      EXPECT_EQ(again.Run(true), TrainingEnd::kWasFinished);
    } else {
      EXPECT_THROW(loop.Run(), base::Error);
      EXPECT_THAT(loop.source.saved_at, ElementsAre(800)) << "it costs the checkpoint, too";
    }
  }
}

TEST(LearnerLoopTest, DivergenceEndsItWithoutAPolicyOrACheckpoint) {
  const test::ScratchDirectory scratch;
  MethodConfig method = Method();
  method.learner.divergence_limit = 1.0;
  method.learner.critic_learning_rate = 0.1;
  Loop loop(scratch.path(), method), unlogged(scratch.path() / "unlogged");
  loop.source.scale = 1e6f;
  EXPECT_EQ(loop.Run(), TrainingEnd::kDiverged);
  EXPECT_LT(loop.source.position, 100);
  // Between two rows, a checkpoint that is due looks for itself.
  unlogged.plan.run.settings.log_interval = 1e9;
  unlogged.plan.run.settings.checkpoint_steps = 400;
  unlogged.source.scale = NAN;
  EXPECT_EQ(unlogged.Run(), TrainingEnd::kDiverged);
  EXPECT_EQ(unlogged.source.position, 100);
  for (const Loop* run : {&loop, &unlogged}) {
    EXPECT_FALSE(run->HasPolicy());
    EXPECT_THAT(run->source.saved_at, ElementsAre());
  }
}

TEST(LearnerLoopTest, ARunWithoutAnUpdateHasLearnedNothing) {
  const test::ScratchDirectory scratch;
  Loop loop(scratch.path());
  loop.source.gives_none = true;
  EXPECT_EQ(loop.Run(), TrainingEnd::kLearnedNothing);
  EXPECT_FALSE(loop.HasPolicy());
  EXPECT_THAT(loop.source.saved_at, ElementsAre(800));
  EXPECT_EQ(Loop(scratch.path()).Run(true), TrainingEnd::kLearnedNothing);
}

TEST(LearnerLoopTest, PrioritiesGoBackAfterEachUpdate) {
  const test::ScratchDirectory scratch;
  MethodConfig method = Method(/*prioritized=*/true);
  method.model.kind = nn::ModelKind::kDeterministic;  // It learns from other rows.
  method.model.encoder_layers = {};
  method.model.head_layers = {8};
  Loop loop(scratch.path(), method);
  EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
  EXPECT_EQ(loop.source.num_priorities, 100);
}

TEST(LearnerLoopTest, ACheckpointIsSavedThoughWhatItReplacesCannotBeRemoved) {
  const test::ScratchDirectory scratch;
  Loop loop(scratch.path());
  loop.plan.run.settings.checkpoint_steps = 400;
  loop.source.cannot_clear = true;
  EXPECT_EQ(loop.Run(), TrainingEnd::kFinished);
  EXPECT_EQ(loop.registry.counter(metrics::kCheckpoints).value(), 2.0);
  EXPECT_EQ(loop.registry.counter(metrics::kCheckpointFailures).value(), 0.0);
}

TEST(LearnerLoopTest, ACheckpointThatFailsEndsNoRunAndCostsNoPolicy) {
  const test::ScratchDirectory scratch;
  for (const bool lives_on : {false, true}) {
    Loop loop(scratch.path() / (lives_on ? "service" : "process"));
    loop.plan.lives_on = lives_on;
    loop.plan.run.settings.checkpoint_steps = 400;
    loop.source.fails = true;
    EXPECT_EQ(loop.Run(), lives_on ? TrainingEnd::kFinished : TrainingEnd::kUnsaved);
    EXPECT_EQ(loop.registry.counter(metrics::kCheckpointFailures).value(), 2.0);
    EXPECT_TRUE(loop.HasPolicy());
  }
}

// Another worker has taken over while this process stood still: it would write into the other's
// run.
TEST(LearnerLoopTest, WithoutItsFenceItWritesNothingMore) {
  const test::ScratchDirectory scratch;
  const fs::path claim = scratch.path() / "claim";
  base::WriteFileAtomically(claim, "mine");
  Loop loop(scratch.path() / "run");
  loop.plan.run.fence = run::Fence(claim);
  loop.plan.run.settings.checkpoint_steps = 10 * kStepsPerUpdate;
  std::string last_rows;
  loop.source.on_next = [&](std::int64_t position) {
    if (position != 25) return;
    fs::remove(claim);
    last_rows = base::ReadFile(loop.plan.run.directory.metrics());
  };
  EXPECT_THROW(loop.Run(), base::Error);
  EXPECT_LT(loop.source.position, 30);
  EXPECT_EQ(base::ReadFile(loop.plan.run.directory.metrics()), last_rows);
  EXPECT_FALSE(fs::exists(loop.plan.run.directory.policy()));
  const auto checkpoints = run::CheckpointStore(loop.plan.run.directory.checkpoints()).List();
  EXPECT_THAT(checkpoints,
              ElementsAre(testing::Property(&fs::path::filename, fs::path("step-160")),
                          testing::Property(&fs::path::filename, fs::path("step-80"))));
}

}  // namespace
}  // namespace slalom::learner
