#include "app/sweep/store.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <vector>

#include "app/sweep/claim.h"
#include "app/train/resolved_run.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json.h"
#include "base/log.h"
#include "eval/report/result.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

/// The object in a file; none: it is not there, or not whole.
std::optional<OrderedJson> ReadObject(const fs::path& path) {
  std::ifstream file(path);
  if (!file) return std::nullopt;
  OrderedJson json = OrderedJson::parse(file, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  return json;
}

void WriteObject(const fs::path& path, const OrderedJson& object) {
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
      const OrderedJson& stages = json->at("stages");
      trained.stages = {.steps = base::WholeNumber(stages.at("steps")),
                        .updates = base::WholeNumber(stages.at("updates")),
                        .training_s = stages.at("training_s")};
    }
    trained.wall_s = json->at("wall_s");
    trained.host = json->at("host");
    trained.platform = json->at("platform");
    trained.commit = json->at("commit");
    trained.at_once = static_cast<int>(base::WholeNumber(json->at("at_once")));
  } catch (const OrderedJson::exception&) {
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
  } catch (const OrderedJson::exception&) {
    return std::nullopt;
  }
}

std::optional<CellFailure> ReadFailure(const fs::path& path) {
  const auto json = ReadObject(path);
  if (!json) return std::nullopt;
  try {
    return CellFailure{.what = json->at("what"), .log = json->at("log")};
  } catch (const OrderedJson::exception&) {
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
  constexpr std::array<std::string_view, 5> kNames = {"waiting", "training", "scoring", "done",
                                                      "failed"};
  return kNames.at(static_cast<std::size_t>(state));
}

void WriteTrained(const CellDirectory& directory, const TrainedCell& trained) {
  OrderedJson json = {{"steps", trained.steps}, {"updates", trained.updates}};
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
  const OrderedJson json = {{"what", failure.what}, {"log", failure.log}};
  base::WriteFileAtomically(directory.failed(),
                            json.dump(2, ' ', false, OrderedJson::error_handler_t::replace) + "\n");
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

namespace {

/// The content of the file sweep.json. Empty if there is none or it is damaged.
struct Record {
  std::string platform;
  std::string commit;
  std::vector<std::string> cells;
};

fs::path PlanRecordFile(const fs::path& store, const Plan& plan) {
  return PlanDirectory(store, plan.sweep.name) / "sweep.json";
}

Record ReadPlanRecord(const fs::path& path) {
  std::ifstream file(path);
  const auto json = nlohmann::json::parse(file, nullptr, false);
  if (!json.is_object()) return {};
  try {
    return {json.at("platform"), json.at("commit"), json.at("cells")};
  } catch (const nlohmann::json::exception&) {
    return {};
  }
}

}  // namespace

void BeginPlan(const fs::path& store, const Plan& plan, const Cells& cells,
               const train::Platform& platform, const std::string& commit,
               std::chrono::seconds patience) {
  const fs::path file = PlanRecordFile(store, plan);
  const Record last = ReadPlanRecord(file);
  const std::string here = train::Describe(platform);
  const bool is_other_version = !last.commit.empty() && last.commit != commit;
  const bool is_other_platform =
      !last.platform.empty() && last.platform != here && !plan.sweep.mixed_platforms;
  if (is_other_version || is_other_platform) {
    std::vector<fs::path> claimed;
    for (const std::string& id : last.cells) {
      const fs::path cell = CellDirectory(store, id).root();
      if (IsClaimed(cell)) claimed.push_back(cell);
    }
    if (!claimed.empty()) {
      spdlog::info("claims of {} cells may be of dead workers; looking for at most {} s",
                   claimed.size(), patience.count());
    }
    if (AreWorkedOn(claimed, patience)) {
      base::ThrowIf(
          is_other_version,
          "{}: a worker of version {} works on this sweep, and this is version {}; expected the "
          "same program everywhere",
          file.string(), last.commit, commit);
      throw base::Error(
          "{}: a worker on another kind of machine works on this sweep ({}, here {}), and results "
          "would differ in their last bits; set sweep.mixed_platforms = true to allow it, or "
          "OPENBLAS_CORETYPE to the same kernel everywhere",
          file.string(), last.platform, here);
    }
  }
  if (const int num_stale = CountStale(store, plan, cells); num_stale > 0) {
    spdlog::info("{} cells of the last run are stale: they stay in {} and no longer count",
                 num_stale, (store / "cells").string());
  }
  std::vector<std::string> ids;
  for (const Cell& cell : cells.cells) ids.push_back(cell.id);
  base::MakeDirectories(file.parent_path());
  Plan copy = plan;
  base::WriteFileAtomically(file.parent_path() / "plan.toml",
                            config::PrintToml(config::ListFields(copy)));
  const nlohmann::ordered_json json = {
      {"plan", fs::absolute(plan.file).lexically_normal().string()},
      {"platform", here},
      {"commit", commit},
      {"cells", ids}};
  base::WriteFileAtomically(file, json.dump(2) + "\n");
}

int CountStale(const fs::path& store, const Plan& plan, const Cells& cells) {
  const Record last = ReadPlanRecord(PlanRecordFile(store, plan));
  return static_cast<int>(std::ranges::count_if(last.cells, [&](const std::string& id) {
    return std::ranges::find(cells.cells, id, &Cell::id) == cells.cells.end();
  }));
}

}  // namespace slalom::sweep
