#include "actor/service/actor_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "metrics/catalogue.h"
#include "replay/journal.h"
#include "replay/service/server.h"
#include "tests/actor/one_policy.h"
#include "tests/support/fake_environment.h"
#include "tests/support/log_lines.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/wait_until.h"

/// The actor as a process would be, against a real replay server and a learner of a few lines.

namespace slalom::actor {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr int kBeams = 8;
constexpr std::uint64_t kSpecHash = 11;
constexpr int kEnvironments = 4;
using test::WaitUntil;

constexpr std::string_view kUnreadable = "no policy of this version";

/// When an environment fails: after so many steps, in the next one or as it begins an episode.
struct Failure {
  int steps = std::numeric_limits<int>::max();
  bool in_reset = false;
};

class FailingEnvironment : public testing::FakeEnvironment {
 public:
  explicit FailingEnvironment(const Failure& failure)
      : FakeEnvironment(kEnvironments, {0.5, 0.9}, 20, kBeams), failure_(failure) {}
  void Reset(int i, const env::EpisodeSpec& spec) override {
    FailIf(failure_.in_reset);
    FakeEnvironment::Reset(i, spec);
  }
  void Step(std::span<const float> actions, std::span<env::StepResult> results) override {
    FailIf(!failure_.in_reset);
    FakeEnvironment::Step(actions, results);
    ++num_steps;
  }

  int num_steps = 0;

 private:
  void FailIf(bool here) const {
    if (here && num_steps >= failure_.steps) throw base::Error("the motor is hot");
  }
  const Failure failure_;
};

/// A replay server, until it goes out of scope; then its journal can be looked into.
class Replay {
 public:
  explicit Replay(const std::filesystem::path& directory,
                  const std::string& endpoint = "tcp://127.0.0.1:*",
                  std::uint64_t spec_hash = kSpecHash)
      : registry_("replay", "replay"),
        server_(ConfigOf(directory),
                {.endpoint = endpoint,
                 .table = {.capacity = 100000},
                 .shape = kBeams,
                 .spec_hash = spec_hash},
                context_, registry_),
        thread_([this](std::stop_token stop) { server_.Run(stop); }) {}

  const std::string& endpoint() const { return server_.endpoint(); }
  double steps() { return registry_.counter(metrics::kStepsAccepted).value(); }

 private:
  static replay::ReplayServerConfig ConfigOf(const std::filesystem::path& directory) {
    replay::ReplayServerConfig config;
    config.directory = directory;
    config.max_ahead_steps = 0;  // Nobody learns here.
    return config;
  }

  transport::Context context_;
  metrics::Registry registry_;
  replay::ReplayServer server_;
  std::jthread thread_;
};

std::int64_t AcceptedSteps(const std::filesystem::path& directory) {
  replay::JournalOptions options;
  options.directory = directory;
  options.shape = kBeams;
  options.spec_hash = kSpecHash;
  const replay::JournalLock lock(directory);
  return replay::RecoverJournal(options, {.capacity = 100000}).sessions.accepted_steps();
}

class ActorServiceTest : public ::testing::Test {
 protected:
  /// An actor that runs in a thread.
  class Running {
   public:
    Running(ActorServiceTest& test, const std::string& replay, const std::string& state = "actor",
            const Failure& failure = {})
        : environments_(failure),
          agent_(kEnvironments),
          registry_("actor", "a"),
          thread_([this, &test, replay, state](std::stop_token stop) {
            try {
              ActorIdentity identity;
              identity.name = "a";
              identity.state_directory = test.scratch_.path() / state;
              identity.spec_hash = kSpecHash;
              identity.course_set = "fake";
              identity.replay.endpoint = replay;
              identity.learner.endpoint = test.policy_.endpoint();
              ActorServiceConfig config;
              config.unacknowledged_bytes = 1 << 16;  // Little enough to be sent at the end,
              config.chunk_rows = 64;                 // whatever slows the server down.
              ActorConfig actor;
              actor.num_environments = kEnvironments;
              ActorService service(
                  config, actor, {}, identity, environments_, agent_,
                  [](std::span<const std::byte> policy) -> std::optional<base::Failure> {
                    if (policy.size() == kUnreadable.size()) return base::Failure{"damaged"};
                    return std::nullopt;
                  },
                  context_, registry_);
              service.Run(stop);
              account_ = service.account();
            } catch (const base::Error& error) {
              error_ = error.what();
            }
            ended_ = true;
          }) {}

