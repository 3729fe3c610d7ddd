#include "app/train/disk_room.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>

#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"
#include "learner/run/checkpoint_store.h"
#include "replay/storage.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

constexpr auto kNumKept = static_cast<std::int64_t>(run::CheckpointStore::kNumKept);

/// Bytes that processes may still write to the disk of `path`. Negative: not known.
std::int64_t FreeBytes(fs::path path) {
  std::error_code ec;
  path = fs::absolute(path, ec);
  while (!fs::exists(path, ec) && !ec && path.has_relative_path()) path = path.parent_path();
  const fs::space_info space = fs::space(path, ec);
  // Some file systems do not say how large they are.
  return ec || space.capacity == 0 ? -1 : static_cast<std::int64_t>(space.available);
}

/// Keys that decide the size of checkpoints: "replay.capacity = 5000, run.checkpoint_steps = 0".
std::string Keys(const RunConfig& config) {
  std::string keys = fmt::format("replay.capacity = {}, run.checkpoint_steps = {}",
                                 config.replay.capacity, config.run.checkpoint_steps);
  if (!config.run.deterministic) {
    keys += fmt::format(", run.checkpoint_seconds = {}", config.run.checkpoint_seconds);
  }
  return keys;
}

}  // namespace

ReplayBytes CheckpointReplayBytes(const RunConfig& config) {
  const run::RunSettings& run = config.run;
  const std::int64_t capacity = config.replay.capacity;
  const bool ends_by_clock = run.max_seconds > 0.0;
  const bool saves_by_clock = !run.deterministic && run.checkpoint_seconds > 0.0;
  // Rows of each checkpoint that the one before does not hold. 0: there is only the last one.
  const std::int64_t interval = saves_by_clock && run.checkpoint_steps == 0
                                    ? capacity
                                    : std::min(capacity, run.checkpoint_steps);
  const std::int64_t most_rows = capacity + kNumKept * interval + replay::Storage::kPartFileRows;
  // Three checkpoints are certain only if the clock decides nothing.
  const bool has_three = !saves_by_clock && run.max_steps / (kNumKept + 1) >= run.checkpoint_steps;
  const std::int64_t least_rows = capacity + (has_three ? kNumKept * interval : 0);
  const auto bytes = [&config](std::int64_t rows) {
    return replay::Storage::BytesOfRows(StepShapeOf(config), rows);
  };
  // The last row of each episode, which is no step, is left out.
  return {bytes(std::min(ends_by_clock ? run.learning_starts : run.max_steps, least_rows)),
          bytes(std::min(run.max_steps, most_rows))};
}

void RequireRoom(const RunConfig& config, const run::RunDirectory& directory,
                 std::int64_t learner_bytes) {
  const std::int64_t free = FreeBytes(directory.root);
  if (free < 0) return;
  const std::int64_t room = free + run::DirectoryBytes(directory.checkpoints());
  const ReplayBytes replay = CheckpointReplayBytes(config);
  const std::int64_t least = replay.least + learner_bytes;
  const std::int64_t most = replay.most + (kNumKept + 1) * learner_bytes;
  base::ThrowIf(
      room < least,
      "{}: {} are free, and the checkpoints of this run need at least {} ({}); make room, choose "
      "another place, or lower these keys",
      directory.root.string(), base::FormatBytes(static_cast<double>(room)),
      base::FormatBytes(static_cast<double>(least)), Keys(config));
  if (room >= most) return;
  spdlog::warn(
      "{}: {} are free, and the checkpoints of this run may need {} ({}); one that finds no room "
      "is left out, and if it is the last one, only the policy is kept",
      directory.root.string(), base::FormatBytes(static_cast<double>(room)),
      base::FormatBytes(static_cast<double>(most)), Keys(config));
}

}  // namespace slalom::train
