#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/file_lock.h"

namespace slalom::run {

/// The paths of a run's files (docs/operations.md). A value; makes no file.
struct RunDirectory {
  std::filesystem::path root;

  std::filesystem::path lock() const { return root / "lock"; }
  std::filesystem::path config() const { return root / "config.toml"; }
  std::filesystem::path policy() const { return root / "policy.safetensors"; }
  std::filesystem::path metrics() const { return root / "metrics.csv"; }
  std::filesystem::path checkpoints() const { return root / "checkpoints"; }
  std::filesystem::path snapshots() const { return root / "snapshots"; }
  /// Snapshot taken at `steps`. Names sort in the order of the steps.
  std::filesystem::path snapshot(std::int64_t steps) const;
  /// The snapshots that are there, in the order of their steps. Throws `base::Error` if they cannot
  /// be listed.
  std::vector<std::filesystem::path> ListSnapshots() const;
  /// Copies of the files that the config names (app/train/inputs.h).
  std::filesystem::path inputs() const { return root / "inputs"; }
  std::filesystem::path curve() const { return root / "curve.csv"; }
  std::filesystem::path training_page() const { return root / "training.html"; }
};

/// The paths of a checkpoint's files. A value; makes no file.
struct CheckpointFiles {
  std::filesystem::path root;

  std::filesystem::path state() const { return root / "state.json"; }
  std::filesystem::path learner() const { return root / "learner.safetensors"; }
  /// The policy that acted.
  std::filesystem::path acting() const { return root / "acting.safetensors"; }
  std::filesystem::path actor() const { return root / "actor.bin"; }
  std::filesystem::path replay() const { return root / "replay.manifest"; }
  std::filesystem::path priorities() const { return root / "priorities"; }
};

/// Locks a run's directory against other processes, of other machines, too, where the file system
/// has locks (`base::FileLock` of a file, since NFS locks no directories).
struct RunLock : base::FileLock {
  /// Throws `base::Error` if another process holds the lock, or the file cannot be made.
  explicit RunLock(const std::filesystem::path& root);
};

}  // namespace slalom::run
