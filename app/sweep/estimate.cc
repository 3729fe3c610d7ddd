#include "app/sweep/estimate.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <string>

#include "app/sweep/cell_commands.h"
#include "app/train/disk_room.h"
#include "app/train/local_service.h"
#include "app/train/resolved_run.h"
#include "base/child_process.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

// Sizes on disk, measured on runs of configs/fast: a course of an evaluation (track, rows,
// picture), and a run without its checkpoints.
constexpr std::int64_t kBytesPerScoredCourse = 20'000;
constexpr std::int64_t kBytesPerRun = 3'000'000;

}  // namespace

void Rates::Observe(const Cell& cell, const CellStatus& status) {
  if (cell.config && status.trained && status.trained->steps > 0) {
    const train::PolicyFigures trained = status.trained->total();
    for (Mean* mean : {&training_[cell.group], &all_training_}) {
      mean->seconds += trained.training_s;
      mean->count += static_cast<double>(trained.steps);
    }
  }
  if (status.scored && status.scored->episodes > 0) {
    episodes_.seconds += status.scored->wall_s;
    episodes_.count += static_cast<double>(status.scored->episodes);
  }
}

void Rates::Set(const std::string& group, double seconds_per_step) {
  training_[group] = {seconds_per_step, 1.0};
}

std::optional<double> Rates::SecondsLeft(const Cell& cell, std::int64_t steps, int scores) const {
  double seconds = 0.0;
  const std::int64_t max_steps = cell.config ? train::MaxStepsOf(*cell.config) : 0;
  if (steps < max_steps) {
    if (const double limit = train::MaxSecondsOf(*cell.config); limit > 0.0) {
      seconds += limit;
    } else {
      const auto group = training_.find(cell.group);
      const Mean& mean = group == training_.end() ? all_training_ : group->second;
      if (mean.count == 0.0) return std::nullopt;
      seconds += mean.value() * static_cast<double>(max_steps - steps);
    }
  }
  if (episodes_.count > 0.0) {
    for (std::size_t i = static_cast<std::size_t>(scores); i < cell.scores.size(); ++i) {
      seconds += episodes_.value() * static_cast<double>(cell.scores[i].num_episodes);
    }
  }
  return seconds;
}

double WallSeconds(double work_s, int num_cells, int at_once) {
  return work_s / std::clamp(num_cells, 1, at_once);
}

std::int64_t BytesWhileTraining(const Cell& cell) {
  if (!cell.config) return 0;
  return train::CheckpointReplayBytes(*cell.config).most + kBytesPerRun;
}

std::int64_t BytesKept(const Cell& cell) {
  std::int64_t bytes = cell.config ? kBytesPerRun : 0;
  for (const ScoreTask& task : cell.scores) bytes += kBytesPerScoredCourse * task.num_courses;
  return bytes;
}

namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kTrial{8};
constexpr std::int64_t kLearningStarts = 2000;

/// A directory that is gone with this object.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (fs::temp_directory_path() / "slalom-sweep-XXXXXX").string();
    base::ThrowIf(::mkdtemp(name.data()) == nullptr, "{}: cannot be made, for a short trial", name);
    path_ = name;
  }
  ~TemporaryDirectory() {
    std::error_code ec;
    fs::remove_all(path_, ec);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

}  // namespace

std::optional<double> MeasureSecondsPerStep(const Cell& cell, const fs::path& program) {
  train::RunConfig config = *cell.config;
  config.run.learning_starts = std::min(config.run.learning_starts, kLearningStarts);
  config.run.max_steps = std::max(config.run.max_steps, std::int64_t{10'000'000});
  config.run.log_interval = 0.2;
  config.run.checkpoint_steps = 0;
  config.run.checkpoint_seconds = 0.0;
  config.run.snapshot_steps.clear();
  config.run.snapshot_seconds.clear();
  const TemporaryDirectory scratch;
  const fs::path file = scratch.path() / "config.toml";
  const fs::path log = scratch.path() / "log.txt";
  const run::RunDirectory run{scratch.path() / config.run.name};
  base::WriteFileAtomically(file, config::ToToml(config));
  std::optional<int> exit_code;
  if (cell.num_actors > 0) {
    config.service.metrics = "";
    train::LocalService service({.program = program,
                                 .config = config,
                                 .num_actors = cell.num_actors,
                                 .directory = scratch.path() / "service",
                                 .run = run.root,
                                 .log = log,
                                 .environment = ThreadLimits(1)});
    const auto end = std::chrono::steady_clock::now() + kTrial;
    while (!exit_code && std::chrono::steady_clock::now() < end) {
      exit_code = service.Wait(std::chrono::milliseconds(200));
    }
  } else {
    base::ChildProcess child({.arguments = TrainCommand(program, file, scratch.path()),
                              .log = log,
                              .environment = ThreadLimits(1)});
    exit_code = child.Wait(kTrial);
  }  // Which ends it.
  if (exit_code && *exit_code != 0) {
    throw base::Error("{}: a short trial ended with exit code {}:\n{}", cell.name(), *exit_code,
                      base::ReadFile(log));
  }
  const fs::path metrics =
      run::RunDirectory{train::RunsOf(*cell.config, run.root).front()}.metrics();
  std::error_code ec;
  if (!fs::exists(metrics, ec)) return std::nullopt;
  const run::MetricsTable table = run::ParseMetrics(base::ReadFile(metrics), 0);
  const std::vector<double> steps = table.Column("steps");
  const std::vector<double> updates = table.Column("updates");
  const std::vector<double> seconds = table.Column("training_s");
  const auto first = static_cast<std::size_t>(
      std::ranges::find_if(updates, [](double n) { return n > 0.0; }) - updates.begin());
  if (first + 1 >= steps.size() || steps.back() <= steps[first]) return std::nullopt;
  return (seconds.back() - seconds[first]) / (steps.back() - steps[first]);
}

}  // namespace slalom::sweep
