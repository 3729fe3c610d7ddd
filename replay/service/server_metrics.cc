#include "replay/service/server_metrics.h"

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

/// Makes the metrics of a replay server that have no labels.
void MakeUnlabelled(metrics::Registry& registry) {
  for (const metrics::CatalogueSection& section : metrics::Catalogue()) {
    for (const metrics::Spec* spec : section.specs) {
      if (!spec->labels.empty() || spec->roles.find("replay") == std::string_view::npos) continue;
      if (spec->type == metrics::Type::kCounter) registry.counter(*spec);
      if (spec->type == metrics::Type::kGauge) registry.gauge(*spec);
      if (spec->type == metrics::Type::kHistogram) registry.histogram(*spec);
    }
  }
}

}  // namespace

ServerMetrics::ServerMetrics(metrics::Registry& registry, const ReplayServerSpec& spec)
    : registry_(registry),
      spec_(spec),
      messages_(MessageCounters(registry,
                                std::make_index_sequence<std::variant_size_v<proto::Header>>())),
      shown_(std::chrono::steady_clock::now()) {
  // All series are there from the start, as a rate needs the 0 before the first event.
  MakeUnlabelled(registry);
  for (const char* queue : {"inserts", "samples", "journal"}) {
    registry.counter(metrics::kBlockedSeconds, {queue});
    registry.gauge(metrics::kQueueDepth, {queue});
  }
  for (const char* queue : {"inserts", "journal"}) registry.gauge(metrics::kQueueBytes, {queue});
  registry.gauge(metrics::kQueueLimitBytes, {"inserts"});
  for (const proto::RefusalCode code : proto::kRefusalCodes) {
    registry.counter(metrics::kChunksRejected, {ToString(code)});
    registry.counter(metrics::kStepsRejected, {ToString(code)});
    refusals_.push_back(registry.counter(metrics::kMessagesRefused, {ToString(code)}));
  }
  for (const transport::EndReason reason : transport::kEndReasons) {
    registry.counter(metrics::kConnectionsEnded, {transport::ToString(reason)});
  }
  for (const transport::Role role : transport::kRoles) {
    if (role == transport::Role::kReplay) continue;
    registry.gauge(metrics::kConnectedPeers, {ToString(role)});
    if (role != transport::Role::kOperator) registry.counter(metrics::kPeersLost, {ToString(role)});
  }
  registry.gauge(metrics::kTableCapacityRows).Set(spec.table.capacity);
  report_.role = "replay";
  report_.name = spec.name;
  report_.facts["software"] = spec.software;
}

void ServerMetrics::ShowRecovery(const Recovered& recovered) {
  registry_.gauge(metrics::kJournalRecoveredSteps).Set(recovered.table.num_steps());
  registry_.gauge(metrics::kJournalDamagedSteps).Set(recovered.lost_rows);
  registry_.gauge(metrics::kJournalUnsyncedSteps).Set(recovered.unsynced_rows);
  shown_steps_ = recovered.sessions.accepted_steps();
}

void ServerMetrics::CountRefusal(proto::RefusalCode code) {
  refusals_[static_cast<std::size_t>(code) - 1].Increment();  // They count from 1.
}

void ServerMetrics::CountLostPeer(const std::string& role) {
  registry_.counter(metrics::kPeersLost, {role}).Increment();
}

