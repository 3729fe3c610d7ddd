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
const Spec kEnvironmentSteps = CounterOf("slalom_environment_steps_total", "actor",
                                         "Environment steps made, in all sessions of this actor: "
                                         "acknowledged, pending and lost ones together.");
const Spec kEpisodes = CounterOf(
    "slalom_episodes_total", "actor",
    "Training episodes that ended, by outcome (success, collision, timeout) and course set.",
    {"outcome", "course_set"});
const Spec kSuccessRate = GaugeOf("slalom_success_rate", "actor",
                                  "Share of the last training episodes that reached the goal, "
                                  "exploration noise included; NaN before the first.");
const Spec kCollisionRate =
    GaugeOf("slalom_collision_rate", "actor",
            "Share of the last training episodes that collided; NaN before the first.");
const Spec kEpisodeReturn =
    GaugeOf("slalom_episode_return", "actor",
            "Mean return of the last training episodes; NaN before the first.");
const Spec kEpisodeSteps = GaugeOf(
    "slalom_episode_steps", "actor",
    "Mean length of the last training episodes, in environment steps; NaN before the first.");
const Spec kEnvironments =
    GaugeOf("slalom_environments", "actor", "Environments that run side by side.");

// Accounting of steps
const Spec kStepsAcknowledged = CounterOf(
    "slalom_steps_acknowledged_total", "actor",
    "Environment steps that the replay server acknowledged, in all sessions of this actor; those "
    "that it lost later stay counted.");
const Spec kStepsLost = CounterOf(
    "slalom_steps_lost_total", "actor",
    "Environment steps that never reached the table, by reason, in all sessions (killed: "
    "unacknowledged when the actor was killed; replaced: unacknowledged when its session ended; "
    "server: acknowledged by a server that has them no longer).",
    {"reason"});
const Spec kStepsPending =
    GaugeOf("slalom_steps_pending", "actor", "Environment steps made and not yet acknowledged.");
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
const Spec kChunksDuplicate =
    CounterOf("slalom_chunks_duplicate_total", "replay",
              "Chunks that had been accepted before: acknowledged again, not inserted again.");
