#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace slalom::run {

/// The checkpoints of a run: directories `step-N`, each of which is complete or absent. The newest
/// two are kept. Confined to one thread.
class CheckpointStore {
 public:
  /// Makes the directory and removes what a crash left half written. Throws `base::Error` if it
  /// cannot.
  explicit CheckpointStore(const std::filesystem::path& directory);

  /// Lets `write` fill a fresh directory, which takes its name `step-N` only once all of it is on
  /// disk. An exception from `write` leaves the earlier checkpoints as they were, and nothing else.
  /// Checkpoints older than the newest two are removed last.
  void Write(std::int64_t steps, const std::function<void(const std::filesystem::path&)>& write);

  /// Renames a checkpoint that turned out to be damaged to `step-N.damaged`, so that it no longer
  /// counts. Throws `base::Error` if that fails.
  void SetAside(const std::filesystem::path& checkpoint);

  /// Removes all but the newest `num_kept` checkpoints. One that cannot be removed stays.
  void Keep(std::size_t num_kept);

  /// Returns the directories of the checkpoints, newest first.
  std::vector<std::filesystem::path> List() const;

  const std::filesystem::path& directory() const { return directory_; }

 private:
  const std::filesystem::path directory_;
};

}  // namespace slalom::run
