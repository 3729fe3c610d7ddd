#include "app/sweep/store.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "app/sweep/claim.h"
#include "app/train/resolved_run.h"
#include "base/file.h"
#include "base/json.h"
#include "eval/report/result.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// The object in a file; none: it is not there, or not whole.
std::optional<Json> ReadObject(const fs::path& path) {
  std::ifstream file(path);
  if (!file) return std::nullopt;
  Json json = Json::parse(file, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  return json;
}

void WriteObject(const fs::path& path, const Json& object) {
  base::WriteFileAtomically(path, object.dump(2) + "\n");
}

std::optional<TrainedCell> ReadTrained(const fs::path& path) {
  const auto json = ReadObject(path);
  if (!json) return std::nullopt;
  TrainedCell trained;
  try {
    trained.steps = base::WholeNumber(json->at("steps"));
    trained.updates = base::WholeNumber(json->at("updates"));
    if (json->contains("imagined")) trained.imagined = base::WholeNumber(json->at("imagined"));
    trained.training_s = json->at("training_s");
    if (json->contains("stages")) {
      const Json& stages = json->at("stages");
      trained.stages = {.steps = base::WholeNumber(stages.at("steps")),
                        .updates = base::WholeNumber(stages.at("updates")),
                        .training_s = stages.at("training_s")};
    }
    trained.wall_s = json->at("wall_s");
    trained.host = json->at("host");
    trained.platform = json->at("platform");
    trained.commit = json->at("commit");
    trained.at_once = static_cast<int>(base::WholeNumber(json->at("at_once")));
  } catch (const Json::exception&) {
    return std::nullopt;
  }
  return trained;
}

std::optional<ScoredCell> ReadScored(const fs::path& path) {
  const auto json = ReadObject(path);
  if (!json) return std::nullopt;
  try {
    return ScoredCell{.wall_s = json->at("wall_s"),
                      .episodes = base::WholeNumber(json->at("episodes"))};
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

std::optional<CellFailure> ReadFailure(const fs::path& path) {
  const auto json = ReadObject(path);
  if (!json) return std::nullopt;
  try {
    return CellFailure{.what = json->at("what"), .log = json->at("log")};
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

/// The steps of a run and its stages so far.
std::int64_t StepsSoFar(const train::ResolvedRun& config, const fs::path& directory) {
  std::int64_t sum = 0;
  for (const fs::path& run : train::RunsOf(config, directory)) {
    const double steps = run::ReadLastMetrics(run::RunDirectory{run}.metrics()).Last("steps");
    if (steps > 0.0) sum += static_cast<std::int64_t>(steps);
  }
  return sum;
}

}  // namespace

std::string_view ToString(CellState state) {
  switch (state) {
    case CellState::kWaiting:
      return "waiting";
    case CellState::kTraining:
      return "training";
    case CellState::kScoring:
      return "scoring";
    case CellState::kDone:
      return "done";
    case CellState::kFailed:
      return "failed";
  }
  return "";
}

void WriteTrained(const CellDirectory& directory, const TrainedCell& trained) {
  Json json = {{"steps", trained.steps}, {"updates", trained.updates}};
  if (trained.imagined) json["imagined"] = *trained.imagined;
  json.update({{"training_s", trained.training_s},
               {"wall_s", trained.wall_s},
               {"host", trained.host},
               {"platform", trained.platform},
               {"commit", trained.commit},
               {"at_once", trained.at_once}});
  if (trained.stages.steps > 0) {
    json["stages"] = {{"steps", trained.stages.steps},
                      {"updates", trained.stages.updates},
                      {"training_s", trained.stages.training_s}};
  }
  WriteObject(directory.trained(), json);
}

void WriteScored(const CellDirectory& directory, const ScoredCell& scored) {
  WriteObject(directory.scored(), {{"wall_s", scored.wall_s}, {"episodes", scored.episodes}});
}

void WriteFailure(const CellDirectory& directory, const CellFailure& failure) {
  // A program may have printed bytes that are not UTF-8.
  const Json json = {{"what", failure.what}, {"log", failure.log}};
  base::WriteFileAtomically(directory.failed(),
                            json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

CellStatus ReadCellStatus(const fs::path& store, const Cell& cell) {
  const CellDirectory directory(store, cell.id);
  CellStatus status;
  status.trained = ReadTrained(directory.trained());
  status.scored = ReadScored(directory.scored());
  status.failure = ReadFailure(directory.failed());
  for (const ScoreTask& task : cell.scores) {
    if (IsScored(store, cell, task)) ++status.num_scores_done;
  }
  if (status.trained) {
    status.steps = status.trained->total().steps;
  } else if (cell.config) {
    status.steps = StepsSoFar(*cell.config, directory.run());
  }
  const bool is_trained = status.trained || !cell.config;
  if (is_trained && status.num_scores_done == static_cast<int>(cell.scores.size())) {
    status.state = CellState::kDone;
  } else if (IsClaimed(directory.root())) {
    status.state = is_trained ? CellState::kScoring : CellState::kTraining;
  } else if (status.failure) {
    status.state = CellState::kFailed;
  }
  return status;
}

bool IsScored(const fs::path& store, const Cell& cell, const ScoreTask& task) {
  std::error_code ec;
  return fs::exists(CellDirectory(store, cell.id).score(task) / eval::kEvaluationFile, ec);
}

bool IsDone(const fs::path& store, const Cell& cell) {
  std::error_code ec;
  const CellDirectory directory(store, cell.id);
  if (cell.config && !fs::exists(directory.trained(), ec)) return false;
  return std::ranges::all_of(cell.scores,
                             [&](const ScoreTask& task) { return IsScored(store, cell, task); });
}

bool LacksPolicy(const fs::path& store, const Cell& cell) {
  const CellDirectory directory(store, cell.id);
  return cell.config && base::Exists(directory.trained()) &&
         !base::Exists(run::RunDirectory{directory.run()}.policy());
}

fs::path PlanDirectory(const fs::path& store, const std::string& name) {
  return store / "plans" / name;
}

}  // namespace slalom::sweep