const Spec kChunksRejected =
    CounterOf("slalom_chunks_rejected_total", "actor, replay",
              "Chunks refused, by the reason on the wire (bad message, out of order, ...): sent by "
              "the replay server, received by the actor.",
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
const Spec kQueueDepth = GaugeOf(
    "slalom_queue_depth", "actor, replay, learner",
    "Items in a queue: unacknowledged (chunks, actor), inserts, samples and journal (chunks held, "
    "sample requests held, chunks not yet written, replay), batches (prefetched, learner).",
    {"queue"});
const Spec kQueueBytes =
    GaugeOf("slalom_queue_bytes", "actor, replay", "Bytes in a queue.", {"queue"});
const Spec kQueueLimitBytes =
    GaugeOf("slalom_queue_limit_bytes", "actor, replay", "Bytes that a queue may hold.", {"queue"});
const Spec kBlockedSeconds = CounterOf(
    "slalom_blocked_seconds_total", "actor, replay, learner",
    "Time that work waited at a queue: actor at unacknowledged (no room), replay at inserts and "
    "samples (held by the rate limiter) and journal (disk), learner at batches (none there).",
    {"queue"});

// Replay table
const Spec kTableRows = GaugeOf("slalom_table_rows", "replay", "Rows in the table.");
const Spec kTableSteps = GaugeOf("slalom_table_steps", "replay", "Environment steps in the table.");
const Spec kTableCapacityRows =
    GaugeOf("slalom_table_capacity_rows", "replay", "Rows that the table can hold.");
const Spec kTableBytes =
    GaugeOf("slalom_table_bytes", "replay", "Memory of the table, once it is full.");
const Spec kBatches =
    CounterOf("slalom_batches_total", "replay, learner",
              "Batches sampled: granted by the replay server, received by the learner.");
const Spec kSamples =
    CounterOf("slalom_samples_total", "replay", "Transitions sampled, over all batches.");
const Spec kSampleSeconds =
    HistogramOf("slalom_sample_seconds", "replay", "Time to draw and gather one batch.", kWait);
const Spec kInsertSeconds =
    HistogramOf("slalom_insert_seconds", "replay",
                "Time from a chunk's arrival to its acknowledgement, time held included.", kWait);
const Spec kSamplesPerInsert = GaugeOf(
    "slalom_samples_per_insert", "replay",
    "Transitions sampled for each environment step after `run.learning_starts`; NaN before.");
const Spec kSamplesPerInsertTarget = GaugeOf(
    "slalom_samples_per_insert_target", "replay",
    "What the rate limiter holds it to: `run.updates_per_step` times the transitions of a batch.");
const Spec kPrioritiesUpdated =
    CounterOf("slalom_priorities_updated_total", "replay", "Priorities set by the learner.");
const Spec kPrioritiesStale =
    CounterOf("slalom_priorities_stale_total", "replay", "Priorities for rows that were gone.");

// Journal of the replay server
const Spec kJournalBytes =
    GaugeOf("slalom_journal_bytes", "replay", "Bytes of all segments on disk.");
const Spec kJournalSegments = GaugeOf("slalom_journal_segments", "replay", "Segment files.");
const Spec kJournalWrittenBytes =
    CounterOf("slalom_journal_written_bytes_total", "replay", "Bytes written.");
const Spec kJournalSyncSeconds =
    HistogramOf("slalom_journal_sync_seconds", "replay", "Time of one fdatasync.", kWait);
const Spec kJournalSyncTimestamp =
    GaugeOf("slalom_journal_sync_timestamp_seconds", "replay",
            "When the last fdatasync ended, in seconds since 1970; everything acknowledged before "
            "survives a loss of power.");
const Spec kJournalFailing = GaugeOf(
    "slalom_journal_failing", "replay",
    "1 while the journal cannot be written (nothing is acknowledged then) or synced (what is "
    "acknowledged may not outlive a loss of power), else 0.");
const Spec kJournalErrors =
    CounterOf("slalom_journal_errors_total", "replay", "Writes and syncs that failed.");
const Spec kJournalRecoveredSteps =
    GaugeOf("slalom_journal_recovered_steps", "replay",
            "Environment steps in the table that this start read from disk.");
const Spec kJournalDamagedSteps = GaugeOf(
    "slalom_journal_damaged_steps", "replay",
    "Acknowledged environment steps that this start could not read back from damaged files.");

// Sessions and connections
const Spec kSessions = GaugeOf("slalom_sessions", "replay", "Actors' sessions that are open.");
const Spec kSessionsStarted =
    CounterOf("slalom_sessions_started_total", "replay", "Sessions begun: an actor started.");
const Spec kReconnections =
    CounterOf("slalom_reconnections_total", "replay", "Sessions taken up again by the same actor.");
const Spec kEpisodesCut = CounterOf("slalom_episodes_cut_total", "replay",
                                    "Open episodes cut off because their session ended.");
const Spec kConnectedPeers =
    GaugeOf("slalom_connected_peers", "replay, learner",
            "Peers heard of lately, by role (`peer_role`).", {"peer_role"});
const Spec kConnections = CounterOf(
    "slalom_connections_total", "actor, learner, evaluator",
    "Times that the connection to a server (replay, learner) was made; more than 1: it broke.",
    {"server"});
const Spec kRejectedConnections =
    CounterOf("slalom_rejected_connections_total", "replay, learner",
              "Handshakes that failed: wrong keys, no keys, not of this protocol.");
const Spec kMessages = CounterOf("slalom_messages_total", "replay, learner",
                                 "Messages received, by kind (Hello, Insert, ...).", {"message"});
const Spec kMessagesMalformed = CounterOf("slalom_messages_malformed_total", "replay, learner",
                                          "Messages without the two parts that every message has.");
const Spec kMessagesRefused = CounterOf("slalom_messages_refused_total", "replay, learner",
                                        "Refusals sent, by the reason on the wire.", {"reason"});

// Learning
const Spec kUpdates =
    CounterOf("slalom_updates_total", "learner", "Updates of the critics, over all restarts.");
const Spec kCriticLoss =
    GaugeOf("slalom_critic_loss", "learner",
            "Mean squared error of one critic, mean over the updates since the last reading.");
const Spec kQMean = GaugeOf("slalom_q_mean", "learner",
                            "Mean value of both critics on what was done, scaled as the rewards.");
const Spec kActorQMean = GaugeOf("slalom_actor_q_mean", "learner",
                                 "Mean value of the first critic on what the actor would do.");
const Spec kCriticGradientNorm =
    GaugeOf("slalom_critic_gradient_norm", "learner", "Norm of the critics' gradient.");
const Spec kActorGradientNorm =
    GaugeOf("slalom_actor_gradient_norm", "learner", "Norm of the actor's gradient.");
const Spec kPolicyEntropy = GaugeOf("slalom_policy_entropy_nats", "learner",
                                    "Entropy of a stochastic policy (SAC); NaN of others.");
const Spec kTemperature =
    GaugeOf("slalom_temperature", "learner", "Weight of the entropy (SAC); NaN without one.");
const Spec kCostQMean =
    GaugeOf("slalom_cost_q_mean", "learner",
            "Mean value of the cost critics, discounted collisions; NaN without a constraint.");
const Spec kConstraintMultiplier =
    GaugeOf("slalom_constraint_multiplier", "learner",
            "Lagrange multiplier of the constraint on collisions; NaN without one.");
const Spec kConstraintViolation =
    GaugeOf("slalom_constraint_violation", "learner",
            "Collisions per training episode above the constraint's limit; NaN without one.");
const Spec kModelLoss = GaugeOf(
    "slalom_model_loss", "learner",
    "Loss of the transition model on what it learns from; NaN without one, like all of it.");
const Spec kModelError =
    GaugeOf("slalom_model_error", "learner",
            "Root of the mean squared error of one number of the next frame, held out.");
const Spec kModelChange =
    GaugeOf("slalom_model_change", "learner",
            "The same of a model that says that nothing changes: what the error has to beat.");
const Spec kModelStepsError =
    GaugeOf("slalom_model_steps_error", "learner",
            "Error of one number five steps ahead, with the actions that were taken.");
const Spec kModelLikelihood =
    GaugeOf("slalom_model_likelihood_nats", "learner",
            "Negative log-likelihood of one number of the next frame, held out.");
const Spec kModelRewardError = GaugeOf("slalom_model_reward_error", "learner",
                                       "Root of the mean squared error of the scaled reward.");
const Spec kModelTermination =
    GaugeOf("slalom_model_termination_nats", "learner", "Cross-entropy of termination, held out.");
const Spec kModelCovered =
    GaugeOf("slalom_model_covered_ratio", "learner",
            "Part of the held-out numbers inside the middle of the prediction that should hold "
            "`expected` of them.",
            {"expected"});
const Spec kUpdateSeconds =
    HistogramOf("slalom_update_seconds", "learner",
                "Time of one update, without waiting for its batch.", kWait);

// Policies
const Spec kPolicyVersion =
    GaugeOf("slalom_policy_version", "actor, learner, evaluator",
            "Version of the policy: published (learner), driving (actor), last received "
            "(evaluator). A version is the number of updates it has seen.");
const Spec kPolicyTimestamp = GaugeOf("slalom_policy_timestamp_seconds", "actor, learner",
                                      "When that policy was published, in seconds since 1970; its "
                                      "age is `time()` less this. 0: none yet.");
const Spec kPolicyLag = GaugeOf("slalom_policy_lag_versions", "learner",
                                "Versions between the learner's policy and the mean of those that "
                                "the last sampled batch was driven with.");
const Spec kReaderLag =
    GaugeOf("slalom_reader_lag_versions", "learner",
            "Versions between the policy published and the oldest that a connected reader holds.");
const Spec kPoliciesPublished =
    CounterOf("slalom_policies_published_total", "learner", "Policies published.");
const Spec kPoliciesReceived =
    CounterOf("slalom_policies_received_total", "actor, evaluator", "Policies received.");
const Spec kPolicyBytes =
    GaugeOf("slalom_policy_bytes", "learner", "Size of the policy published.");
const Spec kPublishToActing = HistogramOf("slalom_publish_to_acting_seconds", "actor",
                                          "Time from a policy's publication until an actor has "
                                          "installed it, so that its next action is the policy's; "
                                          "by the clocks of both machines.",
                                          kLatency);

// Checkpoints of the learner
const Spec kCheckpoints = CounterOf("slalom_checkpoints_total", "learner", "Checkpoints written.");
const Spec kCheckpointFailures =
    CounterOf("slalom_checkpoint_failures_total", "learner",
              "Checkpoints that could not be written; the earlier one stays.");
const Spec kCheckpointTimestamp =
    GaugeOf("slalom_checkpoint_timestamp_seconds", "learner",
            "When the newest checkpoint was written, in seconds since 1970; its age is `time()` "
            "less this. Before the first: when the learner started.");
const Spec kCheckpointSeconds =
    GaugeOf("slalom_checkpoint_seconds", "learner", "Time that the last checkpoint took.");
const Spec kCheckpointBytes =
    GaugeOf("slalom_checkpoint_bytes", "learner", "Size of the last checkpoint.");
const Spec kCheckpointUpdates =
    GaugeOf("slalom_checkpoint_updates", "learner",
            "Updates at which the newest checkpoint stands: what a restart goes on from.");
const Spec kRunFinished = GaugeOf(
    "slalom_run_finished", "learner",
    "1 once the run has the steps or seconds that its config allows: all rest from then on.");

// Evaluation
const Spec kEvaluations = CounterOf("slalom_evaluations_total", "evaluator", "Policies scored.");
const Spec kEvaluationVersion = GaugeOf("slalom_evaluation_policy_version", "evaluator",
                                        "Version of the policy that was scored last.");
const Spec kEvaluationSuccessRate = GaugeOf("slalom_evaluation_success_rate", "evaluator",
                                            "Share of the evaluation's episodes that reached the "
                                            "goal, on a course set, without exploration.",
                                            {"course_set"});
const Spec kEvaluationCollisionRate =
    GaugeOf("slalom_evaluation_collision_rate", "evaluator",
            "Share of the evaluation's episodes that collided.", {"course_set"});
const Spec kEvaluationTimeoutRate =
    GaugeOf("slalom_evaluation_timeout_rate", "evaluator",
            "Share of the evaluation's episodes that ran out of time.", {"course_set"});
const Spec kEvaluationTime = GaugeOf(
    "slalom_evaluation_time_seconds", "evaluator",
    "Mean time to the goal of successful episodes; NaN where there is none.", {"course_set"});
const Spec kEvaluationScore = GaugeOf("slalom_evaluation_score", "evaluator",
                                      "Mean BARN score of the episodes, 0 to 0.5.", {"course_set"});
const Spec kEvaluationDuration = GaugeOf("slalom_evaluation_duration_seconds", "evaluator",
                                         "Wall-clock time that the last evaluation took.");

// Processes
const Spec kBuildInfo =
    GaugeOf("slalom_build_info", "all", "Always 1; the labels say which program runs.",
            {"version", "commit"});
const Spec kBlasInfo = GaugeOf("slalom_blas_info", "all",
                               "Always 1; the label is the BLAS kernel that the matrices are "
                               "multiplied with (none: not used).",
                               {"kernel"});
const Spec kRestarts =
    CounterOf("slalom_restarts_total", "all",
              "Starts of this role on the same state directory, the first not counted.");
const Spec kProcessResidentBytes =
    GaugeOf("process_resident_memory_bytes", "all", "Resident memory.");
const Spec kProcessVirtualBytes = GaugeOf("process_virtual_memory_bytes", "all", "Virtual memory.");
const Spec kProcessCpuSeconds = CounterOf("process_cpu_seconds_total", "all",
                                          "Processor time, user and system, of all threads.");
const Spec kProcessStartTime = GaugeOf("process_start_time_seconds", "all",
                                       "When the process started, in seconds since 1970.");
const Spec kProcessThreads = GaugeOf("process_threads", "all", "Threads.");
const Spec kProcessOpenDescriptors = GaugeOf("process_open_fds", "all", "Open file descriptors.");
const Spec kProcessMaxDescriptors =
    GaugeOf("process_max_fds", "all", "File descriptors that may be open.");

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
      {"Learning",
       {&kUpdates,
        &kCriticLoss,
        &kQMean,
        &kActorQMean,
        &kCriticGradientNorm,
        &kActorGradientNorm,
        &kPolicyEntropy,
        &kTemperature,
        &kCostQMean,
        &kConstraintMultiplier,
        &kConstraintViolation,
        &kModelLoss,
        &kModelError,
        &kModelChange,
        &kModelStepsError,
        &kModelLikelihood,
        &kModelRewardError,
        &kModelTermination,
        &kModelCovered,
        &kUpdateSeconds}},
      {"Policies",
       {&kPolicyVersion, &kPolicyTimestamp, &kPolicyLag, &kReaderLag, &kPoliciesPublished,
        &kPoliciesReceived, &kPolicyBytes, &kPublishToActing}},
      {"Checkpoints of the learner",
       {&kCheckpoints, &kCheckpointFailures, &kCheckpointTimestamp, &kCheckpointSeconds,
        &kCheckpointBytes, &kCheckpointUpdates, &kRunFinished}},
      {"Evaluation",
       {&kEvaluations, &kEvaluationVersion, &kEvaluationSuccessRate, &kEvaluationCollisionRate,
        &kEvaluationTimeoutRate, &kEvaluationTime, &kEvaluationScore, &kEvaluationDuration}},
      {"Processes",
       {&kBuildInfo, &kBlasInfo, &kRestarts, &kProcessResidentBytes, &kProcessVirtualBytes,
        &kProcessCpuSeconds, &kProcessStartTime, &kProcessThreads, &kProcessOpenDescriptors,
        &kProcessMaxDescriptors}},
  };
  return sections;
}

}  // namespace slalom::metrics