void ServerMetrics::Show(const Sources& sources, Time now) {
  const double elapsed = std::chrono::duration<double>(now - shown_).count();
  const InsertDesk::Counts& in = sources.inserts->counts();
  const SampleDesk::Counts& out = sources.samples->counts();
  const std::int64_t steps = sources.inserts->sessions().accepted_steps();
  registry_.counter(metrics::kStepsAccepted).RaiseTo(steps);
  registry_.counter(metrics::kChunksAccepted).RaiseTo(in.chunks_accepted);
  registry_.counter(metrics::kChunksDuplicate).RaiseTo(in.chunks_duplicate);
  registry_.counter(metrics::kStepsDuplicate).RaiseTo(in.steps_duplicate);
  registry_.counter(metrics::kSessionsStarted).RaiseTo(in.sessions_started);
  registry_.counter(metrics::kReconnections).RaiseTo(in.reconnections);
  registry_.counter(metrics::kEpisodesCut).RaiseTo(in.episodes_cut);
  for (const proto::RefusalCode code : proto::kRefusalCodes) {
    const auto i = static_cast<std::size_t>(code);
    registry_.counter(metrics::kChunksRejected, {ToString(code)}).RaiseTo(in.chunks_rejected[i]);
    registry_.counter(metrics::kStepsRejected, {ToString(code)}).RaiseTo(in.steps_rejected[i]);
  }
  registry_.counter(metrics::kBatches).RaiseTo(out.batches);
  registry_.counter(metrics::kSamples).RaiseTo(out.samples);
  registry_.counter(metrics::kPrioritiesUpdated).RaiseTo(out.priorities_set);
  registry_.counter(metrics::kPrioritiesStale).RaiseTo(out.priorities_stale);
  registry_.counter(metrics::kMessagesMalformed).RaiseTo(sources.malformed);
  registry_.counter(metrics::kRejectedConnections).RaiseTo(sources.connections.rejected);
  registry_.gauge(metrics::kServerConnections).Set(sources.connections.open);
  registry_.gauge(metrics::kServerConnectionsLimit).Set(sources.connections.limit);
  for (const auto& [reason, count] : sources.connections.ended) {
    registry_.counter(metrics::kConnectionsEnded, {transport::ToString(reason)}).RaiseTo(count);
  }
  registry_.counter(metrics::kBlockedSeconds, {"inserts"}).Increment(sources.held_inserts_s);
  registry_.counter(metrics::kBlockedSeconds, {"samples"}).Increment(sources.held_samples_s);

  registry_.gauge(metrics::kTableRows).Set(sources.table->num_rows());
  registry_.gauge(metrics::kTableSteps).Set(sources.table->num_steps());
  registry_.gauge(metrics::kTableBytes).Set(sources.table->bytes());
  const double earning = static_cast<double>(steps - spec_.learning_starts);
  const double batch = out.batches > 0 ? static_cast<double>(out.samples) / out.batches : 0.0;
  const double ratio = earning > 0.0 ? sources.limiter->granted() * batch / earning
                                     : std::numeric_limits<double>::quiet_NaN();
  registry_.gauge(metrics::kSamplesPerInsert).Set(ratio);
  registry_.gauge(metrics::kSamplesPerInsertTarget)
      .Set(sources.limiter->batches_per_step() * batch);
  registry_.gauge(metrics::kQueueDepth, {"inserts"}).Set(sources.inserts->num_held());
  registry_.gauge(metrics::kQueueBytes, {"inserts"}).Set(sources.inserts->unwritten_bytes());
  registry_.gauge(metrics::kQueueLimitBytes, {"inserts"}).Set(sources.inserts->room_bytes());
  registry_.gauge(metrics::kQueueDepth, {"samples"}).Set(sources.samples->num_held());
  registry_.gauge(metrics::kQueueDepth, {"journal"}).Set(sources.inserts->num_unwritten());
  const int present = sources.inserts->num_present(now);
  registry_.gauge(metrics::kSessions).Set(present);
  for (const transport::Role role : transport::kRoles) {
    if (role == transport::Role::kReplay) continue;
    const auto it = sources.peers.find(ToString(role));
    registry_.gauge(metrics::kConnectedPeers, {ToString(role)})
        .Set(it == sources.peers.end() ? 0 : it->second);
  }
  metrics::Histogram insert_seconds = registry_.histogram(metrics::kInsertSeconds);
  for (const double s : sources.inserts->TakeInsertSeconds()) insert_seconds.Observe(s);
  metrics::Histogram sample_seconds = registry_.histogram(metrics::kSampleSeconds);
  for (const double s : sources.samples->TakeSampleSeconds()) sample_seconds.Observe(s);

  if (elapsed > 0.0) {
    report_.figures["steps_per_s"] = static_cast<double>(steps - shown_steps_) / elapsed;
    report_.figures["batches_per_s"] = static_cast<double>(out.batches - shown_batches_) / elapsed;
  }
  report_.figures["steps"] = steps;
  report_.figures["table_steps"] = sources.table->num_steps();
  report_.figures["table_rows"] = sources.table->num_rows();
  report_.figures["batches"] = sources.limiter->granted();
  report_.figures["sessions"] = present;
  report_.figures["held_chunks"] = sources.inserts->num_held();
  report_.figures["held_samples"] = sources.samples->num_held();
  report_.figures["acting_version"] = sources.inserts->acting_version();
  shown_ = now;
  shown_steps_ = steps;
  shown_batches_ = out.batches;
  if (sources.journal != nullptr) {
    const Journal::Status status = sources.journal->status();
    if (!status.failing.empty()) {
      registry_.counter(metrics::kBlockedSeconds, {"journal"}).Increment(elapsed);
    }
    ShowJournal(status);
  }
}

void ServerMetrics::ShowJournal(const Journal::Status& status) {
  registry_.counter(metrics::kJournalWrittenBytes).RaiseTo(status.written_bytes);
  registry_.counter(metrics::kJournalErrors).RaiseTo(status.failures);
  registry_.gauge(metrics::kQueueBytes, {"journal"}).Set(status.waiting_bytes);
  registry_.gauge(metrics::kJournalBytes).Set(status.disk_bytes);
  registry_.gauge(metrics::kJournalSegments).Set(status.num_segments);
  registry_.gauge(metrics::kJournalFailing).Set(status.failing.empty() ? 0.0 : 1.0);
  registry_.SetFault(status.failing);
  if (status.syncs > shown_syncs_) {
    // There is rarely more than one sync between two calls.
    const double mean = (status.sync_s - shown_sync_s_) / (status.syncs - shown_syncs_);
    metrics::Histogram sync_seconds = registry_.histogram(metrics::kJournalSyncSeconds);
    for (std::int64_t i = shown_syncs_; i < status.syncs; ++i) sync_seconds.Observe(mean);
    shown_syncs_ = status.syncs;
    shown_sync_s_ = status.sync_s;
    const auto age = std::chrono::steady_clock::now() - status.synced;
    const auto wall = std::chrono::system_clock::now().time_since_epoch() - age;
    registry_.gauge(metrics::kJournalSyncTimestamp)
        .Set(std::chrono::duration<double>(wall).count());
  }
  report_.figures["journal_bytes"] = status.disk_bytes;
  report_.figures["journal_waiting_bytes"] = status.waiting_bytes;
  report_.facts["journal"] = status.failing.empty() ? "writing" : status.failing;
}

}  // namespace slalom::replay
