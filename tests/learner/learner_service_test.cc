#include "learner/service/learner_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <sstream>
#include <stop_token>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/file.h"
#include "metrics/catalogue.h"
#include "proto/policy_link.h"
#include "proto/run_identity.h"
#include "tests/learner/filled_replay.h"
#include "tests/support/scratch_directory.h"

/// The learner as a process would be, against a real replay server whose table stands still: the
/// batches are then a value of their numbers, and so is what is learned.

namespace slalom::learner {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

MethodConfig MethodWithModel() {
  MethodConfig method;
  method.model.kind = nn::ModelKind::kDeterministic;
  method.model.encoder_layers = {};
  method.model.head_layers = {16};
  return method;
}

using Meanwhile = std::function<void(const std::string& endpoint)>;

/// Counts the looks at a learner's clock, each of which it takes for a second.
using Looks = std::atomic<int>;

/// A learner that runs in a thread until `updates` or more, then is stopped as by SIGTERM: by its
/// own thread, within a few updates, or after `meanwhile`.
void Learn(const std::string& replay, const fs::path& directory, std::int64_t updates,
           const Meanwhile& meanwhile = {}, const MethodConfig& base_method = {},
           Looks* looks = nullptr, double max_seconds = 0.0,
           TrainingEnd expected = TrainingEnd::kStopped, std::int64_t max_steps = 1000000) {
  base::MakeDirectories(directory);
  transport::Context context;
  metrics::Registry registry("learner", "learner");
  MethodConfig method = base_method;
  LearnerConfig& config = method.learner;
  config.batch_size = 16;
  config.actor_learning_rate = config.critic_learning_rate = 1e-3;
  policy::PolicySpec spec = SmallSpec();
  spec.planning = PlanningOf(method);
  LearnerJob job;
  job.loop.run.directory.root = directory;
  job.loop.run.settings.seed = 6;
  job.loop.run.settings.max_steps = max_steps;
  job.loop.run.settings.updates_per_step = 0.5;  // As the replay server.
  job.loop.run.settings.learning_starts = 0;
  job.loop.run.settings.max_seconds = max_seconds;
  job.loop.run.settings.log_interval = 5.0;  // Looks.
  job.spec_hash = kSpecHash;
  job.replay = {{.endpoint = replay}};
  job.policies.endpoint = "tcp://127.0.0.1:*";
  std::atomic<bool> ready = false;
  std::string endpoint;
  std::string error;
  auto done = registry.counter(metrics::kUpdates);
  const auto has_made_them = [&] { return done.value() >= static_cast<double>(updates); };
  std::stop_source stop;
  Looks own_looks = 0;
  const run::TrainingClock clock([&]() -> run::ClockReading {
    if (!meanwhile && has_made_them()) stop.request_stop();
    const double now = ++(looks ? *looks : own_looks);
    return {.wall_s = now, .processor_s = now};
  });
  std::jthread thread([&] {
    try {
      LearnerService learner({}, method, spec, job, context, registry, clock);
      endpoint = learner.endpoint();
      ready = true;
      EXPECT_EQ(learner.Run(stop.get_token()), expected);
    } catch (const base::Error& e) {
      error = e.what();
      ready = true;
    }
  });
  WaitUntil([&] { return ready.load(); });
  ASSERT_EQ(error, "");
  if (meanwhile) {
    WaitUntil(has_made_them);
    meanwhile(endpoint);
    stop.request_stop();
  }
  thread.join();
  ASSERT_EQ(error, "");
}

policy::LoadedPolicy Policy(const fs::path& directory) {
  return policy::LoadPolicy(run::RunDirectory{directory}.policy());
}

TEST(LearnerServiceTest, ARestartGoesOnAsIfNothingHadHappened) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  Learn(replay.endpoint(), scratch.path() / "whole", kUpdates);
  const auto whole = Policy(scratch.path() / "whole");
  EXPECT_EQ(whole.snapshot.version, kUpdates);

  Learn(replay.endpoint(), scratch.path() / "parts", 1);
  const std::int64_t first_stop = Policy(scratch.path() / "parts").snapshot.version;
  Learn(replay.endpoint(), scratch.path() / "parts", kUpdates);
  const auto parts = Policy(scratch.path() / "parts");
  EXPECT_LT(first_stop, kUpdates) << "it was not stopped in the middle";
  EXPECT_EQ(parts.snapshot.version, kUpdates);
  EXPECT_EQ(*parts.snapshot.weights, *whole.snapshot.weights);
}

