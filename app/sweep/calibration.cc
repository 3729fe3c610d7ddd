#include "app/sweep/calibration.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>

#include "app/sweep/cell_command.h"
#include "base/child_process.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kTrial{8};
constexpr std::int64_t kLearningStarts = 2000;

/// A directory that is gone with this object.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (fs::temp_directory_path() / "slalom-sweep-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw base::Error(fmt::format("{}: cannot be made, for a short trial", name));
    }
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
  base::WriteFileAtomically(file, config::ToToml(config));
  {
    base::ChildProcess child({.arguments = TrainCommand(program, file, scratch.path()),
                              .log = log,
                              .environment = {"OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1"}});
    if (const auto exit_code = child.Wait(kTrial); exit_code && *exit_code != 0) {
      throw base::Error(fmt::format("{}: a short trial ended with exit code {}:\n{}", cell.name(),
                                    *exit_code, base::ReadFile(log)));
    }
  }  // Which ends it.
  const fs::path metrics = run::RunDirectory{scratch.path() / config.run.name}.metrics();
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