    std::string fault() const { return registry_.fault(); }
    double count(const metrics::Spec& metric) { return registry_.counter(metric).value(); }
    double made() { return registry_.counter(metrics::kEnvironmentSteps).value(); }
    bool ended() const { return ended_; }
    std::int64_t driven() const { return std::int64_t{kEnvironments} * environments_.num_steps; }
    std::uint64_t first_seed() const { return environments_.specs().front().seed; }
    /// Ends it as SIGTERM would.
    StepAccount Stop() {
      thread_.request_stop();
      thread_.join();
      EXPECT_EQ(error_, "");
      return account_;
    }
    std::string Error() {
      thread_.join();
      return error_;
    }

   private:
    FailingEnvironment environments_;
    testing::SummingAgent agent_;
    transport::Context context_;
    metrics::Registry registry_;
    StepAccount account_;
    std::string error_;
    std::atomic<bool> ended_ = false;
    std::jthread thread_;
  };

  std::filesystem::path journal(const std::string& name = "replay") const {
    return scratch_.path() / name;
  }

  const test::ScratchDirectory scratch_;
  OnePolicy policy_;
};

TEST_F(ActorServiceTest, BothSidesCountTheSameSteps) {
  StepAccount account;
  {
    Replay replay(journal());
    Running actor(*this, replay.endpoint());
    WaitUntil([&] { return actor.made() > 1000 && replay.steps() > 1000; });
    account = actor.Stop();
  }
  EXPECT_GT(account.made, 1000);
  EXPECT_EQ(account.accepted, account.made);
  EXPECT_EQ(AcceptedSteps(journal()), account.made);
}

TEST_F(ActorServiceTest, TheLogSaysHowManyStepsAKillHasLost) {
  const test::LogLines log;
  std::filesystem::create_directories(scratch_.path() / "actor");
  {
    Ledger ledger(scratch_.path() / "actor" / "ledger");
    ledger.BeginSession(1, 0, LossReason::kKilled);
    ledger.AddMade(256);
  }
  Replay replay(journal());
  Running actor(*this, replay.endpoint());
  log.WaitFor("256 steps of session 1 are lost");
  EXPECT_EQ(actor.Stop().total_lost(), 256);
}

TEST_F(ActorServiceTest, NothingIsLostOverARestartOfTheServer) {
  auto replay = std::make_unique<Replay>(journal());
  const std::string endpoint = replay->endpoint();
  Running actor(*this, endpoint);
  for (int i = 0; i < 3; ++i) {
    const double before = replay->steps();
    WaitUntil([&] { return replay->steps() > before + 500; });
    replay.reset();
    replay = std::make_unique<Replay>(journal(), endpoint);
  }
  const double before = replay->steps();
  WaitUntil([&] { return replay->steps() > before + 500; });
  const StepAccount account = actor.Stop();
  replay.reset();
  EXPECT_EQ(account.accepted, account.made);
  EXPECT_EQ(AcceptedSteps(journal()), account.made);
}

TEST_F(ActorServiceTest, WhatCannotBeDeliveredGoesByWayOfTheSpool) {
  auto replay = std::make_unique<Replay>(journal());
  const std::string endpoint = replay->endpoint();
  StepAccount account;
  {
    Running actor(*this, endpoint);
    WaitUntil([&] { return replay->steps() > 100; });
    replay.reset();
    const double before = actor.made();
    WaitUntil([&] { return actor.made() > before + 100; });
    account = actor.Stop();
  }
  EXPECT_GT(account.pending, 0);
  EXPECT_EQ(account.made, account.accepted + account.pending);
  replay = std::make_unique<Replay>(journal(), endpoint);
  {
    Running actor(*this, endpoint);
    WaitUntil([&] { return actor.made() > static_cast<double>(account.made) + 100; });
    account = actor.Stop();
  }
  replay.reset();
  EXPECT_EQ(account.pending, 0);
  EXPECT_EQ(account.accepted, account.made);
  EXPECT_EQ(AcceptedSteps(journal()), account.made);
}

TEST_F(ActorServiceTest, StepsThatAServerForgotAreCountedAsLost) {
  auto replay = std::make_unique<Replay>(journal());
  const std::string endpoint = replay->endpoint();
  Running actor(*this, endpoint);
  WaitUntil([&] { return replay->steps() > 500; });
  replay.reset();
  const std::int64_t kept = AcceptedSteps(journal());
  replay = std::make_unique<Replay>(journal("other"), endpoint);
  WaitUntil([&] { return replay->steps() > 500; });
  const StepAccount account = actor.Stop();
  replay.reset();
  // What the first server kept but could no longer acknowledge was sent again, to the second.
  EXPECT_GT(account.lost[static_cast<int>(LossReason::kServer)], 0);
  EXPECT_LE(account.lost[static_cast<int>(LossReason::kServer)], kept);
  EXPECT_EQ(account.lost[static_cast<int>(LossReason::kKilled)], 0);
  EXPECT_EQ(account.made, account.accepted + account.lost[0] + account.lost[1] + account.lost[2]);
  EXPECT_EQ(AcceptedSteps(journal("other")), account.accepted);
}

TEST_F(ActorServiceTest, AnotherActorOfTheSameNameEndsTheFirst) {
  Replay replay(journal());
  Running first(*this, replay.endpoint());
  WaitUntil([&] { return replay.steps() > 100; });
  // With a state directory of its own it knows nothing of the first one's sessions.
  Running second(*this, replay.endpoint(), "elsewhere");
  EXPECT_THAT(first.Error(), ::testing::HasSubstr("another process took over as actor 'a'"));
  const double before = second.made();
  WaitUntil([&] { return second.made() > before; });
  const StepAccount account = second.Stop();
  EXPECT_EQ(account.accepted, account.made);
}

TEST_F(ActorServiceTest, WhileNoServerIsThereItIsNotWell) {
  std::string endpoint;
  {
    const Replay replay(journal());
    endpoint = replay.endpoint();
  }
  Running actor(*this, endpoint);
  WaitUntil([&] { return actor.fault() == "waiting for the replay server"; });
  const Replay replay(journal(), endpoint);
  WaitUntil([&] { return actor.made() > 0; });
  EXPECT_EQ(actor.fault(), "");
  actor.Stop();
}

/// Welcomes everybody and answers each chunk in a way of its own.
class OddReplay {
 public:
  using Answer = std::function<proto::Header(const proto::Insert&)>;

