#include <fmt/format.h>
#include <fmt/ranges.h>

#include "metrics/catalogue.h"
#include "metrics/learning_figures.h"

namespace slalom::metrics {
namespace {

constexpr std::string_view kHead =
    "# Metrics\n\n"
    "Every metric that a role shows to Prometheus. `./slalom metrics docs > docs/metrics.md` makes "
    "this page from the\n"
    "list in the code (`metrics/catalogue.h`); a test checks that it is up to date.\n\n"
    "Each role answers `GET /metrics` on its own address (`service.metrics`; for a sweep that of "
    "`slalom sweep serve`,\n"
    "for a training in one process that of `slalom train --metrics`). operations.md says how to "
    "set "
    "up Prometheus and\n"
    "Grafana. Every metric has the labels `run` (`run.name` of the config; the sweep's name), "
    "`role` (actor, replay,\n"
    "learner, evaluator, sweep, train) and `name` (of the "
    "process; the same after a\n"
    "restart), besides those in the column \"labels\". Units are seconds, bytes and plain ratios "
    "(0 to 1). Names begin with\n"
    "`slalom_`, except for those with `process_`, which Prometheus calls the same in every "
    "program. Counters that are kept\n"
    "on disk continue after a restart; the others begin at 0 again, which `rate()` expects.\n";

std::string Buckets(const Spec& spec) {
  if (spec.buckets.empty()) return "";
  return fmt::format(" Buckets from {} to {} s.", spec.buckets.front(), spec.buckets.back());
}

std::vector<const Spec*> Learning() {
  std::vector<const Spec*> specs = {&kUpdates, &kUpdateSeconds};
  for (const Spec& spec : LearningSpecs()) specs.push_back(&spec);
  return specs;
}

}  // namespace

std::span<const CatalogueSection> Catalogue() {
  static const std::vector<CatalogueSection> sections = {
      {"Environments and episodes",
       {&kEnvironmentSteps, &kEpisodes, &kSuccessRate, &kCollisionRate, &kEpisodeReturn,
        &kEpisodeSteps, &kEnvironments}},
      {"Accounting of steps", {&kStepsAcknowledged, &kStepsLost, &kStepsPending, &kStepsAccepted}},
      {"Chunks on their way",
       {&kChunksSent, &kChunksResent, &kChunksAcknowledged, &kChunksAccepted, &kChunksDuplicate,
        &kChunksRejected, &kStepsSent, &kStepsResent, &kStepsDuplicate, &kStepsRejected}},
      {"Queues", {&kQueueDepth, &kQueueBytes, &kQueueLimitBytes, &kBlockedSeconds}},
      {"Replay table",
       {&kTableRows, &kTableSteps, &kTableCapacityRows, &kTableBytes, &kBatches, &kSamples,
        &kSampleSeconds, &kInsertSeconds, &kSamplesPerInsert, &kSamplesPerInsertTarget,
        &kPrioritiesUpdated, &kPrioritiesStale}},
      {"Journal of the replay server",
       {&kJournalBytes, &kJournalSegments, &kJournalWrittenBytes, &kJournalSyncSeconds,
        &kJournalSyncTimestamp, &kJournalFailing, &kJournalErrors, &kJournalRecoveredSteps,
        &kJournalDamagedSteps}},
      {"Sessions and connections",
       {&kSessions, &kSessionsStarted, &kReconnections, &kEpisodesCut, &kConnectedPeers,
        &kConnections, &kRejectedConnections, &kMessages, &kMessagesMalformed, &kMessagesRefused}},
      {"Learning", Learning()},
      {"Policies",
       {&kPolicyVersion, &kPolicyTimestamp, &kPolicyLag, &kReaderLag, &kPoliciesPublished,
        &kPoliciesReceived, &kPolicyBytes, &kPublishToActing}},
      {"Checkpoints of the learner",
       {&kCheckpoints, &kCheckpointFailures, &kCheckpointTimestamp, &kCheckpointSeconds,
        &kCheckpointBytes, &kCheckpointUpdates, &kRunFinished}},
      {"Evaluation",
       {&kEvaluations, &kEvaluationVersion, &kEvaluationSuccessRate, &kEvaluationCollisionRate,
        &kEvaluationTimeoutRate, &kEvaluationTime, &kEvaluationScore, &kEvaluationDuration}},
      {"Sweeps",
       {&kSweepCells, &kSweepScores, &kSweepScoresDone, &kSweepCellState, &kSweepFailed,
        &kSweepSteps, &kSweepUpdates, &kSweepTrainingSeconds, &kSweepTrainingSuccessRate,
        &kSweepTrainingCourses, &kSweepSuccessRate, &kSweepCollisionRate}},
      {"Processes",
       {&kBuildInfo, &kBlasInfo, &kRestarts, &kProcessResidentBytes, &kProcessVirtualBytes,
        &kProcessCpuSeconds, &kProcessStartTime, &kProcessThreads, &kProcessOpenDescriptors,
        &kProcessMaxDescriptors}},
  };
  return sections;
}

std::string PrintMarkdown() {
  std::string page(kHead);
  for (const CatalogueSection& section : Catalogue()) {
    page += fmt::format("\n## {}\n\n", section.title);
    page += "| metric | type | labels | shown by | meaning |\n|---|---|---|---|---|\n";
    for (const Spec* spec : section.specs) {
      page += fmt::format("| `{}` | {} | {} | {} | {}{} |\n", spec->name, ToString(spec->type),
                          fmt::join(spec->labels, ", "), spec->roles, spec->help, Buckets(*spec));
    }
  }
  return page;
}

}  // namespace slalom::metrics
