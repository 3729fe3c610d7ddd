#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace slalom::run {

/// The checkpoints of a run: directories `step-N`, each of which is complete or absent. Confined to
/// one thread.
class CheckpointStore {
 public:
  /// Number of checkpoints to `Keep` during a run: if the newest is damaged, the one before it
  /// serves.
  static constexpr std::size_t kNumKept = 2;

  /// Makes the directory and removes incomplete checkpoints that a crash left. Throws `base::Error`
  /// if that fails.
  explicit CheckpointStore(const std::filesystem::path& directory);

  /// Lets `write` fill a fresh directory, which gets its name `step-N` only once all of it is on
  /// disk. Returns that directory. An exception from `write` leaves the earlier checkpoints as they
  /// were, and nothing else. Throws `base::Error` if the directory cannot be made or named.
  std::filesystem::path Write(std::int64_t steps,
                              const std::function<void(const std::filesystem::path&)>& write);

  /// Renames a checkpoint that turned out to be damaged to `step-N.damaged`, so that it no longer
  /// counts. Throws `base::Error` if that fails.
  void SetAside(const std::filesystem::path& checkpoint);

  /// Removes all but the newest `num_kept` checkpoints and returns those, newest first. One that
  /// cannot be removed stays. Throws `base::Error`, and removes none, if they cannot be listed.
  std::vector<std::filesystem::path> Keep(std::size_t num_kept);

  /// Returns the directories of the checkpoints, newest first. Throws `base::Error` if they cannot
  /// be listed.
  std::vector<std::filesystem::path> List() const;

  const std::filesystem::path& directory() const { return directory_; }

 private:
  const std::filesystem::path directory_;
};

/// Size of all readable files below a directory [bytes].
std::int64_t DirectoryBytes(const std::filesystem::path& directory);

}  // namespace slalom::run
