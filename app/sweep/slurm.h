#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "app/sweep/plan.h"

/// Cells as tasks of a Slurm cluster (`--engine slurm`, docs/sweeps-cluster.md). Slurm is used
/// through its own commands sbatch, squeue and sacct, which are looked up in PATH.

namespace slalom::sweep {

/// A sweep for Slurm. A value.
struct SlurmSweep {
  std::string name;  ///< Name of the plan. The array is called "slalom-NAME".
  SlurmSettings settings;
  /// The program and its arguments, to which a task appends `--cell ID`. Paths must hold on every
  /// machine of the cluster; relative ones count from the present working directory.
  std::vector<std::string> command;
  /// Directory of job.sh, submitted.json and the tasks' output: ROOT/plans/NAME/slurm.
  std::filesystem::path directory;
};

/// The result of a submission.
struct SlurmSubmission {
  std::string job;        ///< The array's number; empty if no cell was left to submit.
  int num_submitted = 0;  ///< Cells of the new array.
  int num_queued = 0;     ///< Cells that an earlier array holds, waiting or running.
};

/// Submits a job array with one task for each of the cells that no earlier array still holds.
///
/// Slurm tells a task by SIGTERM that it must end: a minute before the time limit, and when it
/// preempts, requeues or cancels it. The program then saves and exits with 143. A task that met its
/// time limit requeues itself; the other two come back or stay away as Slurm decides.
///
/// Two calls at the same time may submit a cell twice. The cell's claim then lets one of the two
/// tasks work on it. Throws `base::Error` if there is no sbatch or squeue, if one of them refuses
/// (with its own words), or if a file cannot be written.
SlurmSubmission SubmitToSlurm(const SlurmSweep& sweep, std::span<const std::string> cells);

/// The newest task of a cell.
struct SlurmTask {
  std::string cell;                ///< Its id.
  std::string task;                ///< "12_3": index 3 of array 12.
  std::string state;               ///< In Slurm's words, "PENDING"; empty if not known.
  std::string reason;              ///< Reason for waiting, in Slurm's words, "Resources"; or empty.
  std::filesystem::path output{};  ///< Log of the task.
};

/// Slurm's view of a sweep. A value.
struct SlurmStatus {
  std::vector<SlurmTask> tasks;    ///< In the order of submission. Empty if nothing was submitted.
  std::vector<std::string> notes;  ///< Questions that had no answer, one sentence each.
};

/// Asks squeue for the tasks in the queue and, if there is a database, sacct for those that have
/// left it. A command that does not answer gives a note, not an error, because a cell's own files
/// have the facts that matter. Throws `base::Error` if submitted.json is damaged.
SlurmStatus ReadSlurmStatus(const std::filesystem::path& directory, const std::string& name);

}  // namespace slalom::sweep
