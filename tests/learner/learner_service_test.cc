#include "learner/service/learner_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <sstream>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "metrics/catalogue.h"
#include "policy/policy_spec.h"
#include "proto/policy_link.h"
#include "proto/run_identity.h"
#include "tests/learner/filled_replay.h"
#include "tests/support/held_clock.h"
#include "tests/support/scratch_directory.h"

/// The learner as a process would be, against a real replay server whose table stands still: the
/// batches are then a value of their numbers, and so is what is learned.

namespace slalom::learner {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

policy::PolicySpec Spec() {
  policy::PolicySpec spec;
  spec.observation.num_beams = kBeams;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {16, 16};
  return spec;
}

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
  policy::PolicySpec spec = Spec();
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
  job.replay.endpoint = replay;
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
  server.Publish(Learner({}, Spec(), 1).Snapshot(), {}, 0);
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
  policy::PolicySnapshot acting = Learner({}, Spec(), 1).Snapshot();
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
  RemoteSource source(context, {.endpoint = replay.endpoint()}, LearnerHello(), kBeams,
                      {{.batch = 16, .n_step = 4}, {.batch = 24, .n_step = 1}}, 3, policies,
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
