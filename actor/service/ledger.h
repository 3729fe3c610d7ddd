#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string_view>

namespace slalom::actor {

/// Why environment steps that were made are in no replay table.
enum class LossReason {
  kKilled,    ///< Not acknowledged when the actor was killed.
  kReplaced,  ///< Not acknowledged when another session took over, or the server knew its own no
              ///< more.
  kServer,    ///< Acknowledged by a server that no longer has them (another directory, a backup).
};
inline constexpr int kNumLossReasons = 3;
std::string_view ToString(LossReason reason);

/// What became of every environment step that the actor of a name ever made:
/// made = accepted + pending + lost.
struct StepAccount {
  std::int64_t made = 0;
  std::int64_t accepted = 0;  ///< In the replay server's table, or were.
  std::int64_t pending = 0;   ///< Not acknowledged yet.
  std::array<std::int64_t, kNumLossReasons> lost{};
};

/// The step account of an actor, in a memory-mapped file that is right after a `kill -9` at any
/// moment, and the number of its session. Confined to one thread; one process per file at a time.
class Ledger {
 public:
  /// Opens the file, or makes it. Throws `base::Error` where it cannot be, is no ledger, or another
  /// process has it open.
  explicit Ledger(const std::filesystem::path& path);
  ~Ledger();
  Ledger(const Ledger&) = delete;
  Ledger& operator=(const Ledger&) = delete;

  /// Of the last session that was begun; 0: none.
  std::uint64_t session() const;

  /// Settles the last session, of whose steps the server has `accepted`, and begins another:
  /// what it lacks is lost, for reason `kServer` as far as it was acknowledged, else for `reason`.
  void BeginSession(std::uint64_t session, std::int64_t accepted, LossReason reason);

  void AddMade(std::int64_t steps);
  void AddAcknowledged(std::int64_t steps);

  StepAccount account() const;

 private:
  struct File;

  const File& file() const { return *file_; }

  int fd_ = -1;
  File* file_ = nullptr;
};

}  // namespace slalom::actor
