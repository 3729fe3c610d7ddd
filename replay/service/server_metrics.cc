#include "replay/service/server_metrics.h"

#include <cmath>
#include <limits>
#include <utility>
#include <variant>

#include "metrics/catalogue.h"

namespace slalom::replay {
namespace {

template <std::size_t... kIndices>
std::vector<metrics::Counter> MessageCounters(metrics::Registry& registry,
                                              std::index_sequence<kIndices...>) {
  return {registry.counter(metrics::kMessages,
                           {proto::NameOf(proto::Header(std::in_place_index<kIndices>))})...};
}

}  // namespace

ServerMetrics::ServerMetrics(metrics::Registry& registry, const ReplayServerSpec& spec)
    : registry_(registry),
      spec_(spec),
      steps_accepted_(registry.counter(metrics::kStepsAccepted)),
      chunks_accepted_(registry.counter(metrics::kChunksAccepted)),
      chunks_duplicate_(registry.counter(metrics::kChunksDuplicate)),
      steps_duplicate_(registry.counter(metrics::kStepsDuplicate)),
      sessions_started_(registry.counter(metrics::kSessionsStarted)),
      reconnections_(registry.counter(metrics::kReconnections)),
      episodes_cut_(registry.counter(metrics::kEpisodesCut)),
      batches_(registry.counter(metrics::kBatches)),
      samples_(registry.counter(metrics::kSamples)),
      priorities_updated_(registry.counter(metrics::kPrioritiesUpdated)),
      priorities_stale_(registry.counter(metrics::kPrioritiesStale)),
      malformed_(registry.counter(metrics::kMessagesMalformed)),
      rejected_connections_(registry.counter(metrics::kRejectedConnections)),
      blocked_inserts_(registry.counter(metrics::kBlockedSeconds, {"inserts"})),
      blocked_samples_(registry.counter(metrics::kBlockedSeconds, {"samples"})),
      blocked_journal_(registry.counter(metrics::kBlockedSeconds, {"journal"})),
      journal_written_(registry.counter(metrics::kJournalWrittenBytes)),
      journal_errors_(registry.counter(metrics::kJournalErrors)),
      table_rows_(registry.gauge(metrics::kTableRows)),
      table_steps_(registry.gauge(metrics::kTableSteps)),
      table_capacity_(registry.gauge(metrics::kTableCapacityRows)),
      table_bytes_(registry.gauge(metrics::kTableBytes)),
      samples_per_insert_(registry.gauge(metrics::kSamplesPerInsert)),
      samples_per_insert_target_(registry.gauge(metrics::kSamplesPerInsertTarget)),
      inserts_depth_(registry.gauge(metrics::kQueueDepth, {"inserts"})),
      samples_depth_(registry.gauge(metrics::kQueueDepth, {"samples"})),
      journal_depth_(registry.gauge(metrics::kQueueDepth, {"journal"})),
      inserts_bytes_(registry.gauge(metrics::kQueueBytes, {"inserts"})),
      inserts_limit_(registry.gauge(metrics::kQueueLimitBytes, {"inserts"})),
      journal_bytes_(registry.gauge(metrics::kQueueBytes, {"journal"})),
      connections_(registry.gauge(metrics::kServerConnections)),
      connections_limit_(registry.gauge(metrics::kServerConnectionsLimit)),
      disk_bytes_(registry.gauge(metrics::kJournalBytes)),
      disk_segments_(registry.gauge(metrics::kJournalSegments)),
      sync_timestamp_(registry.gauge(metrics::kJournalSyncTimestamp)),
      failing_(registry.gauge(metrics::kJournalFailing)),
      recovered_steps_(registry.gauge(metrics::kJournalRecoveredSteps)),
      damaged_steps_(registry.gauge(metrics::kJournalDamagedSteps)),
      unsynced_steps_(registry.gauge(metrics::kJournalUnsyncedSteps)),
      sessions_(registry.gauge(metrics::kSessions)),
      insert_seconds_(registry.histogram(metrics::kInsertSeconds)),
      sample_seconds_(registry.histogram(metrics::kSampleSeconds)),
      sync_seconds_(registry.histogram(metrics::kJournalSyncSeconds)),
      messages_(MessageCounters(registry,
                                std::make_index_sequence<std::variant_size_v<proto::Header>>())),
      shown_(std::chrono::steady_clock::now()) {
  for (const proto::RefusalCode code : proto::kRefusalCodes) {
    const auto i = static_cast<std::size_t>(code);
    chunks_rejected_[i] = registry.counter(metrics::kChunksRejected, {ToString(code)});
    steps_rejected_[i] = registry.counter(metrics::kStepsRejected, {ToString(code)});
    refusals_[i] = registry.counter(metrics::kMessagesRefused, {ToString(code)});
  }
  for (const transport::EndReason reason : transport::kEndReasons) {
    connections_ended_[reason] =
        registry.counter(metrics::kConnectionsEnded, {transport::ToString(reason)});
  }
  for (const transport::Role role : transport::kRoles) {
    if (role == transport::Role::kReplay) continue;
    peers_[ToString(role)] = registry.gauge(metrics::kConnectedPeers, {ToString(role)});
    if (role != transport::Role::kOperator) registry.counter(metrics::kPeersLost, {ToString(role)});
  }
  table_capacity_.Set(static_cast<double>(spec.table.capacity));
  report_.role = "replay";
  report_.name = "replay";
  report_.facts["software"] = spec.software;
}

void ServerMetrics::ShowRecovery(const Recovered& recovered) {
  recovered_steps_.Set(static_cast<double>(recovered.table.num_steps()));
  damaged_steps_.Set(static_cast<double>(recovered.lost_rows));
  unsynced_steps_.Set(static_cast<double>(recovered.unsynced_rows));
  shown_steps_ = recovered.sessions.accepted_steps();
}

void ServerMetrics::CountRefusal(proto::RefusalCode code) {
  refusals_[static_cast<std::size_t>(code)].Increment();
}

void ServerMetrics::CountLostPeer(const std::string& role) {
  registry_.counter(metrics::kPeersLost, {role}).Increment();
}

void ServerMetrics::Show(const Sources& sources, Time now) {
  const double elapsed = std::chrono::duration<double>(now - shown_).count();
  const InsertDesk::Counts& in = sources.inserts->counts();
  const SampleDesk::Counts& out = sources.samples->counts();
  const std::int64_t steps = sources.inserts->sessions().accepted_steps();
  steps_accepted_.RaiseTo(static_cast<double>(steps));
  chunks_accepted_.RaiseTo(static_cast<double>(in.chunks_accepted));
  chunks_duplicate_.RaiseTo(static_cast<double>(in.chunks_duplicate));
  steps_duplicate_.RaiseTo(static_cast<double>(in.steps_duplicate));
  sessions_started_.RaiseTo(static_cast<double>(in.sessions_started));
  reconnections_.RaiseTo(static_cast<double>(in.reconnections));
  episodes_cut_.RaiseTo(static_cast<double>(in.episodes_cut));
  for (const proto::RefusalCode code : proto::kRefusalCodes) {
    const auto i = static_cast<std::size_t>(code);
    chunks_rejected_[i].RaiseTo(static_cast<double>(in.chunks_rejected[i]));
    steps_rejected_[i].RaiseTo(static_cast<double>(in.steps_rejected[i]));
  }
  batches_.RaiseTo(static_cast<double>(out.batches));
  samples_.RaiseTo(static_cast<double>(out.samples));
  priorities_updated_.RaiseTo(static_cast<double>(out.priorities_set));
  priorities_stale_.RaiseTo(static_cast<double>(out.priorities_stale));
  malformed_.RaiseTo(static_cast<double>(sources.malformed));
  rejected_connections_.RaiseTo(static_cast<double>(sources.connections.rejected));
  connections_.Set(sources.connections.open);
  connections_limit_.Set(sources.connections.limit);
  for (const auto& [reason, count] : sources.connections.ended) {
    connections_ended_.at(reason).RaiseTo(static_cast<double>(count));
  }
  blocked_inserts_.Increment(sources.held_inserts_s);
  blocked_samples_.Increment(sources.held_samples_s);

  table_rows_.Set(static_cast<double>(sources.table->num_rows()));
  table_steps_.Set(static_cast<double>(sources.table->num_steps()));
  table_bytes_.Set(static_cast<double>(sources.table->bytes()));
  const double earning = static_cast<double>(steps - spec_.learning_starts);
  const double batch = out.batches > 0 ? static_cast<double>(out.samples) / out.batches : 0.0;
  const double ratio = earning > 0.0 ? sources.limiter->granted() * batch / earning
                                     : std::numeric_limits<double>::quiet_NaN();
  samples_per_insert_.Set(ratio);
  samples_per_insert_target_.Set(sources.limiter->batches_per_step() * batch);
  inserts_depth_.Set(static_cast<double>(sources.inserts->num_held()));
  inserts_bytes_.Set(static_cast<double>(sources.inserts->unwritten_bytes()));
  inserts_limit_.Set(static_cast<double>(sources.inserts->room_bytes()));
  samples_depth_.Set(static_cast<double>(sources.samples->num_held()));
  journal_depth_.Set(static_cast<double>(sources.inserts->num_unwritten()));
  const int present = sources.inserts->num_present(now);
  sessions_.Set(present);
  for (auto& [role, gauge] : peers_) {
    const auto it = sources.peers.find(role);
    gauge.Set(it == sources.peers.end() ? 0 : it->second);
  }
  for (const double s : sources.inserts->TakeInsertSeconds()) insert_seconds_.Observe(s);
  for (const double s : sources.samples->TakeSampleSeconds()) sample_seconds_.Observe(s);

  if (elapsed > 0.0) {
    report_.figures["steps_per_s"] = static_cast<double>(steps - shown_steps_) / elapsed;
    report_.figures["batches_per_s"] = static_cast<double>(out.batches - shown_batches_) / elapsed;
  }
  report_.figures["steps"] = static_cast<double>(steps);
  report_.figures["table_steps"] = static_cast<double>(sources.table->num_steps());
  report_.figures["table_rows"] = static_cast<double>(sources.table->num_rows());
  report_.figures["batches"] = sources.limiter->granted();
  report_.figures["sessions"] = present;
  report_.figures["held_chunks"] = static_cast<double>(sources.inserts->num_held());
  report_.figures["held_samples"] = static_cast<double>(sources.samples->num_held());
  report_.figures["acting_version"] = sources.inserts->acting_version();
  shown_ = now;
  shown_steps_ = steps;
  shown_batches_ = out.batches;
  if (sources.journal != nullptr) {
    const Journal::Status status = sources.journal->status();
    if (!status.failing.empty()) blocked_journal_.Increment(elapsed);
    ShowJournal(status);
  }
}

void ServerMetrics::ShowJournal(const Journal::Status& status) {
  journal_written_.RaiseTo(static_cast<double>(status.written_bytes));
  journal_errors_.RaiseTo(static_cast<double>(status.failures));
  journal_bytes_.Set(static_cast<double>(status.waiting_bytes));
  disk_bytes_.Set(static_cast<double>(status.disk_bytes));
  disk_segments_.Set(status.num_segments);
  failing_.Set(status.failing.empty() ? 0.0 : 1.0);
  registry_.SetFault(status.failing);
  if (status.syncs > shown_syncs_) {
    // There is rarely more than one sync between two calls.
    const double mean = (status.sync_s - shown_sync_s_) / (status.syncs - shown_syncs_);
    for (std::int64_t i = shown_syncs_; i < status.syncs; ++i) sync_seconds_.Observe(mean);
    shown_syncs_ = status.syncs;
    shown_sync_s_ = status.sync_s;
    const auto age = std::chrono::steady_clock::now() - status.synced;
    const auto wall = std::chrono::system_clock::now().time_since_epoch() - age;
    sync_timestamp_.Set(std::chrono::duration<double>(wall).count());
  }
  report_.figures["journal_bytes"] = static_cast<double>(status.disk_bytes);
  report_.figures["journal_waiting_bytes"] = static_cast<double>(status.waiting_bytes);
  report_.facts["journal"] = status.failing.empty() ? "writing" : status.failing;
}

}  // namespace slalom::replay
