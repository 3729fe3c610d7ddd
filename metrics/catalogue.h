#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "metrics/registry.h"

/// Every metric that exists. docs/metrics.md, which `slalom metrics docs` prints from this list,
/// says what each metric is, which roles show it and what its labels hold.

namespace slalom::metrics {

// Environments and episodes
extern const Spec kEnvironmentSteps;
extern const Spec kEpisodes;
extern const Spec kSuccessRate;
extern const Spec kCollisionRate;
extern const Spec kEpisodeReturn;
extern const Spec kEpisodeSteps;
extern const Spec kEnvironments;

// Accounting of steps
extern const Spec kStepsAcknowledged;
extern const Spec kStepsLost;
extern const Spec kStepsPending;
extern const Spec kStepsAccepted;

// Chunks on their way
extern const Spec kChunksSent;
extern const Spec kChunksResent;
extern const Spec kChunksAcknowledged;
extern const Spec kChunksAccepted;
extern const Spec kChunksDuplicate;
extern const Spec kChunksRejected;
extern const Spec kStepsSent;
extern const Spec kStepsResent;
extern const Spec kStepsDuplicate;
extern const Spec kStepsRejected;

// Queues
extern const Spec kQueueDepth;
extern const Spec kQueueBytes;
extern const Spec kQueueLimitBytes;
extern const Spec kBlockedSeconds;

// Replay table
extern const Spec kTableRows;
extern const Spec kTableSteps;
extern const Spec kTableCapacityRows;
extern const Spec kTableBytes;
extern const Spec kBatches;
extern const Spec kSamples;
extern const Spec kSampleSeconds;
extern const Spec kInsertSeconds;
extern const Spec kSamplesPerInsert;
extern const Spec kSamplesPerInsertTarget;
extern const Spec kPrioritiesUpdated;
extern const Spec kPrioritiesStale;

// Journal of the replay server
extern const Spec kJournalBytes;
extern const Spec kJournalSegments;
extern const Spec kJournalWrittenBytes;
extern const Spec kJournalSyncSeconds;
extern const Spec kJournalSyncTimestamp;
extern const Spec kJournalFailing;
extern const Spec kJournalErrors;
extern const Spec kJournalRecoveredSteps;
extern const Spec kJournalDamagedSteps;

// Sessions and connections
extern const Spec kSessions;
extern const Spec kSessionsStarted;
extern const Spec kReconnections;
extern const Spec kEpisodesCut;
extern const Spec kConnectedPeers;
extern const Spec kConnections;
extern const Spec kRejectedConnections;
extern const Spec kMessages;
extern const Spec kMessagesMalformed;
extern const Spec kMessagesRefused;

// Learning. metrics/learning_figures.h has the learner's figures.
extern const Spec kUpdates;
extern const Spec kUpdateSeconds;

// Policies
extern const Spec kPolicyVersion;
extern const Spec kPolicyTimestamp;
extern const Spec kPolicyLag;
extern const Spec kReaderLag;
extern const Spec kPoliciesPublished;
extern const Spec kPoliciesReceived;
extern const Spec kPolicyBytes;
extern const Spec kPublishToActing;

// Checkpoints of the learner
extern const Spec kCheckpoints;
extern const Spec kCheckpointFailures;
extern const Spec kCheckpointTimestamp;
extern const Spec kCheckpointSeconds;
extern const Spec kCheckpointBytes;
extern const Spec kCheckpointUpdates;
extern const Spec kRunFinished;

// Evaluation
extern const Spec kEvaluations;
extern const Spec kEvaluationVersion;
extern const Spec kEvaluationSuccessRate;
extern const Spec kEvaluationCollisionRate;
extern const Spec kEvaluationTimeoutRate;
extern const Spec kEvaluationTime;
extern const Spec kEvaluationScore;
extern const Spec kEvaluationDuration;

// Sweeps. All but the first three are of a cell; metrics/catalogue_sweep.cc has their labels.
extern const Spec kSweepCells;
extern const Spec kSweepScores;
extern const Spec kSweepScoresDone;
extern const Spec kSweepCellState;
extern const Spec kSweepFailed;
extern const Spec kSweepSteps;
extern const Spec kSweepUpdates;
extern const Spec kSweepTrainingSeconds;
extern const Spec kSweepTrainingSuccessRate;
extern const Spec kSweepTrainingCourses;
extern const Spec kSweepSuccessRate;
extern const Spec kSweepCollisionRate;

// Processes
extern const Spec kBuildInfo;
extern const Spec kBlasInfo;
extern const Spec kRestarts;
extern const Spec kProcessResidentBytes;
extern const Spec kProcessVirtualBytes;
extern const Spec kProcessCpuSeconds;
extern const Spec kProcessStartTime;
extern const Spec kProcessThreads;
extern const Spec kProcessOpenDescriptors;
extern const Spec kProcessMaxDescriptors;

/// Label values that several roles must spell alike.
namespace queue {
inline constexpr std::string_view kUnacknowledged = "unacknowledged";  ///< Chunks of an actor.
inline constexpr std::string_view kInserts = "inserts";  ///< Chunks held by the rate limiter.
inline constexpr std::string_view kSamples = "samples";  ///< Requests held by the rate limiter.
inline constexpr std::string_view kJournal = "journal";  ///< Chunks not yet written.
inline constexpr std::string_view kBatches = "batches";  ///< Prefetched by the learner.
}  // namespace queue

/// A group of metrics and its title on the page.
struct CatalogueSection {
  std::string_view title;
  std::vector<const Spec*> specs;
};
/// Returns all sections in the order of the page.
std::span<const CatalogueSection> Catalogue();

/// The text of docs/metrics.md.
std::string PrintMarkdown();

}  // namespace slalom::metrics
