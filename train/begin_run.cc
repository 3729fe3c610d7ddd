#include "train/begin_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "config/config.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 17> kMayChange = {"run.max_steps",
                                                         "run.max_seconds",
                                                         "run.log_interval",
                                                         "run.checkpoint_seconds",
                                                         "run.checkpoint_steps",
                                                         "run.snapshot_seconds",
                                                         "run.snapshot_steps",
                                                         "run.simulation_threads",
                                                         "run.keep_checkpoints",
                                                         "courses.test",
                                                         "evaluation.",
                                                         "service.",
                                                         "security.",
                                                         "replay_server.",
                                                         "learner_service.",
                                                         "actor_service.",
                                                         "evaluator_service."};

bool MayChange(std::string_view key) {
  return std::any_of(kMayChange.begin(), kMayChange.end(), [key](std::string_view allowed) {
    return allowed.ends_with('.') ? key.starts_with(allowed) : key == allowed;
  });
}

void WriteConfig(const run::RunDirectory& directory, const RunConfig& config) {
  base::WriteFileAtomically(directory.config(), config::ToToml(config));
}

}  // namespace

run::RunLock BeginRun(const run::RunDirectory& directory, const RunConfig& config) {
  if (fs::exists(directory.config())) {
    const run::RunLock earlier(directory.root);
    fs::path aside;
    for (int i = 1; aside.empty() || fs::exists(aside); ++i) {
      aside = fmt::format("{}.{}", directory.root.string(), i);
    }
    std::error_code ec;
    fs::rename(directory.root, aside, ec);
    if (ec) {
      throw base::Error(fmt::format("{}: cannot move the earlier run to {} ({})",
                                    directory.root.string(), aside.string(), ec.message()));
    }
    spdlog::info("the earlier run is now {}", aside.string());
  }
  base::MakeDirectories(directory.root);
  run::RunLock lock(directory.root);
  WriteConfig(directory, config);
  return lock;
}

run::RunLock ResumeRun(const run::RunDirectory& directory, const RunConfig& config) {
  if (!fs::exists(directory.config())) {
    throw base::Error(fmt::format("{}: there is no run to resume here", directory.root.string()));
  }
  run::RunLock lock(directory.root);
  RequireResumable(base::ReadFile(directory.config()), directory.config().string(), config);
  WriteConfig(directory, config);
  return lock;
}

void RequireResumable(const std::string& earlier, const std::string& source,
                      const RunConfig& config) {
  auto was_config = config::FromToml<RunConfig>(earlier, source);
  RunConfig given = config;
  const auto old_fields = config::ListFields(was_config).fields;
  const auto new_fields = config::ListFields(given).fields;
  for (std::size_t i = 0; i < new_fields.size(); ++i) {
    const std::string was = config::PrintValue(old_fields[i]);
    const std::string is = config::PrintValue(new_fields[i]);
    if (was != is && !MayChange(new_fields[i].key)) {
      throw base::Error(
          fmt::format("{}: {} was {} when the run began and is {} now; a resumed run must keep it",
                      source, new_fields[i].key, was, is));
    }
  }
}

}  // namespace slalom::train
