#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "actor/service/actor_service.h"
#include "tests/actor/holding_replay.h"
#include "tests/actor/one_policy.h"
#include "tests/support/fake_environment.h"
#include "tests/support/scratch_directory.h"

/// An actor that is killed or stopped in each of its phases, against the insert desk of a replay
/// server that holds its chunks. One thread turns both, so that each phase can be met.

namespace slalom::actor {
namespace {

constexpr int kEnvironments = 4;

class Restart : public ::testing::Test {
 public:
  /// An actor's process. Its end is a kill, if it was not finished.
  struct Process {
    explicit Process(const Restart& test)
        : environments(kEnvironments, {0.5, 0.9}, 20, HoldingReplay::kBeams),
          agent(kEnvironments),
          registry("actor", "a") {
      ActorIdentity identity;
      identity.name = "a";
      identity.state_directory = test.scratch_.path();
      identity.course_set = "fake";
      identity.replay.endpoint = test.replay_.endpoint();
      identity.learner.endpoint = test.policy_.endpoint();
      ActorServiceConfig config;
      config.chunk_rows = 64;
      config.chunk_seconds = 60.0;
      config.unacknowledged_bytes = 1 << 14;  // Full with the fifth chunk.
      ActorConfig actor;
      actor.num_environments = kEnvironments;
      service.emplace(
          config, actor, SamplingConfig{}, identity, environments, agent,
          [](std::span<const std::byte>) { return std::nullopt; }, context, registry);
    }

    testing::FakeEnvironment environments;
    testing::SummingAgent agent;
    transport::Context context;
    metrics::Registry registry;
    std::optional<ActorService> service;
  };

  void Start() {
    process_ = std::make_unique<Process>(*this);
    started_with_ = account();
  }
  void Kill() { process_.reset(); }
  /// Ends it as SIGTERM would while the server lets nothing in.
  void Stop() {
    process_->service->Finish(std::chrono::milliseconds(0));
    process_.reset();
  }

  void Turn() { process_->service->Turn(std::chrono::milliseconds(5)); }

  /// Turns both sides until the condition holds, which is looked at after each turn.
  void Until(const std::function<bool()>& condition) {
    for (int i = 0; i < 2000; ++i) {
      Turn();
      replay_.Turn();
      ASSERT_NO_FATAL_FAILURE(CheckAccount());
      if (condition()) return;
    }
    FAIL() << "what was waited for did not come: " << account().made << " steps made, "
           << account().accepted << " accepted, " << account().pending << " pending";
  }

  void CheckAccount() {
    const StepAccount now = account();
    ASSERT_EQ(now.made, now.accepted + now.pending + now.lost[0] + now.lost[1] + now.lost[2]);
    ASSERT_GE(now.pending, 0) << now.made << " steps made, " << now.accepted << " accepted";
    for (const std::int64_t lost : now.lost) ASSERT_GE(lost, 0);
  }

  StepAccount account() const { return process_->service->account(); }
  std::int64_t lost(LossReason reason) const { return account().lost[static_cast<int>(reason)]; }
  bool IsDriving() const { return account().made > started_with_.made; }

  /// Leaves a spool of five chunks, all of which the server holds.
  void MakeSpool() {
    Start();
    ASSERT_NO_FATAL_FAILURE(Until([&] { return replay_.num_held() == 5; }));
    Stop();
    ASSERT_TRUE(std::filesystem::exists(scratch_.path() / "spool"));
  }

  /// Starts the actor until the server has its hello and the actor not yet the answer.
  void StartUntilGreeted() {
    const int before = replay_.num_hellos();
    Start();
    ASSERT_NO_FATAL_FAILURE(Until([&] { return replay_.num_hellos() > before; }));
  }

  /// Starts the actor once more beside a server that holds nothing back: it makes steps again, and
  /// both sides count the same.
  void ExpectProgressAndOneAccount() {
    replay_.LetInAlways();
    Start();
    ASSERT_NO_FATAL_FAILURE(Until([&] { return IsDriving(); }));
    Stop();
    Start();
    ASSERT_NO_FATAL_FAILURE(Until([&] { return account().pending == 0; }));
    EXPECT_EQ(account().accepted, replay_.steps());
  }

