#include "metrics/catalogue.h"

namespace slalom::metrics {
namespace {

// Upper bounds of what takes from a tenth of a millisecond to a minute, [s].
const std::vector<double> kWait = {0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05,
                                   0.1,    0.2,    0.5,    1.0,   2.0,   5.0,   10.0, 30.0, 60.0};
// The same, closer around 50 ms, which publishing is to stay below.
const std::vector<double> kLatency = {0.001, 0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05,
                                      0.075, 0.1,   0.2,   0.5,  1.0,   2.0,  5.0,  10.0, 60.0};

Spec CounterOf(std::string_view name, std::string_view roles, std::string_view help,
               std::vector<std::string_view> labels = {}) {
  return {name, Type::kCounter, roles, help, std::move(labels), {}};
}
Spec GaugeOf(std::string_view name, std::string_view roles, std::string_view help,
             std::vector<std::string_view> labels = {}) {
  return {name, Type::kGauge, roles, help, std::move(labels), {}};
}
Spec HistogramOf(std::string_view name, std::string_view roles, std::string_view help,
                 std::vector<double> buckets) {
  return {name, Type::kHistogram, roles, help, {}, std::move(buckets)};
}

}  // namespace

// Environments and episodes
const Spec kEnvironmentSteps = CounterOf(
    "slalom_environment_steps_total", "actor, train",
    "Environment steps made in all sessions of this actor or training, whether acknowledged, "
    "pending or lost.");
const Spec kEpisodes = CounterOf(
    "slalom_episodes_total", "actor",
    "Training episodes that ended, by outcome (success, collision, timeout) and course set.",
    {"outcome", "course_set"});
const Spec kSuccessRate =
    GaugeOf("slalom_success_rate", "actor, train",
            "Share of the most recent training episodes, with exploration noise, that reached the "
            "goal. NaN before the first episode has ended.");
const Spec kCollisionRate =
    GaugeOf("slalom_collision_rate", "actor, train",
            "Share of the most recent training episodes that collided. NaN before the first.");
const Spec kEpisodeReturn =
    GaugeOf("slalom_episode_return", "actor, train",
            "Mean return of the most recent training episodes. NaN before the first.");
const Spec kEpisodeSteps =
    GaugeOf("slalom_episode_steps", "actor, train",
            "Mean steps of the most recent training episodes. NaN before the first.");
const Spec kEnvironments = GaugeOf("slalom_environments", "actor, train",
                                   "Number of environments that the actor steps side by side.");

// Accounting of steps
const Spec kStepsAcknowledged =
    CounterOf("slalom_steps_acknowledged_total", "actor",
              "Environment steps that the replay server acknowledged in all sessions of this "
              "actor. Steps that the server lost later still count.");
const Spec kStepsLost =
    CounterOf("slalom_steps_lost_total", "actor",
              "Environment steps that are not in the table, by reason, in all sessions. killed: "
              "unacknowledged when the actor was killed. replaced: unacknowledged when its session "
              "ended. server: acknowledged by a server that no longer has them.",
              {"reason"});
const Spec kStepsPending =
    GaugeOf("slalom_steps_pending", "actor", "Environment steps made but not yet acknowledged.");
const Spec kStepsAccepted =
    CounterOf("slalom_steps_accepted_total", "replay",
              "Environment steps put into the table and the journal, over all restarts.");

// Chunks on their way
const Spec kChunksSent =
    CounterOf("slalom_chunks_sent_total", "actor", "Chunks sent for the first time.");
const Spec kChunksResent = CounterOf("slalom_chunks_resent_total", "actor",
                                     "Chunks sent again after a reconnection or a refusal.");
const Spec kChunksAcknowledged = CounterOf("slalom_chunks_acknowledged_total", "actor",
                                           "Chunks that the replay server acknowledged.");
const Spec kChunksAccepted =
    CounterOf("slalom_chunks_accepted_total", "replay", "Chunks put into the table.");
const Spec kChunksDuplicate = CounterOf(
    "slalom_chunks_duplicate_total", "replay",
    "Chunks that had been accepted before. They are acknowledged again, but not inserted again.");
const Spec kChunksRejected = CounterOf(
    "slalom_chunks_rejected_total", "actor, replay",
    "Refused chunks, by the reason given in the refusal (bad message, out of order, ...). The "
    "replay server counts the refusals that it sent, the actor those that it received.",
    {"reason"});
const Spec kStepsSent = CounterOf("slalom_steps_sent_total", "actor",
                                  "Environment steps in chunks sent for the first time.");
const Spec kStepsResent =
    CounterOf("slalom_steps_resent_total", "actor", "Environment steps in chunks sent again.");
const Spec kStepsDuplicate =
    CounterOf("slalom_steps_duplicate_total", "replay", "Environment steps in duplicate chunks.");
const Spec kStepsRejected = CounterOf(
    "slalom_steps_rejected_total", "replay",
    "Environment steps in chunks that were refused; an actor may send them again.", {"reason"});

// Queues
const Spec kQueueDepth =
    GaugeOf("slalom_queue_depth", "actor, replay, learner",
            "Items in a queue. Of the actor: unacknowledged (chunks). Of the replay server: "
            "inserts (chunks held), samples (sample requests held), journal (chunks not yet "
            "written). Of the learner: batches (prefetched).",
            {"queue"});
const Spec kQueueBytes =
    GaugeOf("slalom_queue_bytes", "actor, replay", "Bytes in a queue.", {"queue"});
const Spec kQueueLimitBytes =
    GaugeOf("slalom_queue_limit_bytes", "actor, replay", "Bytes that a queue may hold.", {"queue"});
const Spec kBlockedSeconds =
    CounterOf("slalom_blocked_seconds_total", "actor, replay, learner, train",
              "Time for which work waited at a queue. The actor waits at unacknowledged (no room); "
              "the replay server at inserts and samples (held by the rate limiter) and at journal "
              "(the disk); the learner and a training at batches (none has arrived, no step has "
              "earned one).",
              {"queue"});

// Replay table
const Spec kTableRows = GaugeOf("slalom_table_rows", "replay, train", "Rows in the table.");
const Spec kTableSteps =
    GaugeOf("slalom_table_steps", "replay, train", "Environment steps in the table.");
const Spec kTableCapacityRows =
    GaugeOf("slalom_table_capacity_rows", "replay, train", "Rows that the table can hold.");
const Spec kTableBytes =
    GaugeOf("slalom_table_bytes", "replay, train", "Memory that the table takes once it is full.");
const Spec kBatches =
    CounterOf("slalom_batches_total", "replay, learner, train",
              "Batches sampled: granted by the replay server, received by the learner, drawn by a "
              "training.");
const Spec kSamples =
    CounterOf("slalom_samples_total", "replay", "Transitions sampled, over all batches.");
const Spec kSampleSeconds = HistogramOf("slalom_sample_seconds", "replay",
                                        "Time to draw one batch and gather its rows.", kWait);
const Spec kInsertSeconds =
    HistogramOf("slalom_insert_seconds", "replay",
                "Time from a chunk's arrival to its acknowledgement, time held included.", kWait);
const Spec kSamplesPerInsert =
    GaugeOf("slalom_samples_per_insert", "replay",
            "Transitions sampled per environment step after `run.learning_starts`. NaN before.");
const Spec kSamplesPerInsertTarget =
    GaugeOf("slalom_samples_per_insert_target", "replay",
            "The value at which the rate limiter keeps slalom_samples_per_insert: "
            "`run.updates_per_step` times the transitions of a batch.");
const Spec kPrioritiesUpdated =
    CounterOf("slalom_priorities_updated_total", "replay", "Priorities set by the learner.");
const Spec kPrioritiesStale = CounterOf("slalom_priorities_stale_total", "replay",
                                        "Priorities for rows that had left the table.");

// Journal of the replay server
const Spec kJournalBytes =
    GaugeOf("slalom_journal_bytes", "replay", "Bytes of all segments on disk.");
const Spec kJournalSegments = GaugeOf("slalom_journal_segments", "replay", "Segment files.");
const Spec kJournalWrittenBytes =
    CounterOf("slalom_journal_written_bytes_total", "replay", "Bytes written to the journal.");
const Spec kJournalSyncSeconds =
    HistogramOf("slalom_journal_sync_seconds", "replay", "Duration of one fdatasync.", kWait);
const Spec kJournalSyncTimestamp =
    GaugeOf("slalom_journal_sync_timestamp_seconds", "replay",
            "When the last fdatasync ended, in seconds since 1970. Everything acknowledged before "
            "then survives a power failure.");
const Spec kJournalFailing =
    GaugeOf("slalom_journal_failing", "replay",
            "1 while the journal cannot be written or synced, else 0. While it cannot be written, "
            "nothing is acknowledged; while it cannot be synced, what is acknowledged may not "
            "survive a power failure.");
const Spec kJournalErrors =
    CounterOf("slalom_journal_errors_total", "replay", "Failed writes and syncs.");
const Spec kJournalRecoveredSteps =
    GaugeOf("slalom_journal_recovered_steps", "replay",
            "Environment steps that the server read from disk into the table when it started.");
const Spec kJournalDamagedSteps =
    GaugeOf("slalom_journal_damaged_steps", "replay",
            "Acknowledged environment steps lost at this start because files are damaged.");

// Sessions and connections
const Spec kSessions = GaugeOf("slalom_sessions", "replay", "Open sessions of actors.");
const Spec kSessionsStarted = CounterOf("slalom_sessions_started_total", "replay",
                                        "Sessions begun, each by an actor that started.");
const Spec kReconnections =
    CounterOf("slalom_reconnections_total", "replay", "Sessions resumed after a lost connection.");
const Spec kEpisodesCut = CounterOf("slalom_episodes_cut_total", "replay",
                                    "Open episodes cut off because their session ended.");
const Spec kConnectedPeers =
    GaugeOf("slalom_connected_peers", "replay, learner",
            "Peers that were heard from recently, by role (`peer_role`).", {"peer_role"});
const Spec kConnections = CounterOf(
    "slalom_connections_total", "actor, learner, evaluator",
    "Connections made to a server (replay, learner). More than 1: one broke.", {"server"});
const Spec kRejectedConnections = CounterOf(
    "slalom_rejected_connections_total", "replay, learner",
    "Handshakes that failed: the peer had wrong keys or none, or speaks another protocol.");
const Spec kMessages = CounterOf("slalom_messages_total", "replay, learner",
                                 "Messages received, by kind (Hello, Insert, ...).", {"message"});
const Spec kMessagesMalformed = CounterOf("slalom_messages_malformed_total", "replay, learner",
                                          "Messages that lack one of their two parts.");
const Spec kMessagesRefused = CounterOf("slalom_messages_refused_total", "replay, learner",
                                        "Refusals sent, by the reason that they give.", {"reason"});

// Learning
const Spec kUpdates = CounterOf("slalom_updates_total", "learner, train",
                                "Updates of the critics, over all restarts.");
const Spec kUpdateSeconds =
    HistogramOf("slalom_update_seconds", "learner, train",
                "Time of one update, not counting the wait for its batch.", kWait);

// Policies
const Spec kPolicyVersion = GaugeOf(
    "slalom_policy_version", "actor, learner, evaluator",
    "Version of the policy that the learner published last, that the actor drives with, or that "
    "the evaluator received last. A policy's version is the number of updates behind it.");
const Spec kPolicyTimestamp = GaugeOf("slalom_policy_timestamp_seconds", "actor, learner",
                                      "When that policy was published, in seconds since 1970; its "
                                      "age is `time()` minus this. 0: there is none yet.");
const Spec kPolicyLag =
    GaugeOf("slalom_policy_lag_versions", "learner",
            "How many versions the last sampled batch's policies are behind, on average.");
const Spec kReaderLag = GaugeOf("slalom_reader_lag_versions", "learner",
                                "How many versions the oldest connected reader is behind.");
const Spec kPoliciesPublished =
    CounterOf("slalom_policies_published_total", "learner", "Policies published.");
const Spec kPoliciesReceived =
    CounterOf("slalom_policies_received_total", "actor, evaluator", "Policies received.");
const Spec kPolicyBytes = GaugeOf("slalom_policy_bytes", "learner", "Size of the newest policy.");
const Spec kPublishToActing =
    HistogramOf("slalom_publish_to_acting_seconds", "actor",
                "Time from a policy's publication until an actor has installed it and takes its "
                "next action from it. Measured with the clocks of both machines.",
                kLatency);

// Checkpoints of the learner
const Spec kCheckpoints =
    CounterOf("slalom_checkpoints_total", "learner, train", "Checkpoints written.");
const Spec kCheckpointFailures =
    CounterOf("slalom_checkpoint_failures_total", "learner, train",
              "Checkpoints that could not be written. The earlier one is kept.");
const Spec kCheckpointTimestamp =
    GaugeOf("slalom_checkpoint_timestamp_seconds", "learner, train",
            "When the newest checkpoint was written, in seconds since 1970; its age is `time()` "
            "minus this. Before the first checkpoint: when the learner started.");
const Spec kCheckpointSeconds =
    GaugeOf("slalom_checkpoint_seconds", "learner, train", "Time that the last checkpoint took.");
const Spec kCheckpointBytes =
    GaugeOf("slalom_checkpoint_bytes", "learner, train", "Size of the last checkpoint.");
const Spec kCheckpointUpdates =
    GaugeOf("slalom_checkpoint_updates", "learner, train",
            "Updates of the newest checkpoint, where a restart continues.");
const Spec kRunFinished =
    GaugeOf("slalom_run_finished", "learner, train",
            "1 once the run has reached its limit of steps or seconds; all roles then rest.");

// Evaluation
const Spec kEvaluations = CounterOf("slalom_evaluations_total", "evaluator", "Policies scored.");
const Spec kEvaluationVersion = GaugeOf("slalom_evaluation_policy_version", "evaluator",
                                        "Version of the policy that was scored last.");
const Spec kEvaluationSuccessRate = GaugeOf("slalom_evaluation_success_rate", "evaluator",
                                            "Share of the evaluation's episodes on a course set "
                                            "that reached the goal, without exploration noise.",
                                            {"course_set"});
const Spec kEvaluationCollisionRate =
    GaugeOf("slalom_evaluation_collision_rate", "evaluator",
            "Share of the evaluation's episodes that collided.", {"course_set"});
const Spec kEvaluationTimeoutRate =
    GaugeOf("slalom_evaluation_timeout_rate", "evaluator",
            "Share of the evaluation's episodes that ran out of time.", {"course_set"});
const Spec kEvaluationTime =
    GaugeOf("slalom_evaluation_time_seconds", "evaluator",
            "Mean time to the goal in successful episodes. NaN if there is none.", {"course_set"});
const Spec kEvaluationScore = GaugeOf("slalom_evaluation_score", "evaluator",
                                      "Mean BARN score of the episodes, 0 to 0.5.", {"course_set"});
const Spec kEvaluationDuration = GaugeOf("slalom_evaluation_duration_seconds", "evaluator",
                                         "Wall-clock time that the last evaluation took.");

// Processes
const Spec kBuildInfo =
    GaugeOf("slalom_build_info", "all",
            "Always 1. The labels say which version of the program runs.", {"version", "commit"});
const Spec kBlasInfo = GaugeOf("slalom_blas_info", "all",
                               "Always 1. The label names the BLAS kernel that multiplies the "
                               "matrices (none: no BLAS is used).",
                               {"kernel"});
const Spec kRestarts = CounterOf("slalom_restarts_total", "actor, replay, learner, evaluator",
                                 "Restarts of this process on the same state directory.");
const Spec kProcessResidentBytes =
    GaugeOf("process_resident_memory_bytes", "all", "Resident memory of the process.");
const Spec kProcessVirtualBytes =
    GaugeOf("process_virtual_memory_bytes", "all", "Virtual memory of the process.");
const Spec kProcessCpuSeconds = CounterOf("process_cpu_seconds_total", "all",
                                          "Processor time of all threads, user and system.");
const Spec kProcessStartTime = GaugeOf("process_start_time_seconds", "all",
                                       "When the process started, in seconds since 1970.");
const Spec kProcessThreads = GaugeOf("process_threads", "all", "Number of threads.");
const Spec kProcessOpenDescriptors = GaugeOf("process_open_fds", "all", "Open file descriptors.");
const Spec kProcessMaxDescriptors =
    GaugeOf("process_max_fds", "all", "File descriptors that may be open.");

}  // namespace slalom::metrics