double TrainingSeconds(const fs::path& directory) {
  return std::stod(Policy(directory).metadata.at("training_s"));
}

// Nothing listens where the replay server should be.
TEST(LearnerServiceTest, WaitingForTheReplayServerTakesNothingFromTheLimit) {
  const test::ScratchDirectory scratch;
  Looks looks = 0;
  Learn(
      "tcp://127.0.0.1:9", scratch.path(), 0,
      [&](const std::string&) { WaitUntil([&] { return looks > 50; }); }, {}, &looks, 10.0);
  EXPECT_EQ(TrainingSeconds(scratch.path()), 0.0);
  const std::string metrics = base::ReadFile(run::RunDirectory{scratch.path()}.metrics());
  EXPECT_EQ(std::count(metrics.begin(), metrics.end(), '\n'), 1) << "the header alone";
}

// The steps earn kUpdates batches; then the server gives none, as where all actors are gone.
TEST(LearnerServiceTest, AnOutageInTheMiddleTakesNothingFromTheLimit) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  Looks looks = 0;
  int looks_at_outage = 0;
  Learn(
      replay.endpoint(), scratch.path(), kUpdates,
      [&](const std::string&) {
        looks_at_outage = looks;
        WaitUntil([&] { return looks > looks_at_outage + 100; });
      },
      {}, &looks);
  EXPECT_GE(TrainingSeconds(scratch.path()), static_cast<double>(kUpdates));
  EXPECT_LT(TrainingSeconds(scratch.path()), looks_at_outage + 10.0);
}

TEST(LearnerServiceTest, AFinishedLearnerServesItsPolicyAlsoAfterARestart) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  const fs::path policy = run::RunDirectory{scratch.path()}.policy();
  Looks looks = 0;
  Learn(
      replay.endpoint(), scratch.path(), 1,
      [&](const std::string&) { WaitUntil([&] { return fs::exists(policy); }); }, {}, &looks, 10.0,
      TrainingEnd::kFinished);
  const std::int64_t version = Policy(scratch.path()).snapshot.version;
  EXPECT_LT(version, kUpdates) << "it did not end at its limit";
  const auto written = fs::last_write_time(policy);
  Learn(
      replay.endpoint(), scratch.path(), 0,
      [&](const std::string& endpoint) {
        transport::Context context;
        service::PolicyLink link(context, {.endpoint = endpoint}, "reader",
                                 [](std::span<const std::byte>) { return std::nullopt; });
        WaitUntil([&] { return link.Poll(); });
        EXPECT_EQ(link.version(), version);
      },
      {}, &looks, 10.0, TrainingEnd::kWasFinished);
  EXPECT_EQ(fs::last_write_time(policy), written);
}

TEST(LearnerServiceTest, ARunEndsOnceItHasMadeTheUpdatesThatItsStepsEarn) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  const std::int64_t half = kUpdates / 2;
  const std::int64_t steps = kSteps / 2;  // Fewer than the actors have made already.
  Learn(replay.endpoint(), scratch.path(), half, {}, {}, nullptr, 0.0, TrainingEnd::kFinished,
        steps);
  EXPECT_EQ(Policy(scratch.path()).snapshot.version, half);
}

// Steps earn updates of replayed batches. Those of imagined ones come on top.
TEST(LearnerServiceTest, ImaginedUpdatesAreNotAmongThoseThatStepsEarn) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  MethodConfig method = MethodWithModel();
  method.imagination.kind = ImaginationKind::kDyna;
  method.imagination.imagined_batches = 3;
  method.imagination.learning_starts = 1;  // From the first update on.
  constexpr std::int64_t kEarned = 50;
  Learn(replay.endpoint(), scratch.path(), kEarned * 4, {}, method, nullptr, 0.0,
        TrainingEnd::kFinished, 2 * kEarned);
  EXPECT_EQ(Policy(scratch.path()).snapshot.version, kEarned * 4);
}

