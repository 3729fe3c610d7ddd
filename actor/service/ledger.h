#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <numeric>
#include <string_view>

#include "base/file_lock.h"

namespace slalom::actor {

/// Reasons why environment steps never reached the replay table, or are no longer there.
enum class LossReason {
  kKilled,    ///< Not acknowledged when the actor was killed.
  kReplaced,  ///< Not acknowledged when another session took over, or when the server no longer
              ///< knew the session.
  kServer,    ///< Acknowledged by a server that no longer has them (another directory, a backup).
};
inline constexpr int kNumLossReasons = 3;
std::string_view ToString(LossReason reason);

/// Accounts for all environment steps ever made by actors of one name: made = accepted + pending +
/// lost.
struct StepAccount {
  std::int64_t made = 0;
  std::int64_t accepted = 0;  ///< Steps that are, or were, in the replay server's table.
  std::int64_t pending = 0;   ///< Not acknowledged yet.
  std::array<std::int64_t, kNumLossReasons> lost{};

  std::int64_t total_lost() const {
    return std::accumulate(lost.begin(), lost.end(), std::int64_t{0});
  }
};

/// The step account of an actor and the number of its session, in a memory-mapped file that is
/// correct even after a `kill -9` at any moment. Confined to one thread; one process per file at a
/// time.
class Ledger {
 public:
  /// Opens the file, or creates it. Throws `base::Error` if that fails, the file is not a ledger
  /// or its steps do not add up, or another process has it open.
  explicit Ledger(const std::filesystem::path& path);
  ~Ledger();
  Ledger(const Ledger&) = delete;
  Ledger& operator=(const Ledger&) = delete;

  /// The number of the last session that was begun, or 0 if there was none.
  std::uint64_t session() const;

  /// Settles the last session, of which the server has `accepted` steps, and begins another. The
  /// steps that the server lacks are lost: for `kServer` if they were acknowledged, else for
  /// `reason`.
  void BeginSession(std::uint64_t session, std::int64_t accepted, LossReason reason);

  void AddMade(std::int64_t steps);
  /// Counts all steps of the session as acknowledged except `pending`, which the actor still keeps.
  /// A step that was counted once stays counted, because a spool may hold steps that were
  /// acknowledged before a kill. Requires: pending >= 0.
  void AcknowledgeAllBut(std::int64_t pending);

  StepAccount account() const;

 private:
  struct File;

  const File& file() const { return *file_; }

  const base::FileLock lock_;
  File* file_ = nullptr;
};

}  // namespace slalom::actor
