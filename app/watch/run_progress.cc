#include "app/watch/run_progress.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "app/train/sweep_files.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json.h"
#include "learner/run/run_directory.h"

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;

constexpr double kFresh = 15.0;  // Seconds since its last write within which a file has a writer.
constexpr double kComplete = 0.995;  // Share of a limit; a run ends a moment before or after it.

/// Whether a process holds the directory as `run::RunLock` does. Reads the kernel's list of locks,
/// so that watching never holds a lock, not even for a moment. False if the kernel shows no list or
/// the holder is on another machine.
bool IsHeld(const fs::path& directory) {
  struct stat status {};
  if (::stat(run::RunDirectory{directory}.lock().c_str(), &status) != 0) return false;
  const std::string place =
      fmt::format(" {:02x}:{:02x}:{} ", major(status.st_dev), minor(status.st_dev), status.st_ino);
  std::ifstream locks("/proc/locks");
  for (std::string line; std::getline(locks, line);) {
    if (line.find("FLOCK") != std::string::npos && line.find(place) != std::string::npos) {
      return true;
    }
  }
  return false;
}

/// The part of the run that is behind it, from 0 to 1.
double FractionOf(const run::MetricsTable& metrics, const RunFacts& facts) {
  double fraction = 0.0;
  const double steps = metrics.Last("steps");
  const double seconds = metrics.Last("training_s");
  if (facts.max_steps > 0 && steps > 0.0) fraction = steps / static_cast<double>(facts.max_steps);
  if (facts.max_seconds > 0.0 && seconds > 0.0) {
    fraction = std::max(fraction, seconds / facts.max_seconds);
  }
  return std::min(1.0, fraction);
}

}  // namespace

std::string_view ToString(RunState state) {
  constexpr std::array<std::string_view, 4> kNames = {"starting", "training", "finished",
                                                      "stopped"};
  return kNames.at(static_cast<std::size_t>(state));
}

bool IsRun(const fs::path& directory) {
  const run::RunDirectory files{directory};
  std::error_code ignored;  // An unreadable directory is no run.
  return fs::is_regular_file(files.config(), ignored) ||
         fs::is_regular_file(files.metrics(), ignored);
}

std::optional<RunProgress> ReadRun(const fs::path& directory, const RunFacts& facts,
                                   std::size_t max_rows) {
  if (!IsRun(directory)) return std::nullopt;
  RunProgress progress;
  progress.name = NameOf(directory);
  fs::path file = run::RunDirectory{directory}.metrics();
  std::error_code missing;
  for (std::size_t i = facts.stages.size(); i > 0 && !fs::exists(file, missing); --i) {
    const StageFacts& stage = facts.stages[i - 1];
    if (!IsRun(stage.directory)) continue;
    progress.stage = fmt::format("{} ({} of {})", stage.name, i, facts.stages.size());
    file = run::RunDirectory{stage.directory}.metrics();
    break;
  }
  const auto written = fs::last_write_time(file, missing);
  if (!missing) {
    const auto age = fs::file_time_type::clock::now() - written;
    progress.age_s = std::max(0.0, std::chrono::duration<double>(age).count());
    progress.metrics = run::ReadMetrics(file, max_rows);
    if (!IsRun(directory)) return std::nullopt;  // Deleted since.
  }
  try {
    const fs::path scores = run::RunDirectory{directory}.curve();
    if (base::Exists(scores)) progress.scores = run::ParseMetrics(base::ReadFile(scores), max_rows);
  } catch (const base::Error&) {  // Replaced or deleted at this moment.
  }
  // The time that the later stages take is not known.
  const double fraction = progress.stage.empty() ? FractionOf(progress.metrics, facts) : 0.0;
  const bool held = IsHeld(directory);
  const bool fresh = !missing && progress.age_s < kFresh;
  if (held || (fresh && fraction < kComplete)) {
    progress.state = progress.metrics.num_rows() > 0 ? RunState::kTraining : RunState::kStarting;
  } else {
    progress.state = fraction >= kComplete ? RunState::kFinished : RunState::kStopped;
  }
  if (progress.state == RunState::kTraining && fraction > 0.0) {
    progress.left_s = progress.metrics.Last("training_s") * (1.0 / fraction - 1.0);
  }
  return progress;
}

std::vector<fs::path> ListRuns(const fs::path& root) {
  if (IsRun(root)) return {root};
  std::vector<fs::path> runs;
  std::error_code ended;
  const fs::path cells = root / train::kCellsDirectory;
  const fs::path& around = fs::is_directory(cells, ended) ? cells : root;
  for (fs::directory_iterator it(around, ended); !ended && it != fs::directory_iterator();
       it.increment(ended)) {
    for (const fs::path& place : {it->path(), it->path() / train::kCellRunDirectory}) {
      if (IsRun(place)) runs.push_back(place);
    }
  }
  std::sort(runs.begin(), runs.end());
  return runs;
}

std::string NameOf(const fs::path& run) {
  const fs::path normal = fs::absolute(run).lexically_normal();
  const fs::path named = normal.has_filename() ? normal : normal.parent_path();
  std::error_code ec;
  const fs::path cell = named.parent_path();
  if (named.filename() != train::kCellRunDirectory ||
      !fs::is_regular_file(cell / train::kCellFactsFile, ec)) {
    return named.filename().string();
  }
  std::ifstream file(cell / train::kCellFactsFile);
  const auto facts = base::ParseJson(std::string(std::istreambuf_iterator<char>(file), {}));
  std::string id = cell.filename().string();
  if (!facts.is_object() || !facts.value("row", nlohmann::json()).is_string()) return id;
  return fmt::format("{}, seed {} ({})", facts["row"].get<std::string>(),
                     facts.value("seed", nlohmann::json()).dump(), id);
}

}  // namespace slalom::watch
