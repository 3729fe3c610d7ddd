#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "app/sweep/cell.h"
#include "app/sweep/claim.h"
#include "app/train/run_identity.h"
#include "app/train/sweep_files.h"
#include "app/train/trained_policy.h"

/// The files of sweeps. Every cell has a directory named by its id, whichever plan asked for it
/// first, so that plans share cells:
///
///     ROOT/cells/ID/cell.json      what it is, for people and for the metrics
///     ROOT/cells/ID/training.toml  what `slalom train` is given
///     ROOT/cells/ID/run/           an ordinary run
///     ROOT/cells/ID/service/       what the service that trains it needs while it does
///     ROOT/cells/ID/trained.json   written once the training is finished (`TrainedCell`)
///     ROOT/cells/ID/scores/DIGEST.toml   the config of an evaluation
///     ROOT/cells/ID/scores/DIGEST/       the evaluation
///     ROOT/cells/ID/scored.json    written with the last of them (`ScoredCell`)
///     ROOT/cells/ID/log.txt        what its programs printed
///     ROOT/cells/ID/failed.json    written when the last attempt has failed (`CellFailure`)
///     ROOT/cells/ID/claim-N        who works on it (app/sweep/claim.h)
///     ROOT/plans/NAME/             the plan as it was resolved, and its report

namespace slalom::sweep {

/// Records that this program works on the plan: plan.toml (as resolved) and sweep.json (its cells,
/// the platform and the program). Throws `base::Error` if workers of another version or, unless the
/// plan mixes platforms, of another platform work on its cells now, because their results could not
/// be compared. Before that it watches claimed cells for `patience`, to see whether their workers
/// are alive.
void BeginPlan(const std::filesystem::path& store, const Plan& plan, const Cells& cells,
               const train::Platform& platform, const std::string& commit,
               std::chrono::seconds patience = Claim::kExpiry);

/// Counts the cells of the plan's last run that are not among `cells`, because the plan, the
/// program or the platform has changed. Returns 0 if it was never run.
int CountStale(const std::filesystem::path& store, const Plan& plan, const Cells& cells);

/// The directory of a sweep's cells. A value; makes no file.
class CellDirectory {
 public:
  CellDirectory(const std::filesystem::path& store, const std::string& id)
      : root_(store / train::kCellsDirectory / id) {}

  const std::filesystem::path& root() const { return root_; }
  std::filesystem::path facts() const { return root_ / train::kCellFactsFile; }
  std::filesystem::path config() const { return root_ / "training.toml"; }
  std::filesystem::path run() const { return root_ / train::kCellRunDirectory; }
  std::filesystem::path service() const { return root_ / "service"; }
  std::filesystem::path trained() const { return root_ / "trained.json"; }
  std::filesystem::path failed() const { return root_ / "failed.json"; }
  std::filesystem::path scored() const { return root_ / "scored.json"; }
  std::filesystem::path log() const { return root_ / "log.txt"; }
  /// The directory of an evaluation.
  std::filesystem::path score(const ScoreTask& task) const {
    return root_ / "scores" / task.digest;
  }
  /// Its config.
  std::filesystem::path score_task(const ScoreTask& task) const {
    return root_ / "scores" / (task.digest + ".toml");
  }

 private:
  std::filesystem::path root_;
};

/// Provenance of a finished training.
struct TrainedCell {
  std::int64_t steps = 0;
  std::int64_t updates = 0;
  /// Transitions that a model imagined to learn from. Empty if nothing was imagined.
  std::optional<std::int64_t> imagined{};
  double training_s = 0.0;        ///< Time spent training, over all sessions, [s].
  double wall_s = 0.0;            ///< The last session as a whole, loading included, [s].
  std::string host{};             ///< Machine of the last session.
  std::string platform{};         ///< Platform of that machine, by `train::Describe`.
  std::string commit{};           ///< Commit of the program.
  train::PolicyFigures stages{};  ///< The stages before it together; 0 if it had none.
  int at_once = 1;                ///< Cells that the last session's worker ran at the same time.

  /// The training and its stages.
  train::PolicyFigures total() const {
    train::PolicyFigures total{.steps = steps, .updates = updates, .training_s = training_s};
    return total += stages;
  }
};

/// How long the last session took to score a cell.
struct ScoredCell {
  double wall_s = 0.0;
  std::int64_t episodes = 0;
};

/// Why a cell was given up.
struct CellFailure {
  std::string what;  ///< A sentence without its full stop.
  std::string log;   ///< The end of its log.
};

enum class CellState {
  kWaiting,   ///< Nobody works on it, and something is still to be done.
  kTraining,  ///< Somebody works on it.
  kScoring,   ///< The same; it is trained.
  kDone,      ///< Trained, and every score of the plan is there.
  kFailed,    ///< Given up.
};
std::string_view ToString(CellState state);

/// A cell as its files show it now. A value.
struct CellStatus {
  CellState state = CellState::kWaiting;
  int num_scores_done = 0;
  std::int64_t steps = 0;  ///< Steps of its training so far, its stages included.
  std::optional<TrainedCell> trained;
  std::optional<ScoredCell> scored;
  std::optional<CellFailure> failure;
};

/// Reads a cell's files. Never waits or writes. A file that is damaged or still being written
/// counts as missing.
CellStatus ReadCellStatus(const std::filesystem::path& store, const Cell& cell);

/// Write the files of these names. Throw `base::Error` if that fails.
void WriteTrained(const CellDirectory& directory, const TrainedCell& trained);
void WriteScored(const CellDirectory& directory, const ScoredCell& scored);
void WriteFailure(const CellDirectory& directory, const CellFailure& failure);

/// Whether the evaluation of a score is there.
bool IsScored(const std::filesystem::path& store, const Cell& cell, const ScoreTask& task);
/// Whether every score that the plan asks of the cell is there.
bool IsDone(const std::filesystem::path& store, const Cell& cell);

/// Whether the training is finished but its policy is not here, because results were imported
/// without it (app/sweep/cell_archive.h). Only another training yields what they lack.
bool LacksPolicy(const std::filesystem::path& store, const Cell& cell);

/// The directory of a plan's own files.
std::filesystem::path PlanDirectory(const std::filesystem::path& store, const std::string& name);

}  // namespace slalom::sweep
