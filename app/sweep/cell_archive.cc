#include "app/sweep/cell_archive.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "app/sweep/claim.h"
#include "app/sweep/store.h"
#include "app/train/agent_run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "eval/report/compact_result.h"
#include "eval/report/result.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxMetricsRows = 200;

/// The files of one cell, by their paths below its directory, in the order in which they are
/// written: the last ones make it count as done.
struct CellFiles {
  std::string id;
  fs::path root;  // Where they were read.
  std::vector<std::pair<fs::path, std::string>> files;

  void Add(const fs::path& path, std::string text) { files.emplace_back(path, std::move(text)); }
};

/// The text of a file that must hold a JSON object.
std::string ReadJson(const fs::path& file) {
  std::string text = base::ReadFile(file);
  if (nlohmann::json::parse(text, nullptr, false).is_object()) return text;
  throw base::Error(fmt::format("{}: is damaged, expected a JSON object", file.string()));
}

std::string ScoreFile(const std::string& digest) {
  return (fs::path("scores") / digest / eval::kEvaluationFile).string();
}

/// The scores that lie in a cell's directory.
std::vector<std::string> DigestsIn(const fs::path& root) {
  std::vector<std::string> digests;
  for (const fs::path& path : base::ListDirectory(root / "scores")) {
    if (base::Exists(path / eval::kEvaluationFile)) digests.push_back(path.filename().string());
  }
  std::ranges::sort(digests);
  return digests;
}

/// A file of a cell that not each cell has.
void AddIfThere(CellFiles& cell, const fs::path& path) {
  if (base::Exists(cell.root / path)) cell.Add(path, ReadJson(cell.root / path));
}

void AddScore(CellFiles& cell, const std::string& digest, std::string task) {
  const fs::path file = cell.root / ScoreFile(digest);
  cell.Add(fs::path("scores") / (digest + ".toml"), std::move(task));
  cell.Add(ScoreFile(digest), eval::CompactResult(base::ReadFile(file), file.string()));
}

/// The changed keys of a config, without where courses lie.
template <class Config>
std::string Portable(Config config) {
  config.courses.collection = "";
  return config::Changes(std::move(config));
}

/// Of the rows of a training's log, when it had made how many steps.
std::string Rhythm(const fs::path& metrics) {
  const run::MetricsTable log = run::ParseMetrics(base::ReadFile(metrics), kMaxMetricsRows);
  const std::vector<double> steps = log.Column("steps");
  const std::vector<double> seconds = log.Column("training_s");
  std::string text = "training_s,steps\n";
  for (std::size_t i = 0; i < steps.size(); ++i) {
    text += fmt::format("{},{}\n", seconds[i], steps[i]);
  }
  return text;
}

/// A finished cell of a store.
CellFiles ReadFinished(const fs::path& store, const Cell& cell) {
  const CellDirectory directory(store, cell.id);
  CellFiles files{cell.id, directory.root(), {}};
  AddIfThere(files, "cell.json");
  if (cell.config) files.Add("training.toml", Portable(*cell.config));
  bool has_snapshots = false;
  for (const ScoreTask& task : cell.scores) {
    const std::string source = directory.score_task(task).string();
    AddScore(files, task.digest,
             cell.config ? Portable(config::FromToml<train::RunConfig>(task.task, source))
                         : Portable(config::FromToml<train::AgentRunConfig>(task.task, source)));
    has_snapshots = has_snapshots || task.snapshot_steps > 0;
  }
  const fs::path metrics = run::RunDirectory{directory.run()}.metrics();
  if (has_snapshots && base::Exists(metrics)) files.Add("run/metrics.csv", Rhythm(metrics));
  AddIfThere(files, "scored.json");
  AddIfThere(files, "trained.json");
  return files;
}

