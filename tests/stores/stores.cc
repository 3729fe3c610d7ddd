#include "tests/stores/stores.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <thread>

#include "actor/service/ledger.h"
#include "actor/service/outbox.h"
#include "app/sweep/claim.h"
#include "app/sweep/store.h"
#include "base/error.h"
#include "base/file.h"
#include "learner/run/checkpoint_store.h"
#include "policy/policy.h"
#include "proto/transport/keys.h"
#include "replay/storage.h"
#include "tests/replay/journal_scene.h"
#include "tests/replay/model.h"

namespace slalom::test {
namespace {

namespace fs = std::filesystem;
using testing::Contains;

/// Calls `what`, which may fail as a user can mend. Returns whether it did not.
template <class What>
bool Try(const What& what) {
  try {
    what();
    return true;
  } catch (const base::Error&) {
    return false;
  }
}

// The states after each record of all uses of the journal. A recovery gives one of them.
std::vector<std::string> journal_states;

/// The journal of random records, of which most are overwritten in the table in the end.
replay::JournalScene MakeJournalScene(const fs::path& directory) {
  return {directory, 60, 2500, 11};
}

/// Waits until all records are written, or it is clear that they will not be.
void AwaitWritten(const replay::JournalScene& scene) {
  constexpr int kManyFailures = 10;
  while (scene.journal().written() < scene.appended()) {
    const replay::Journal::Status status = scene.journal().status();
    const bool is_at_end = status.failing.find("cannot sync") != std::string::npos;
    if (is_at_end || status.failures >= kManyFailures) return;
    std::this_thread::yield();
  }
}

/// Waits for a sync that begins after this call, or until a write or sync fails. Returns whether
/// there was one.
bool AwaitSync(const replay::JournalScene& scene) {
  const replay::Journal::Status before = scene.journal().status();
  for (;;) {
    const replay::Journal::Status now = scene.journal().status();
    if (now.failures > before.failures) return false;
    if (now.syncs >= before.syncs + 2) return true;  // The next one may have begun before.
    std::this_thread::yield();
  }
}

void UseJournal(const fs::path& directory, const Promise& written, const Promise& synced) {
  journal_states = {replay::JournalScene::Describe(
      replay::Table({.capacity = 60}, replay::JournalScene::kBeams), {})};
  auto scene = MakeJournalScene(directory);
  for (int start = 0; start < 2; ++start) {
    if (!Try([&] { scene.Open(); })) continue;
    // States of this start follow those of the start before, whose end it has found.
    const auto before = static_cast<int>(journal_states.size()) - 1;
    for (int round = 0; round < 5; ++round) {
      const std::size_t known = round == 0 ? 0 : scene.marks().size();
      // The last one adds to a segment that was synced before.
      scene.Append(round < 4 ? 15 : 1);
      for (std::size_t i = known; i < scene.marks().size(); ++i) {
        journal_states.push_back(scene.marks()[i].state);
      }
      AwaitWritten(scene);
      const auto num_written = static_cast<int>(scene.journal().written());
      if (num_written == 0) break;
      const int safe = before + num_written;
      written(safe);
      const bool all = safe + 1 == static_cast<int>(journal_states.size());
      if (synced && all && AwaitSync(scene)) synced(safe);
    }
    scene.Close();
  }
}

void CheckJournal(const fs::path& directory, int promised) {
  const auto scene = MakeJournalScene(directory);
  const replay::Recovered recovered = replay::RecoverJournal(scene.options(), scene.config());
  const std::string state = replay::JournalScene::Describe(recovered.table, recovered.sessions);
  EXPECT_THAT(std::vector(journal_states.begin() + promised, journal_states.end()), Contains(state))
      << promised << " records of " << journal_states.size() << " were promised\n"
      << testing::PrintToString(recovered.notes);
  EXPECT_EQ(recovered.lost_rows, 0) << testing::PrintToString(recovered.notes);
  const replay::Recovered again = replay::RecoverJournal(scene.options(), scene.config());
  EXPECT_EQ(replay::JournalScene::Describe(again.table, again.sessions), state);
  EXPECT_THAT(again.notes, testing::IsEmpty());
}

void UseSpool(const fs::path& directory, const Promise& written, const Promise& synced) {
  const fs::path path = directory / "spool";
  for (int session = 1; session <= 3; ++session) {
    actor::Outbox outbox(1 << 20);
    // A spool that cannot be read is kept for the next start, and is not taken for a damaged one.
    try {
      outbox.LoadSpool(path);
    } catch (const actor::DamagedSpool& error) {
      ADD_FAILURE() << error.what();
    } catch (const base::Error&) {
      continue;
    }
    outbox.Begin(session);
    for (int i = 0; i < session; ++i) {
      proto::Insert header;
      header.num_rows = header.num_steps = 1;
      header.num_beams = 1;
      outbox.Add(header, transport::Frame::Copy(std::string(5000, 'x')));
    }
    if (!Try([&] { outbox.SaveSpool(path, 1); })) continue;
    written(session);
    if (synced) synced(session);
  }
}

void CheckSpool(const fs::path& directory, int promised) {
  actor::Outbox outbox(1 << 20);
  const auto streams = outbox.LoadSpool(directory / "spool");
  EXPECT_TRUE(streams.has_value() || promised == 0);
  if (!streams) return;
  EXPECT_GE(static_cast<int>(outbox.session()), promised);
  EXPECT_EQ(outbox.num_chunks(), static_cast<int>(outbox.session()));
}

// An account outlives its process, and is new after a loss of power.
void UseLedger(const fs::path& directory, const Promise& written, const Promise&) {
  for (int start = 1; start <= 3; ++start) {
    Try([&] {
      actor::Ledger ledger(directory / "ledger");
      ledger.BeginSession(ledger.session() + 1, ledger.account().pending,
                          actor::LossReason::kKilled);
      ledger.AddMade(10);
      ledger.AcknowledgeAllBut(5);
      written(static_cast<int>(ledger.account().made));
    });
  }
}

void CheckLedger(const fs::path& directory, int promised) {
  const actor::Ledger ledger(directory / "ledger");
  const actor::StepAccount account = ledger.account();
  EXPECT_EQ(account.made, promised);
  EXPECT_EQ(account.made, std::accumulate(account.lost.begin(), account.lost.end(),
                                          account.accepted + account.pending));
}

// Tables by the number of their checkpoint, as text.
std::map<int, std::string> saved_tables;

replay::Table MakeTable() { return {{.capacity = 100}, env::StepShape(2)}; }

std::string DescribeTable(const replay::Table& table) {
  return replay::JournalScene::Describe(table, {});
}

void UseCheckpoints(const fs::path& directory, const Promise& written, const Promise& synced) {
  replay::ReplayModel model(100, env::StepShape(2), 3, 5);
  replay::Table table = MakeTable();
  std::optional<run::CheckpointStore> store;
  std::optional<replay::Storage> storage;
  if (!Try([&] {
        store.emplace(directory / "checkpoints");
        storage.emplace(directory / "replay");
      })) {
    return;
  }
  for (int number = 1; number <= 4; ++number) {
    for (int i = 0; i < 15; ++i) model.Advance(&table);
    saved_tables[number] = DescribeTable(table);
    // As `learner::LearnerLoop` does.
    const bool is_saved = Try([&] {
      store->Write(number, [&](const fs::path& checkpoint) {
        base::WriteFileAtomically(checkpoint / "state", std::to_string(number));
        base::WriteFileAtomically(checkpoint / "manifest", storage->Save(table));
      });
    });
    if (!is_saved) continue;
    written(number);
    if (synced) synced(number);
    Try([&] {
      std::vector<std::string> manifests;
      for (const fs::path& kept : store->Keep(run::CheckpointStore::kNumKept)) {
        manifests.push_back(base::ReadFile(kept / "manifest"));
      }
      if (!manifests.empty()) storage->Commit(manifests);
    });
  }
}

void CheckCheckpoints(const fs::path& directory, int promised) {
  const auto checkpoints = run::CheckpointStore(directory / "checkpoints").List();
  if (checkpoints.empty()) EXPECT_EQ(promised, 0);
  bool is_newest = true;
  for (const fs::path& checkpoint : checkpoints) {
    const int number = std::stoi(base::ReadFile(checkpoint / "state"));
    EXPECT_EQ(checkpoint.filename(), fmt::format("step-{}", number));
    if (is_newest) EXPECT_GE(number, promised);
    const replay::Table table =
        replay::Storage(directory / "replay").Load(base::ReadFile(checkpoint / "manifest"));
    EXPECT_EQ(DescribeTable(table), saved_tables.at(number));
    is_newest = false;
  }
}

void UseClaims(const fs::path& directory, const Promise&, const Promise&) {
  const fs::path cell = directory / "cell";
  for (int i = 0; i < 3; ++i) {
    std::unique_ptr<sweep::Claim> claim;
    Try([&] { claim = sweep::ClaimTaker().Try(cell); });
    if (!claim) continue;
    // Nobody else is there who could have taken it.
    EXPECT_TRUE(claim->Renew());
    Try([&] { EXPECT_EQ(sweep::ClaimTaker().Try(cell), nullptr); });
    EXPECT_TRUE(claim->Renew());
  }
}

// Whatever was left, the cell is free again once nobody beats.
void CheckClaims(const fs::path& directory, int) {
  sweep::ClaimTaker taker;
  const auto now = sweep::ClaimTaker::Clock::now();
  auto claim = taker.Try(directory / "cell", now);
  if (!claim) claim = taker.Try(directory / "cell", now + sweep::Claim::kExpiry);
  ASSERT_NE(claim, nullptr);
  EXPECT_TRUE(claim->Renew());
}

sweep::Cell MakeCell() {
  sweep::Cell cell;
  cell.id = "0123456789abcdef";
  return cell;
}

void UseCells(const fs::path& directory, const Promise& written, const Promise& synced) {
  const sweep::CellDirectory cell(directory, MakeCell().id);
  for (int number = 1; number <= 3; ++number) {
    const bool is_written = Try([&] {
      base::MakeDirectories(cell.root());
      sweep::WriteTrained(cell, {.steps = number, .updates = number});
      sweep::WriteScored(cell, {.wall_s = 1.0, .episodes = number});
    });
    if (!is_written) continue;
    written(number);
    if (synced) synced(number);
  }
}

void CheckCells(const fs::path& directory, int promised) {
  const sweep::CellStatus status = sweep::ReadCellStatus(directory, MakeCell());
  EXPECT_GE(status.trained ? status.trained->steps : 0, promised);
  EXPECT_GE(status.scored ? status.scored->episodes : 0, promised);
  // What is there is whole: one that cannot be read counts as missing.
  const sweep::CellDirectory cell(directory, MakeCell().id);
  EXPECT_EQ(fs::exists(cell.trained()), status.trained.has_value());
  EXPECT_EQ(fs::exists(cell.scored()), status.scored.has_value());
}

// The public halves of each use's keys, which others were given.
std::map<int, std::vector<std::string>> public_keys;

void UseKeys(const fs::path& directory, const Promise& written, const Promise& synced) {
  for (int number = 1; number <= 2; ++number) {
    const fs::path keys = directory / std::to_string(number);
    const bool is_written = Try([&] {
      transport::WriteNewKeys(keys);
      public_keys[number].clear();
      for (const transport::Role role : transport::kRoles) {
        public_keys[number].push_back(transport::LoadPublicKey(keys, role));
      }
    });
    if (!is_written) return;
    written(number);
    if (synced) synced(number);
  }
}

void CheckKeys(const fs::path& directory, int promised) {
  for (int number = 1; number <= promised; ++number) {
    const fs::path keys = directory / std::to_string(number);
    // A copy that a loss of power has left does not have the modes.
    for (const fs::path& file : base::ListDirectory(keys)) {
      fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
    }
    EXPECT_THAT(transport::CheckKeys(keys).faults, testing::IsEmpty());
    std::vector<std::string> found;
    for (const transport::Role role : transport::kRoles) {
      found.push_back(transport::LoadKeyPair(keys, role).public_key);
    }
    EXPECT_EQ(found, public_keys.at(number));
  }
}

policy::PolicySpec MakePolicySpec() {
  policy::PolicySpec spec;
  spec.observation.num_beams = 4;
  spec.network.sectors = 4;
  spec.network.encoder_layers = {3};
  spec.network.head_layers = {3};
  return spec;
}

void UsePolicies(const fs::path& directory, const Promise& written, const Promise& synced) {
  const fs::path path = directory / "policy.safetensors";
  for (int number = 1; number <= 3; ++number) {
    policy::PolicySnapshot snapshot = policy::ZeroSnapshot(MakePolicySpec());
    snapshot.version = number;
    const bool is_saved = Try([&] {
      policy::SavePolicy(path, snapshot, {{"steps", std::to_string(number)}});
    });
    if (is_saved) {
      written(number);
      if (synced) synced(number);
    }
    // Right, or an error.
    Try([&] { EXPECT_NE(policy::LoadPolicy(path).metadata.at("steps"), ""); });
  }
}

void CheckPolicies(const fs::path& directory, int promised) {
  const fs::path path = directory / "policy.safetensors";
  if (promised == 0 && !fs::exists(path)) return;
  EXPECT_GE(std::stoi(policy::LoadPolicy(path).metadata.at("steps")), promised);
}

}  // namespace

std::vector<Store> Stores() {
  return {{"Journal", UseJournal, CheckJournal, "replay/journal.cc"},
          {"Spool", UseSpool, CheckSpool},
          {"Ledger", UseLedger, CheckLedger, "actor/service/ledger.cc"},
          {"Checkpoints", UseCheckpoints, CheckCheckpoints},
          {"Claims", UseClaims, CheckClaims},
          {"Cells", UseCells, CheckCells},
          {"Policies", UsePolicies, CheckPolicies},
          {"Keys", UseKeys, CheckKeys, "proto/transport/keys.cc"}};
}

}  // namespace slalom::test