// What an evaluator scores is the file that the run saves: averaged weights, config and provenance.
TEST(LearnerServiceTest, AReaderMayAskForThePolicyThatTheRunSaves) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  MethodConfig method;
  method.learner.average_rate = 0.05;
  const fs::path run = scratch.path() / "run";
  Learn(replay.endpoint(), run, kUpdates, {}, method);
  const policy::LoadedPolicy saved = Policy(run);
  ASSERT_EQ(saved.snapshot.version, kUpdates);
  std::map<bool, policy::LoadedPolicy> served;
  const auto read = [&](const std::string& endpoint) {
    for (const bool shipped : {false, true}) {
      transport::Context context;
      service::PolicyLink link(context, {.endpoint = endpoint}, "reader",
                               [&](std::span<const std::byte> bytes) {
                                 served.insert_or_assign(shipped,
                                                         policy::ParsePolicy(bytes, "policy"));
                                 return std::nullopt;
                               },
                               {.shipped = shipped});
      WaitUntil([&] { return link.Poll(); });
      EXPECT_EQ(link.version(), kUpdates);
    }
  };
  Learn(replay.endpoint(), run, kUpdates, read, method);
  EXPECT_EQ(policy::PrintPolicy(served.at(true).snapshot, {}),
            policy::PrintPolicy(saved.snapshot, {}));
  EXPECT_NE(policy::PrintPolicy(served.at(false).snapshot, {}),
            policy::PrintPolicy(saved.snapshot, {}));
  EXPECT_EQ(served.at(true).metadata.at("config"), saved.metadata.at("config"));
  for (const auto& [shipped, policy] : served) {
    EXPECT_TRUE(policy.metadata.contains(proto::kIdentityMetadata)) << "shipped: " << shipped;
  }
  EXPECT_FALSE(served.at(false).metadata.contains("config"));
}

TEST(LearnerServiceTest, AReaderThatDoesNotPlanGetsThePolicyWithoutItsModel) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  const MethodConfig method = MethodWithModel();
  const std::int64_t updates = kUpdates / 2;  // Each takes a second batch for the model.
  std::map<bool, policy::PolicySnapshot> served;
  const auto read = [&](const std::string& endpoint) {
    for (const bool without_model : {false, true}) {
      transport::Context context;
      service::PolicyLink link(context, {.endpoint = endpoint}, "reader",
                               [&](std::span<const std::byte> bytes) {
                                 served[without_model] =
                                     policy::ParsePolicy(bytes, "policy").snapshot;
                                 return std::nullopt;
                               },
                               {.without_model = without_model});
      WaitUntil([&] { return link.Poll(); });
      EXPECT_EQ(link.version(), updates);
    }
  };
  Learn(replay.endpoint(), scratch.path(), updates, {}, method);
  // Started again, it publishes the policy of its last update.
  Learn(replay.endpoint(), scratch.path(), updates, read, method);
  const policy::PolicySnapshot& whole = served.at(false);
  ASSERT_NE(whole.model_weights, nullptr);
  EXPECT_EQ(static_cast<std::int64_t>(whole.model_weights->size()),
            whole.spec.model_shape().num_parameters());
  const policy::PolicySnapshot& part = served.at(true);
  EXPECT_EQ(part.model_weights, nullptr);
  EXPECT_EQ(part.critic_weights, nullptr);
  EXPECT_EQ(*part.weights, *whole.weights);
  policy::PolicySpec spec = whole.spec;
  spec.planning = {};
  EXPECT_EQ(policy::PrintSpec(part.spec, updates), policy::PrintSpec(spec, updates));
}

TEST(LearnerServiceTest, PrioritiesGoBackToTheReplayServer) {
  const test::ScratchDirectory scratch;
  FilledReplay replay;
  MethodConfig method;
  method.learner.prioritized = true;
  Learn(
      replay.endpoint(), scratch.path() / "run", kUpdates,
      // The server counts once a second; 16 priorities follow each batch.
      [&](const std::string&) {
        WaitUntil([&] { return replay.priorities_updated() >= 16.0 * (kUpdates - 10); });
      },
      method);
  EXPECT_EQ(Policy(scratch.path() / "run").snapshot.version, kUpdates);
}

TEST(LearnerServiceTest, AModelsErrorSeveralStepsAheadIsInTheMetrics) {
  const test::ScratchDirectory scratch;
  const FilledReplay replay;
  const MethodConfig method = MethodWithModel();
  const auto last_error = [&] {
    std::istringstream lines(base::ReadFile(run::RunDirectory{scratch.path()}.metrics()));
    std::string line, header, error;
    std::getline(lines, header);
    const auto column =
        std::count(header.begin(), header.begin() + header.find("model_steps_error"), ',');
    while (std::getline(lines, line)) {
      std::istringstream row(line);
      for (std::int64_t i = 0; i <= column; ++i) {
        error.clear();
        std::getline(row, error, ',');
      }
    }
    return error;
  };
  Learn(
      replay.endpoint(), scratch.path(), 10,
      [&](const std::string&) { WaitUntil([&] { return !last_error().empty(); }); }, method);
  EXPECT_GT(std::stod(last_error()), 0.0);
}

}  // namespace
}  // namespace slalom::learner