  explicit OddReplay(Answer answer, std::function<void(const proto::Report&)> hear = {})
      : answer_(std::move(answer)),
        server_(context_, {.endpoint = "tcp://127.0.0.1:*"}),
        thread_([this, hear = std::move(hear)](auto stop) {
          while (!stop.stop_requested()) {
            const auto received = server_.Receive(milliseconds(20));
            if (!received) continue;
            const auto header =
                proto::Decode(received->message.header.bytes(), received->message.payload.bytes());
            ASSERT_TRUE(header);
            if (const auto* hello = std::get_if<proto::Hello>(&*header)) {
              Send(received->peer,
                   proto::Welcome{
                       .session = hello->session, .window_bytes = 1 << 20, .software = ""});
            }
            if (const auto* insert = std::get_if<proto::Insert>(&*header)) {
              Send(received->peer, answer_(*insert));
            }
            if (const auto* report = std::get_if<proto::Report>(&*header); report && hear) {
              hear(*report);
            }
          }
        }) {}

  const std::string& endpoint() const { return server_.endpoint(); }

 private:
  void Send(const transport::PeerId& peer, const proto::Header& header) {
    static_cast<void>(server_.Send(peer, {transport::Frame::Copy(proto::Encode(header, {})), {}}));
  }

  const Answer answer_;
  transport::Context context_;
  transport::Server server_;
  std::jthread thread_;
};

proto::Header Accepted(const proto::Insert& insert) {
  return proto::InsertAck{
      .session = insert.session, .next_sequence = insert.sequence + 1, .window_bytes = 1 << 20};
}

// The times that the steps and the paces tell are a second or more each, and lie in the test's.
TEST_F(ActorServiceTest, AReportTellsThePaceSinceTheOneBefore) {
  const auto began = steady_clock::now();
  std::vector<std::map<std::string, double>> told;
  std::atomic<int> num_told = 0;
  {
    const OddReplay replay(Accepted, [&](const proto::Report& report) {
      told.push_back(report.figures);
      ++num_told;
    });
    Running actor(*this, replay.endpoint());
    WaitUntil([&] { return num_told >= 4; });
    actor.Stop();
  }
  const std::chrono::duration<double> lasted = steady_clock::now() - began;
  double sum = 0.0;
  for (std::size_t i = 1; i < told.size(); ++i) {
    const double steps = told[i].at("steps_made") - told[i - 1].at("steps_made");
    const double seconds = steps / told[i].at("steps_per_s");
    EXPECT_GE(seconds, 1.0 - 1e-9);
    sum += seconds;
  }
  EXPECT_LE(sum, lasted.count());
}

TEST_F(ActorServiceTest, AnAcknowledgementOfAnotherSessionSaysNothing) {
  const OddReplay replay([](const proto::Insert& insert) {
    return proto::InsertAck{.session = insert.session + 1,
                            .next_sequence = insert.sequence + 1,
                            .window_bytes = 1 << 20};
  });
  Running actor(*this, replay.endpoint());
  WaitUntil([&] { return actor.made() > 200; });
  const StepAccount account = actor.Stop();
  EXPECT_EQ(account.accepted, 0);
  EXPECT_EQ(account.pending, account.made);
}

TEST_F(ActorServiceTest, AChunkSaysWhichPoliciesChoseItsActions) {
  std::atomic<bool> has_two = false;
  std::atomic<std::int64_t> last_single = 0;
  std::atomic<bool> is_confused = false;
  const OddReplay replay([&](const proto::Insert& insert) {
    if (insert.oldest_version < insert.newest_version) has_two = true;
    if (insert.oldest_version == insert.newest_version) last_single = insert.newest_version;
    if (insert.oldest_version > insert.newest_version || insert.oldest_version < 7) {
      is_confused = true;
    }
    return Accepted(insert);
  });
  Running actor(*this, replay.endpoint());
  std::int64_t version = 7;
  WaitUntil([&] {
    policy_.Publish(++version, "a policy");
    return has_two.load();
  });
  WaitUntil([&] { return last_single == version; });  // Nothing of the first ones stays.
  actor.Stop();
  EXPECT_FALSE(is_confused);
}

TEST_F(ActorServiceTest, AChunkThatIsRefusedEachTimeEndsIt) {
  const OddReplay replay([](const proto::Insert& insert) {
    return proto::Refusal{.code = proto::RefusalCode::kBadMessage,
                          .text = "not to my taste",
                          .about = insert.sequence};
  });
  Running actor(*this, replay.endpoint());
  EXPECT_THAT(actor.Error(), ::testing::HasSubstr("keeps refusing chunk 0: not to my"));
}

TEST_F(ActorServiceTest, APolicyThatCannotBeReadLeavesTheOneBefore) {
  Replay replay(journal());
  Running actor(*this, replay.endpoint());
  WaitUntil([&] { return actor.count(metrics::kPoliciesReceived) == 1; });
  EXPECT_EQ(actor.count(metrics::kPoliciesRejected), 0);
  policy_.Publish(8, std::string(kUnreadable));
  WaitUntil([&] { return actor.count(metrics::kPoliciesRejected) == 1; });
  const double before = replay.steps();
  WaitUntil([&] { return replay.steps() > before + 500; });
  policy_.Publish(9, "a policy");
  WaitUntil([&] { return actor.count(metrics::kPoliciesReceived) == 2; });
  const StepAccount account = actor.Stop();
  EXPECT_EQ(account.accepted, account.made);
}

TEST_F(ActorServiceTest, AFirstPolicyThatCannotBeReadEndsIt) {
  policy_.Publish(8, std::string(kUnreadable));
  Replay replay(journal());
  Running actor(*this, replay.endpoint());
  EXPECT_THAT(actor.Error(), ::testing::HasSubstr("policy 8 of the learner"));
}

TEST_F(ActorServiceTest, WhatWasNotAcknowledgedIsSpooledBeforeAnError) {
  const OddReplay picky([](const proto::Insert& insert) {
    return proto::Refusal{.code = proto::RefusalCode::kBadMessage,
                          .text = "not to my taste",
                          .about = insert.sequence};
  });
  {
    Running actor(*this, picky.endpoint());
    EXPECT_THAT(actor.Error(), ::testing::HasSubstr("keeps refusing"));
  }
  const std::filesystem::path spool = scratch_.path() / "actor" / "spool";
  EXPECT_GT(std::filesystem::file_size(spool), 0u);
  // The next start goes on without it if it is refused each time, too.
  {
    Running actor(*this, picky.endpoint());
    EXPECT_THAT(actor.Error(), ::testing::HasSubstr("keeps refusing"));
  }
  EXPECT_TRUE(std::filesystem::exists(spool.string() + ".damaged"));
  std::filesystem::remove(spool);
  Replay replay(journal());
  Running actor(*this, replay.endpoint());
  WaitUntil([&] { return replay.steps() > 500; });
  const StepAccount account = actor.Stop();
  EXPECT_EQ(account.pending, 0);
  EXPECT_GT(account.lost[static_cast<int>(LossReason::kKilled)], 0);
}

TEST_F(ActorServiceTest, WhatAnEnvironmentThrowsLosesNoStep) {
  Replay replay(journal());
  std::int64_t driven = 0;
  std::set<std::uint64_t> seeds;
  for (const bool in_reset : {false, true}) {
    Running failing(*this, replay.endpoint(), "actor", {103, in_reset});
    EXPECT_EQ(failing.Error(), "the motor is hot");
    driven += failing.driven();
    seeds.insert(failing.first_seed());
  }
  EXPECT_EQ(seeds.size(), 2u) << "each session has episodes of its own";
  Running actor(*this, replay.endpoint());
  WaitUntil([&] { return replay.steps() > 2000; });
  const StepAccount account = actor.Stop();
  EXPECT_EQ(account.total_lost(), 0);
  EXPECT_EQ(account.made, driven + actor.driven());
}

TEST_F(ActorServiceTest, ASpoolThatIsDamagedIsSetAside) {
  const std::filesystem::path spool = scratch_.path() / "actor" / "spool";
  std::filesystem::create_directories(spool.parent_path());
  base::WriteFileAtomically(spool, "SLSPOOL1 and then something else");
  Replay replay(journal());
  Running actor(*this, replay.endpoint());
  WaitUntil([&] { return replay.steps() > 500; });
  const StepAccount account = actor.Stop();
  EXPECT_EQ(account.accepted, account.made);
  EXPECT_EQ(base::ReadFile(spool.string() + ".damaged"), "SLSPOOL1 and then something else");
}

TEST_F(ActorServiceTest, AServerOfAnotherRunRefusesIt) {
  Replay replay(journal(), "tcp://127.0.0.1:*", kSpecHash + 1);
  Running actor(*this, replay.endpoint());
  EXPECT_THAT(actor.Error(), ::testing::HasSubstr("refuses this process"));
}

}  // namespace
}  // namespace slalom::actor
