#include "app/sweep/plan_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "app/sweep/claim.h"
#include "app/sweep/store.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

/// The content of the file sweep.json. Empty if there is none or it is damaged.
struct Record {
  std::string platform;
  std::string commit;
  std::vector<std::string> cells;
};

fs::path RecordFile(const fs::path& store, const Plan& plan) {
  return PlanDirectory(store, plan.sweep.name) / "sweep.json";
}

Record ReadRecord(const fs::path& path) {
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
  const fs::path file = RecordFile(store, plan);
  const Record last = ReadRecord(file);
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
      if (is_other_version) {
        throw base::Error(fmt::format(
            "{}: a worker of version {} works on this sweep, and this is version {}; expected the "
            "same program everywhere",
            file.string(), last.commit, commit));
      }
      throw base::Error(fmt::format(
          "{}: a worker on another kind of machine works on this sweep ({}, here {}), and results "
          "would differ in their last bits; set sweep.mixed_platforms = true to allow it, or "
          "OPENBLAS_CORETYPE to the same kernel everywhere",
          file.string(), last.platform, here));
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
  const Record last = ReadRecord(RecordFile(store, plan));
  return static_cast<int>(std::ranges::count_if(last.cells, [&](const std::string& id) {
    return std::ranges::find(cells.cells, id, &Cell::id) == cells.cells.end();
  }));
}

}  // namespace slalom::sweep
