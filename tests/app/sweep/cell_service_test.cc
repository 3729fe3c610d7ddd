#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "app/sweep/cell_work.h"
#include "app/sweep/store.h"
#include "base/config.h"
#include "base/file.h"
#include "policy/policy.h"
#include "tests/app/sweep/plan_files.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::UnorderedElementsAre;

constexpr std::int64_t kMaxSteps = 4000;  // Of the tiny preset.

/// A cell that a service of two actors trains, and a stand-in for `slalom`: a script with a piece
/// for each role. Before its piece, a role writes its command line to `calls`. The pieces know $D,
/// the directory, $STATE, the service's, $RUN, the run's, and some functions:
///   once         succeeds the first time that the role asks
///   join         tells the learner that this process is there
///   meet         in the learner: waits for the three others
///   rest         waits for a signal, which ends it
///   finish STEPS leaves a policy that was trained for so many steps
class ServiceCell {
 public:
  ServiceCell()
      : cell_(test::Expand(scratch_.path(),
                           std::string(test::kSweep) + "trainer = \"service\"\n" + test::kTinyScore)
                  .cells.at(0)),
        options_{.store = scratch_.path() / "store", .program = scratch_.path() / "program"},
        files_(options_.store, cell_.id) {
    const fs::path joined = scratch_.path() / "joined";
    ::mkfifo(joined.c_str(), 0600);
    joined_ = ::open(joined.c_str(), O_RDWR | O_CLOEXEC);  // Keeps what nobody has read.
    policy::PolicySnapshot snapshot = policy::ZeroSnapshot(train::MakePolicySpec(*cell_.config));
    snapshot.version = 35;
    for (const std::int64_t steps : {kMaxSteps / 2, kMaxSteps}) {
      policy::SavePolicy(scratch_.path() / fmt::format("policy-{}", steps), snapshot,
                         {{"steps", fmt::format("{}", steps)}, {"updates", "35"}});
    }
  }

  ~ServiceCell() { ::close(joined_); }
  ServiceCell(const ServiceCell&) = delete;
  ServiceCell& operator=(const ServiceCell&) = delete;

  /// Works on the cell. `pieces`: of the roles that do not just join and rest, or, for the learner,
  /// meet and finish.
  WorkEnd Work(std::map<std::string, std::string> pieces, const std::stop_token& stop = {}) {
    pieces.try_emplace("learner", fmt::format("meet; finish {}", kMaxSteps));
    for (const char* role : {"replay", "actor"}) pieces.try_emplace(role, "join; rest");
    std::string cases;
    for (const auto& [role, piece] : pieces) cases += fmt::format("{}) {} ;;\n", role, piece);
    base::WriteFileAtomically(
        options_.program,
        fmt::format("#!/bin/sh\nD={}\nSTATE={}\nRUN={}\n"
                    "case $1 in evaluate) while [ $1 != --output ]; do shift; done\n"
                    "  mkdir -p $2; echo {{}} > $2/evaluation.json; exit;; esac\n"
                    "echo \"$1 $5\" >> $D/calls\n"
                    "once() {{ mkdir $D/once-$1 2> /dev/null; }}\n"
                    "join() {{ echo > $D/joined; }}\n"
                    "meet() {{ for i in 1 2 3; do read line < $D/joined; done; }}\n"
                    "rest() {{ exec sleep 1000; }}\n"
                    "finish() {{ mkdir -p $RUN/checkpoints/step-1; touch $RUN/config.toml;"
                    " cp $D/policy-$1 $RUN/policy.safetensors; exit 0; }}\n"
                    "NAME=$5\ncase $1 in\n{}esac\n",
                    scratch_.path().string(), files_.service().string(), files_.run().string(),
                    cases));
    fs::permissions(options_.program, fs::perms::owner_all);
    return WorkOnCell(cell_, options_, *ClaimTaker().Try(files_.root()), stop);
  }

  /// The processes that were started, in any order.
  std::vector<std::string> Calls() const {
    std::istringstream text(base::ReadFile(scratch_.path() / "calls"));
    std::vector<std::string> calls;
    for (std::string line; std::getline(text, line);) calls.push_back(line);
    return calls;
  }

  CellStatus Status() const { return ReadCellStatus(options_.store, cell_); }
  const Cell& cell() const { return cell_; }
  const CellDirectory& files() const { return files_; }
  fs::path directory() const { return scratch_.path(); }

 private:
  const test::ScratchDirectory scratch_;
  const Cell cell_;
  const WorkOptions options_;
  const CellDirectory files_;
  int joined_ = -1;
};

