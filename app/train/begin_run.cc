#include "app/train/begin_run.h"

#include <fmt/format.h>

#include "app/train/inputs.h"
#include "app/train/run_identity.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

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
      throw base::Error("{}: cannot move the earlier run to {} ({})", directory.root.string(),
                        aside.string(), ec.message());
    }
    spdlog::info("the earlier run is now {}", aside.string());
  }
  base::MakeDirectories(directory.root);
  run::RunLock lock(directory.root);
  WriteConfig(directory, config);
  return lock;
}

run::RunLock ResumeRun(const run::RunDirectory& directory, const RunConfig& config) {
  base::ThrowIf(!fs::exists(directory.config()), "{}: there is no run to resume here",
                directory.root.string());
  run::RunLock lock(directory.root);
  base::RemoveUnfinishedFiles(directory.root);
  const std::string source = directory.config().string();
  const std::string earlier = base::ReadFile(directory.config());
  RequireResumable(earlier, source, config);
  const run::RunSettings& was = ReadRecordedConfig(earlier, source).run;
  if (config.method.learner.final_learning_rate_fraction != 1.0 &&
      (was.max_steps != config.run.max_steps || was.max_seconds != config.run.max_seconds)) {
    spdlog::info(
        "{}: the limit is another than before, and the learning rates follow the share of it that "
        "is done (docs/operations.md)",
        directory.root.string());
  }
  WriteConfig(directory, config);
  return lock;
}

run::RunLock BeginTraining(const run::RunDirectory& directory, const ResolvedRun& config,
                           bool resume) {
  const Inputs inputs = ReadInputs(config);  // They may lie in a run that is moved aside.
  run::RunLock lock = resume ? ResumeRun(directory, config) : BeginRun(directory, config);
  WriteInputs(inputs, directory.inputs());
  return lock;
}

void RequireResumable(const std::string& earlier, const std::string& source,
                      const RunConfig& config) {
  const auto difference = FindDifference(ReadRecordedConfig(earlier, source), config);
  if (difference.key.empty()) return;
  throw base::Error("{}: {} was {} when the run began and is {} now; a resumed run must keep it",
                    source, difference.key, difference.first, difference.second);
}

}  // namespace slalom::train