/// A cell of an archive. Its configs are not read: they may be of an older program.
CellFiles ReadArchived(const fs::path& root) {
  CellFiles files{root.filename().string(), root, {}};
  files.Add("cell.json", ReadJson(root / "cell.json"));
  const auto id = nlohmann::json::parse(files.files.front().second).value("id", "");
  if (id != files.id) {
    throw base::Error(fmt::format("{}: is of the cell '{}', expected that of its directory, '{}'",
                                  (root / "cell.json").string(), id, files.id));
  }
  const bool is_training = base::Exists(root / "training.toml");
  if (is_training) files.Add("training.toml", base::ReadFile(root / "training.toml"));
  for (const std::string& digest : DigestsIn(root)) {
    AddScore(files, digest, base::ReadFile(root / "scores" / (digest + ".toml")));
  }
  if (base::Exists(root / "run/metrics.csv")) {
    files.Add("run/metrics.csv", base::ReadFile(root / "run/metrics.csv"));
  }
  AddIfThere(files, "scored.json");
  if (is_training) files.Add("trained.json", ReadJson(root / "trained.json"));
  return files;
}

/// The outcomes of an evaluation, apart from who made them and when.
std::string ResultsOf(std::string_view text, const std::string& source) {
  std::string results;
  for (const eval::ResultCourse& course : eval::ParseResult(text, source).result.courses) {
    results += course.name;
    for (const eval::ResultEpisode& episode : course.episodes) {
      results += fmt::format(" {} {} {}", env::ToString(episode.outcome), episode.time,
                             episode.num_collisions);
    }
    results += "\n";
  }
  return results;
}

/// Throws if the target has another result for one of the scores.
void RequireSame(const CellFiles& cell, const fs::path& target) {
  for (const auto& [path, text] : cell.files) {
    if (path.filename() != eval::kEvaluationFile) continue;
    const fs::path there = target / path;
    if (!base::Exists(there)) continue;
    if (ResultsOf(text, (cell.root / path).string()) ==
        ResultsOf(base::ReadFile(there), there.string())) {
      continue;
    }
    throw base::Error(fmt::format(
        "cell {}: {} and {} are results of the same cell and differ, expected the same; remove one "
        "of the two cells",
        cell.id, (cell.root / path).string(), there.string()));
  }
}

/// Writes what the target does not have. Returns whether there was anything.
bool Put(const CellFiles& cell, const fs::path& target) {
  bool is_new = false;
  for (const auto& [path, text] : cell.files) {
    if (base::Exists(target / path)) continue;
    base::MakeDirectories((target / path).parent_path());
    base::WriteFileAtomically(target / path, text);
    is_new = true;
  }
  return is_new;
}

/// Writes cells below a directory, each into the one of its id.
void PutAll(const std::vector<CellFiles>& cells, const fs::path& directory, Copied& copied) {
  for (const CellFiles& cell : cells) RequireSame(cell, directory / cell.id);
  for (const CellFiles& cell : cells) {
    const fs::path target = directory / cell.id;
    if (base::Exists(run::RunDirectory{target / "run"}.policy())) {
      ++copied.num_same;
    } else if (IsClaimed(target)) {
      ++copied.num_busy;
    } else {
      ++(Put(cell, target) ? copied.num_new : copied.num_same);
    }
  }
}

}  // namespace

Copied ExportCells(const fs::path& store, const std::vector<Cell>& cells, const fs::path& archive) {
  Copied copied;
  std::vector<CellFiles> done;
  for (const Cell& cell : cells) {
    if (IsDone(store, cell)) {
      done.push_back(ReadFinished(store, cell));
    } else {
      ++copied.num_left;
    }
  }
  PutAll(done, archive, copied);
  return copied;
}

Copied ImportCells(const fs::path& archive, const fs::path& store,
                   const std::optional<std::vector<Cell>>& cells) {
  if (!fs::is_directory(archive)) {
    throw base::Error(
        fmt::format("{}: there is no such directory, expected one that `slalom sweep export` wrote",
                    archive.string()));
  }
  Copied copied;
  std::vector<CellFiles> found;
  std::vector<fs::path> roots = base::ListDirectory(archive);
  std::ranges::sort(roots);
  for (const fs::path& root : roots) {
    if (!fs::is_directory(root)) continue;
    const std::string id = root.filename().string();
    if (cells && std::ranges::find(*cells, id, &Cell::id) == cells->end()) {
      ++copied.num_left;
    } else {
      found.push_back(ReadArchived(root));
    }
  }
  PutAll(found, store / "cells", copied);
  return copied;
}

}  // namespace slalom::sweep