TEST(CellServiceTest, ACellIsTrainedByProcessesThatShareAConfigAndKeysOfTheirOwn) {
  ServiceCell cell;
  EXPECT_EQ(cell.Work({{"replay", "cp -r $STATE $D/seen; join; rest"}}), WorkEnd::kDone);
  EXPECT_THAT(cell.Calls(), UnorderedElementsAre("learner learner", "replay replay",
                                                 "actor actor-1", "actor actor-2"));
  EXPECT_EQ(cell.Status().state, CellState::kDone);
  EXPECT_EQ(cell.Status().trained.value().steps, kMaxSteps);
  EXPECT_EQ(cell.Status().trained.value().updates, 35);
  EXPECT_FALSE(fs::exists(cell.files().service())) << "results are what stays";

  const fs::path seen = cell.directory() / "seen";
  const auto config = config::Load<train::RunConfig>(seen / "service.toml", {});
  EXPECT_THAT(config.service.replay,
              testing::ElementsAre(testing::MatchesRegex("ipc://@slalom-[0-9a-f]{16}-replay")));
  EXPECT_THAT(config.service.learner, testing::MatchesRegex("ipc://@slalom-[0-9a-f]{16}-learner"));
  EXPECT_EQ(config.service.state, cell.files().service());
  EXPECT_EQ(config.security.keys, cell.files().service() / "keys");
  EXPECT_EQ(config.learner_service.directory, cell.files().run());
  EXPECT_TRUE(config.learner_service.exit_when_finished);
  EXPECT_FALSE(config.run.deterministic);
  for (const char* key : {"replay.key", "learner.key", "actor.key", "operator.key", "allowed"}) {
    EXPECT_TRUE(fs::exists(seen / "keys" / key)) << key;
  }
  // What is trained is what one process would train.
  train::RunConfig trained = config;
  trained.service = {};
  trained.security = {};
  trained.learner_service = cell.cell().config->learner_service;
  EXPECT_EQ(config::ToToml(trained), config::ToToml(*cell.cell().config));
}

TEST(CellServiceTest, AProcessThatASignalEndedIsStartedAgain) {
  ServiceCell cell;
  const std::string killed = "once $NAME && kill -9 $$; ";
  EXPECT_EQ(cell.Work({{"learner", killed + "meet; finish 4000"},
                       {"replay", killed + "join; rest"},
                       {"actor", "once $NAME && kill -15 $$; join; rest"}}),
            WorkEnd::kDone);
  std::vector<std::string> calls = cell.Calls();
  std::ranges::sort(calls);
  EXPECT_THAT(calls,
              ElementsAre("actor actor-1", "actor actor-1", "actor actor-2", "actor actor-2",
                          "learner learner", "learner learner", "replay replay", "replay replay"));
}

TEST(CellServiceTest, AProcessThatWasStoppedBeforeTheTrainingEndedIsStartedAgain) {
  ServiceCell cell;
  EXPECT_EQ(cell.Work({{"learner", "meet; once $NAME && finish 2000; finish 4000"},
                       {"replay", "join; once $NAME && exit 0; join; rest"},
                       {"actor", "join; join; rest"}}),
            WorkEnd::kDone);
  EXPECT_EQ(std::ranges::count(cell.Calls(), "learner learner"), 2);
  EXPECT_EQ(std::ranges::count(cell.Calls(), "replay replay"), 2);
  EXPECT_EQ(cell.Status().trained.value().steps, kMaxSteps);
}

TEST(CellServiceTest, AnErrorOfAProcessIsWhyTheCellFailed) {
  ServiceCell cell;
  EXPECT_EQ(
      cell.Work({{"learner", "rest"}, {"replay", "echo no room >&2; exit 1"}, {"actor", "rest"}}),
      WorkEnd::kFailed);
  const CellFailure failure = cell.Status().failure.value();
  EXPECT_EQ(failure.what, "`slalom replay` ended with exit code 1");
  EXPECT_EQ(failure.log, "no room\n");
  EXPECT_EQ(std::ranges::count(cell.Calls(), "replay replay"), 3) << "a cell has three attempts";
}

TEST(CellServiceTest, AProcessThatIsEndedAgainAndAgainIsWhyTheCellFailed) {
  ServiceCell cell;
  EXPECT_EQ(cell.Work({{"learner", "rest"},
                       {"replay", "rest"},
                       {"actor", "[ $NAME = actor-1 ] || kill -9 $$; rest"}}),
            WorkEnd::kFailed);
  EXPECT_EQ(cell.Status().failure.value().what,
            "`slalom actor --name actor-2` was ended by signal 9, 5 times in a row within 10 s of "
            "its start");
  EXPECT_EQ(std::ranges::count(cell.Calls(), "actor actor-2"), 3 * 5);
}

TEST(CellServiceTest, ATrainingThatDivergesBeginsAgain) {
  ServiceCell cell;
  EXPECT_EQ(cell.Work({{"learner",
                        "[ -e $STATE/journal ] && echo old >> $D/found; "
                        "once $NAME && { meet; touch $STATE/journal; exit 3; }; "
                        "meet; finish 4000"}}),
            WorkEnd::kDone);
  EXPECT_EQ(std::ranges::count(cell.Calls(), "learner learner"), 2);
  EXPECT_FALSE(fs::exists(cell.directory() / "found")) << "rows of the training before";
}

TEST(CellServiceTest, ARequestToStopEndsEachProcessAndTheNextWorkGoesOn) {
  ServiceCell cell;
  std::stop_source stop;
  ::mkfifo((cell.directory() / "ready").c_str(), 0600);
  std::jthread stopper([&] {
    std::ifstream(cell.directory() / "ready").get();
    stop.request_stop();
  });
  const std::string saves =
      "mkdir -p $RUN/checkpoints/step-1; touch $RUN/config.toml $STATE/journal; exit 0";
  EXPECT_EQ(cell.Work({{"learner", "trap '" + saves +
                                       "' TERM; meet; echo > $D/ready; "
                                       "while :; do read line < $D/joined; done"}},
                      stop.get_token()),
            WorkEnd::kStopped);
  EXPECT_EQ(cell.Calls().size(), 4U) << "none was started again";
  EXPECT_EQ(cell.Work({{"learner", "[ -e $STATE/journal ] || exit 1; meet; finish 4000"}}),
            WorkEnd::kDone);
  EXPECT_EQ(cell.Calls().size(), 8U);
}

}  // namespace
}  // namespace slalom::sweep
