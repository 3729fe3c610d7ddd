#include "learner/service/learner_service.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>

#include "base/log.h"
#include "base/progress.h"
#include "base/random.h"
#include "replay/scan_mirror.h"

namespace slalom::learner {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kServeWait{100};

proto::Hello MakeHello(const LearnerJob& job, const policy::PolicySpec& spec) {
  proto::Hello hello;
  hello.role = "learner";
  hello.name = job.name;
  hello.spec_hash = job.spec_hash;
  hello.num_beams = spec.observation.num_beams;
  hello.run = job.run;
  return hello;
}

/// Places of the mirror of one replay server, of which the job has several.
std::int64_t MirrorPlaces(const LearnerServiceConfig& config, const LearnerJob& job,
                          const env::StepShape& shape) {
  if (shape.num_beams == 0) return 0;
  const auto scan_bytes = static_cast<std::int64_t>(sizeof(std::uint16_t)) * shape.num_beams;
  const auto num_servers = static_cast<std::int64_t>(job.replay.size());
  const std::int64_t places = std::min(
      {config.mirror_bytes / num_servers / scan_bytes, job.table_rows, replay::kMaxMirrorPlaces});
  spdlog::info("keeps up to {} of the scans that come, in {} MiB", num_servers * places,
               (num_servers * places * scan_bytes) >> 20);
  return places;
}

LoopPlan MakePlan(LoopPlan plan, const LearnerServiceConfig& config) {
  plan.run.settings.deterministic = false;  // Several processes never are; they go by the clock.
  plan.publish_seconds = config.publish_seconds;
  // Actors run ahead, and after a kill the learner is behind its batches of before.
  plan.makes_all_updates = true;
  plan.lives_on = !config.exit_when_finished;
  // The replay server counts the steps, which go back if it loses some.
  plan.numbers_by_updates = true;
  return plan;
}

}  // namespace

LearnerService::LearnerService(const LearnerServiceConfig& config, const MethodConfig& method,
                               const policy::PolicySpec& spec, LearnerJob job,
                               transport::Context& context, metrics::Registry& registry,
                               run::TrainingClock clock)
    : config_(config),
      learner_(method, spec,
               base::DeriveSeed(static_cast<std::uint64_t>(job.loop.run.settings.seed), "learner"),
               job.first),
      policies_(context, job.policies, job.spec_hash, job.run, registry),
      source_(context, job.replay, MakeHello(job, spec), spec.step_shape(), learner_.sample_specs(),
              config.prefetch, MirrorPlaces(config, job, spec.step_shape()), policies_, registry),
      loop_(MakePlan(std::move(job.loop), config), learner_, source_, policies_, registry,
            std::move(clock)) {
  loop_.Restore();
  source_.Start();
  loop_.Publish();
}

TrainingEnd LearnerService::Run(std::stop_token stop) {
  const TrainingEnd end = loop_.Run(stop);
  const bool is_over =
      end == TrainingEnd::kStopped || end == TrainingEnd::kUnsaved || end == TrainingEnd::kDiverged;
  if (end == TrainingEnd::kStopped) {
    spdlog::info("stopped and saved: {} steps, {} updates; started again, it goes on there",
                 base::FormatCount(static_cast<double>(loop_.run().steps())),
                 base::FormatCount(static_cast<double>(loop_.run().updates())));
  }
  if (is_over) return end;
  loop_.Publish();
  const run::TrainingRun& run = loop_.run();
  spdlog::info("trained for {}: {} steps, {} updates; policy: {}",
               base::FormatDuration(run.training_s()),
               base::FormatCount(static_cast<double>(run.steps())),
               base::FormatCount(static_cast<double>(run.updates())),
               end == TrainingEnd::kLearnedNothing ? "none, as nothing was learned"
                                                   : run.plan().directory.policy().string());
  if (const std::string fault = run.watch().fault(); !fault.empty()) {
    spdlog::warn("the run may have learned nothing: {}", fault);
  }
  if (config_.exit_when_finished) return end;
  Serve(stop);
  return end;
}

void LearnerService::Serve(std::stop_token stop) {
  while (!stop.stop_requested()) {
    policies_.Poll(kServeWait);
    source_.Idle();
    loop_.ReportIfDue();
  }
}

}  // namespace slalom::learner
