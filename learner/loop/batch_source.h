#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "learner/run/metrics_log.h"
#include "replay/batch.h"

namespace slalom::learner {

/// The training episodes that ended since the last call.
struct EndedEpisodes {
  /// Mean sum of an episode's costs, over the most recent episodes.
  double mean_cost = std::numeric_limits<double>::quiet_NaN();
  std::int64_t count = 0;
};

/// The source of a learner's batches: a table in this process with an actor beside it, or a replay
/// server. Confined to the loop's thread.
class BatchSource {
 public:
  virtual ~BatchSource() = default;

  /// Starts or continues to gather data. Does nothing if it gathers already.
  virtual void Start() = 0;
  /// Stops gathering. `steps` then counts everything gathered so far, and `Save` may be called.
  virtual void Stop() = 0;

  /// Returns the batches of the next update, one of each kind, valid until the next call. Null if
  /// no update is due or no batch has come. Such a call gathers until a chunk comes, or for a few
  /// milliseconds, so that the loop can look after other things.
  virtual const std::vector<replay::SampledRows>* Next() = 0;
  /// Whether the last `Next` waited in vain for another process, so that its time does not count as
  /// training. True before the first `Next` of a source that depends on another process.
  virtual bool IsWaiting() const = 0;
  /// Whether all updates that the steps so far have earned are done. Snapshots and checkpoints are
  /// made only then, so that every lockstep run makes them at the same place.
  virtual bool IsAtRest() const = 0;

  /// The number of updates, since the run began, that `Next` has returned batches for. Updates of
  /// imagined batches are not among them.
  virtual std::int64_t num_drawn() const = 0;
  /// Environment steps of the run that the source knows of.
  virtual std::int64_t steps() const = 0;
  virtual EndedEpisodes TakeEndedEpisodes() = 0;
  /// Takes the new priorities of the rows of the last batch, [B] each.
  virtual void SetPriorities(std::span<const std::int64_t> sequence,
                             std::span<const float> priority) = 0;

  /// Returns a sample that serves figures only and has no effect on the batches. Null if there is
  /// none yet; it may come with a later call. Valid until the next `Next`.
  virtual const replay::SampledRows* SampleForFigures(const replay::SampleSpec& spec) = 0;
  /// Sets the columns of actors and replay.
  virtual void Describe(run::MetricsRow& row) = 0;
  /// Shows the finished row, the time left (`TrainingRun::SecondsLeft`) and the source's own
  /// figures to other processes.
  virtual void Report(const run::MetricsRow& row, double seconds_left, bool finished) = 0;

  /// Writes the data that `Restore` needs: files into the directory of a checkpoint, the rest into
  /// `state`. Throws `base::Error` if that fails.
  virtual void Save(const std::filesystem::path& checkpoint, nlohmann::json& state) = 0;
  /// Continues from a checkpoint. Throws `base::Error` or `nlohmann::json::exception` if it is
  /// damaged; a later call with another one must then succeed.
  virtual void Restore(const std::filesystem::path& checkpoint, const nlohmann::json& state) = 0;
  /// Deletes the data that none of these checkpoints needs. Throws `base::Error`, and deletes
  /// nothing, if `checkpoints` is empty or one of them cannot be read.
  virtual void KeepOnly(const std::vector<std::filesystem::path>& checkpoints) = 0;
};

}  // namespace slalom::learner
