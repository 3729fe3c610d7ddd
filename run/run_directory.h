#pragma once

#include <filesystem>

namespace slalom::run {

/// The files of a run (docs/operations.md). A value; makes nothing.
struct RunDirectory {
  std::filesystem::path root;

  std::filesystem::path config() const { return root / "config.toml"; }
  std::filesystem::path policy() const { return root / "policy.safetensors"; }
  std::filesystem::path metrics() const { return root / "metrics.csv"; }
  std::filesystem::path checkpoints() const { return root / "checkpoints"; }
  std::filesystem::path snapshots() const { return root / "snapshots"; }
  std::filesystem::path curve() const { return root / "curve.csv"; }
  std::filesystem::path training_picture() const { return root / "training.svg"; }
};

/// Holds a run's directory against other processes for as long as it lives, however it ends. The
/// directory keeps it when renamed. Movable.
class RunLock {
 public:
  /// Throws `base::Error` where another process holds it. Where the file system knows no locks
  /// nothing is held.
  explicit RunLock(const std::filesystem::path& root);
  ~RunLock();
  RunLock(RunLock&& other) noexcept;
  RunLock& operator=(RunLock&&) = delete;

 private:
  int fd_;
};

}  // namespace slalom::run