  const test::ScratchDirectory scratch_;
  HoldingReplay replay_;
  OnePolicy policy_;
  std::unique_ptr<Process> process_;
  StepAccount started_with_;
};

/// How far an actor is when it ends.
struct Phase {
  const char* name;
  bool has_made;  ///< It has made steps that are in no spool, so a kill may lose some.
  std::function<void(Restart&)> reach;
};
void PrintTo(const Phase& phase, std::ostream* out) { *out << phase.name; }

enum class End { kKilled, kStopped, kKilledWithTheServer };

class RestartIn : public Restart, public ::testing::WithParamInterface<std::tuple<Phase, End>> {};

const std::vector<Phase> kPhases = {
    {"StartingUnheard", false, [](Restart& t) { t.Start(); }},
    {"StartingUnanswered", false, [](Restart& t) { t.StartUntilGreeted(); }},
    {"RunningUnsent", true,
     [](Restart& t) {
       t.Start();
       t.Until([&] { return t.IsDriving(); });
     }},
    {"RunningHeld", true,
     [](Restart& t) {
       t.Start();
       t.Until([&] { return t.replay_.num_held() >= 3; });
     }},
    {"RunningAcknowledgedUnread", true,
     [](Restart& t) {
       t.Start();
       t.Until([&] { return t.replay_.num_held() >= 3; });
       t.replay_.LetIn(2);
     }},
    {"RunningAcknowledged", true,
     [](Restart& t) {
       t.Start();
       t.Until([&] { return t.replay_.num_held() >= 3; });
       t.replay_.LetIn(2);
       t.Until([&] { return t.account().accepted > 0; });
     }},
    {"DrainingUnheard", false,
     [](Restart& t) {
       t.MakeSpool();
       t.Start();
     }},
    {"DrainingUnanswered", false,
     [](Restart& t) {
       t.MakeSpool();
       t.StartUntilGreeted();
     }},
    {"DrainingAPartConfirmedByTheWelcome", false,
     [](Restart& t) {
       t.MakeSpool();
       t.replay_.LetIn(2);
       t.Start();
       t.Until([&] { return t.account().accepted > 0; });
     }},
    {"DrainingAPartAcknowledged", false,
     [](Restart& t) {
       t.MakeSpool();
       t.StartUntilGreeted();
       t.replay_.LetIn(2);
       t.Until([&] { return t.account().accepted > 0; });
     }},
    {"DrainingAllAcknowledgedUnread", false,
     [](Restart& t) {
       t.MakeSpool();
       t.StartUntilGreeted();
       t.replay_.LetIn(5);
     }},
    {"DrainingAllAcknowledged", false,
     [](Restart& t) {
       t.MakeSpool();
       t.StartUntilGreeted();
       t.replay_.LetIn(5);
       t.Until([&] { return t.account().pending == 0; });
     }},
    {"StartingAfterASpool", false,
     [](Restart& t) {
       t.MakeSpool();
       const std::uint64_t session = t.replay_.session();
       t.replay_.LetInAlways();
       t.Start();
       t.Until([&] { return t.replay_.session() > session; });
     }},
    {"RunningAfterASpool", true,
     [](Restart& t) {
       t.MakeSpool();
       t.replay_.LetInAlways();
       t.Start();
       t.Until([&] { return t.IsDriving(); });
     }},
};

TEST_P(RestartIn, ItMakesStepsAgainAndEachIsCountedOnce) {
  const auto& [phase, end] = GetParam();
  ASSERT_NO_FATAL_FAILURE(phase.reach(*this));
  if (end == End::kStopped) {
    Stop();
  } else {
    Kill();
  }
  if (end == End::kKilledWithTheServer) replay_.Restart();
  ASSERT_NO_FATAL_FAILURE(ExpectProgressAndOneAccount());
  EXPECT_EQ(lost(LossReason::kServer), 0);
  EXPECT_EQ(lost(LossReason::kReplaced), 0);
  if (end == End::kStopped || !phase.has_made) EXPECT_EQ(lost(LossReason::kKilled), 0);
}

std::string NameOf(const ::testing::TestParamInfo<RestartIn::ParamType>& of) {
  const auto& [phase, end] = of.param;
  switch (end) {
    case End::kKilled:
      return std::string(phase.name) + "Killed";
    case End::kStopped:
      return std::string(phase.name) + "Stopped";
    case End::kKilledWithTheServer:
      return std::string(phase.name) + "KilledWithTheServer";
  }
  return "";
}

INSTANTIATE_TEST_SUITE_P(Phases, RestartIn,
                         ::testing::Combine(::testing::ValuesIn(kPhases),
                                            ::testing::Values(End::kKilled, End::kStopped,
                                                              End::kKilledWithTheServer)),
                         NameOf);

TEST_F(Restart, KillsWhileASpoolIsSentLoseNothing) {
  ASSERT_NO_FATAL_FAILURE(MakeSpool());
  std::int64_t accepted = 0;
  for (int i = 0; i < 4; ++i) {
    Start();
    EXPECT_EQ(account().accepted, accepted);
    replay_.LetIn(1);
    ASSERT_NO_FATAL_FAILURE(Until([&] { return account().accepted > accepted; }));
    accepted = account().accepted;
    EXPECT_EQ(accepted, replay_.steps());
    Kill();
  }
  ASSERT_NO_FATAL_FAILURE(ExpectProgressAndOneAccount());
  EXPECT_EQ(lost(LossReason::kKilled), 0);
  EXPECT_EQ(lost(LossReason::kServer), 0);
}

TEST_F(Restart, WhatAServerForgotIsSentAgainIfTheSpoolStillHasIt) {
  ASSERT_NO_FATAL_FAILURE(MakeSpool());
  replay_.BackUp();
  replay_.LetIn(2);
  Start();
  ASSERT_NO_FATAL_FAILURE(Until([&] { return account().accepted > 0; }));
  Kill();
  replay_.GoBack();
  ASSERT_NO_FATAL_FAILURE(ExpectProgressAndOneAccount());
  EXPECT_EQ(account().made, account().accepted);
}

TEST_F(Restart, WhatAServerForgotIsLostByItIfTheSpoolNoLongerHasIt) {
  ASSERT_NO_FATAL_FAILURE(MakeSpool());
  replay_.BackUp();
  replay_.LetIn(2);
  Start();
  ASSERT_NO_FATAL_FAILURE(Until([&] { return account().accepted > 0; }));
  const StepAccount before = account();
  Stop();
  replay_.GoBack();
  ASSERT_NO_FATAL_FAILURE(ExpectProgressAndOneAccount());
  EXPECT_EQ(lost(LossReason::kServer), before.accepted);
  EXPECT_EQ(lost(LossReason::kReplaced), before.pending);
  EXPECT_EQ(lost(LossReason::kKilled), 0);
}

// The server has rows of a later session, so it takes none of the spool's and does not say how many
// of them it has.
TEST_F(Restart, AStateOlderThanTheServersMemoryLosesItsSpoolAsReplaced) {
  ASSERT_NO_FATAL_FAILURE(MakeSpool());
  const test::ScratchDirectory aside;
  constexpr auto kAll =
      std::filesystem::copy_options::recursive | std::filesystem::copy_options::overwrite_existing;
  std::filesystem::copy(scratch_.path(), aside.path(), kAll);
  replay_.LetInAlways();
  Start();
  ASSERT_NO_FATAL_FAILURE(Until([&] { return replay_.session() > 1 && account().accepted > 500; }));
  Kill();
  std::filesystem::copy(aside.path(), scratch_.path(), kAll);
  Start();
  const StepAccount before = account();
  ASSERT_GT(before.pending, 0);
  ASSERT_NO_FATAL_FAILURE(Until([&] { return IsDriving(); }));
  EXPECT_EQ(lost(LossReason::kReplaced), before.pending);
  EXPECT_EQ(lost(LossReason::kKilled), 0);
}

TEST_F(Restart, ItIsWellWhileTheServerHoldsItsSpool) {
  ASSERT_NO_FATAL_FAILURE(MakeSpool());
  replay_.LetIn(3);
  Start();
  ASSERT_NO_FATAL_FAILURE(Until([&] { return account().accepted > 0; }));
  Turn();
  EXPECT_EQ(process_->registry.fault(), "");
}

}  // namespace
}  // namespace slalom::actor
