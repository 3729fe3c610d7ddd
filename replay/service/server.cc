#include "replay/service/server.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <utility>
#include <variant>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "proto/run_identity.h"

namespace slalom::replay {
namespace {

using proto::RefusalCode;
using transport::PeerId;

// How much of each kind of work is done before the others have their turn.
constexpr int kMessagesPerTurn = 32;
constexpr int kRepliesPerTurn = 4;
constexpr int kChunksPerTurn = 32;
constexpr auto kIdleWait = std::chrono::milliseconds(50);
constexpr auto kTick = std::chrono::seconds(1);
// Messages queued per connection and direction: 64 samples are 47 MB at 256 x 720 beams.
constexpr int kQueueMessages = 64;
// Connections that were silent for this many times `silence` are forgotten and must say hello
// again.
constexpr int kForgetAfter = 6;

std::uint64_t NewId() {
  std::random_device device;
  return (static_cast<std::uint64_t>(device()) << 32) | device();
}

JournalOptions JournalOptionsOf(const ReplayServerConfig& config, const ReplayServerSpec& spec) {
  return {.directory = config.directory,
          .segment_bytes = config.segment_bytes,
          .sync_interval = std::chrono::duration_cast<std::chrono::milliseconds>(
              std::chrono::duration<double>(config.sync_interval)),
          .shape = spec.shape,
          .spec_hash = spec.spec_hash};
}

/// Throws `base::Error` if a journal holds rows of another run, and notes this run if it does not
/// say which it is of: it is empty, or an earlier version wrote it.
void RequireSameRun(const std::filesystem::path& directory, const proto::RunIdentity& run,
                    bool has_rows) {
  const std::filesystem::path path = RunPath(directory);
  if (has_rows && base::Exists(path)) {
    const std::string keys =
        proto::DescribeDifference(run, proto::ParseIdentity(base::ReadFile(path)));
    if (keys.empty()) return;
    throw base::Error(
        "{}: holds rows of another run: {}; set these keys back, or give this run another "
        "service.state",
        directory.string(), keys);
  }
  base::WriteFileAtomically(path, proto::PrintIdentity(run));
}

/// Returns the roles that may send a message; none if it is not meant for this server.
bool MaySend(std::string_view role, const proto::Header& header) {
  const bool actor = role == "actor", learner = role == "learner";
  const bool known = actor || learner || role == "evaluator" || role == "operator";
  if (std::holds_alternative<proto::Hello>(header) ||
      std::holds_alternative<proto::StatusRequest>(header)) {
    return known;
  }
  if (std::holds_alternative<proto::Report>(header)) return known && role != "operator";
  if (std::holds_alternative<proto::Insert>(header) ||
      std::holds_alternative<proto::Goodbye>(header)) {
    return actor;
  }
  if (std::holds_alternative<proto::SampleRequest>(header) ||
      std::holds_alternative<proto::PriorityUpdate>(header)) {
    return learner;
  }
  return false;
}

/// Tells a process that the process of `session`, which started later, has its role and name.
proto::Refusal Replaced(const proto::Hello& hello, std::uint64_t session) {
  spdlog::warn("replay server: a second {} named {}: the one that started last is served",
               hello.role, hello.name);
  return {.code = RefusalCode::kReplaced,
          .text = fmt::format("another {} named '{}' started later, expected one: give each a "
                              "--name of its own",
                              hello.role, hello.name),
          .about = session};
}

}  // namespace

class ReplayServer::SocketReplies : public ReplySender {
 public:
  explicit SocketReplies(ReplayServer* owner) : owner_(owner) {}
  Sent Send(const PeerId& peer, transport::Message&& message) override {
    return owner_->server_->Send(peer, std::move(message));
  }
  void NoteRefusal(const PeerId& peer, RefusalCode code, std::string_view text) override {
    owner_->NoteRefusal(peer, code, text);
  }

 private:
  ReplayServer* const owner_;
};

ReplayServer::ReplayServer(const ReplayServerConfig& config, const ReplayServerSpec& spec,
                           transport::Context& context, metrics::Registry& registry)
    : config_(config),
      spec_(spec),
      replies_(std::make_unique<SocketReplies>(this)),
      board_(std::chrono::duration<double>(config.silence)),
      id_(NewId()),
      ticked_(Clock::now()) {
  metrics_.emplace(registry, spec_);
  Sessions sessions;
  std::optional<JournalLock> lock;
  std::vector<JournalSegment> segments;
  std::uint64_t next_index = 1;
  const JournalOptions options = JournalOptionsOf(config_, spec_);
  if (config_.directory.empty()) {
    table_.emplace(spec_.table, spec_.shape);
  } else {
    lock.emplace(options.directory);
    Recovered recovered = RecoverJournal(options, spec_.table);
    for (const std::string& note : recovered.notes) spdlog::warn("replay journal: {}", note);
    RequireSameRun(options.directory, spec_.run, recovered.sessions.accepted_steps() > 0);
    spdlog::info(
        "replay journal {}: {} steps in the table, {} ever accepted; lost to damage: {}, to a loss "
        "of power: {}",
        config_.directory, recovered.table.num_steps(), recovered.sessions.accepted_steps(),
        recovered.lost_rows, recovered.unsynced_rows);
    metrics_->ShowRecovery(recovered);
    table_.emplace(std::move(recovered.table));
    RestorePriorities();
    sessions = std::move(recovered.sessions);
    segments = std::move(recovered.segments);
    next_index = recovered.next_index;
  }
  server_ = std::make_unique<transport::Server>(
      context, transport::ServerOptions{.endpoint = spec_.endpoint,
                                        .security = spec_.security,
                                        .max_message_bytes = config_.max_message_bytes,
                                        .max_messages_per_second = config_.max_messages_per_second,
                                        .queue_messages = kQueueMessages,
                                        .max_queued_bytes = 2 * config_.max_sample_bytes,
                                        .max_connections = spec_.max_connections});
  if (lock) {
    StateRecord state = State();
    state.sessions = sessions;
    journal_ = std::make_unique<Journal>(options, std::move(*lock), std::move(segments), next_index,
                                         state, [this] { server_->Wake(); });
  }
  limiter_.emplace(RateLimiter::Options{.updates_per_step = spec_.updates_per_step,
                                        .batches_per_update = spec_.batches_per_update,
                                        .learning_starts = spec_.learning_starts,
                                        .max_ahead_steps = config_.max_ahead_steps},
                   sessions.accepted_steps());
  if (journal_) RestoreCursors();
  RecordLog* const log = journal_ ? static_cast<RecordLog*>(journal_.get()) : &no_log_;
  const std::int64_t room = std::max(config_.unwritten_bytes, config_.max_message_bytes);
  inserts_.emplace(InsertDesk::Options{.flow = {.window_bytes = config_.window_bytes,
                                                .room_bytes = room,
                                                .chunk_bytes = spec_.chunk_bytes},
                                       .silence = std::chrono::duration<double>(config_.silence),
                                       .server = id_,
                                       .software = spec_.software},
                   std::move(sessions), &*table_, &*limiter_, log, replies_.get());
  samples_.emplace(SampleDesk::Options{.seed = spec_.seed,
                                       .max_sample_bytes = config_.max_sample_bytes,
                                       .priority_exponent = config_.priority_exponent},
                   &*table_, &*limiter_, replies_.get());
}

// The journal's threads wake the socket, so they must end first.
ReplayServer::~ReplayServer() { journal_.reset(); }

StateRecord ReplayServer::State() const {
  StateRecord state{.first_row = table_->total_inserted(), .open = {}, .sessions = {}};
  for (int s = 0; s < table_->num_streams(); ++s) state.open.push_back(table_->is_open(s));
  if (inserts_) state.sessions = inserts_->sessions();
  return state;
}

void ReplayServer::RestorePriorities() {
  const auto path = PrioritiesPath(config_.directory);
  if (!base::Exists(path)) return;
  const auto failure = table_->RestorePriorities(base::ReadFile(path), config_.priority_exponent);
  if (failure) {
    spdlog::warn("{}: {}; all steps start with the same priority", path.string(), failure->text);
  }
}

void ReplayServer::SavePriorities() {
  if (!table_->has_priorities()) return;
  journal_->SaveBeside(PrioritiesPath(config_.directory), table_->PrintPriorities());
}

// Without them a restart would forget what was granted, and hold inserts back until each learner
// has asked again.
void ReplayServer::RestoreCursors() {
  const auto path = CursorsPath(config_.directory);
  if (!base::Exists(path)) return;
  if (const auto failure = limiter_->RestoreCursors(base::ReadFile(path))) {
    spdlog::warn("{}: {}; the rate limiter learns them as the learners ask", path.string(),
                 failure->text);
  }
}

void ReplayServer::SaveCursors() {
  std::string cursors = limiter_->PrintCursors();
  if (cursors == saved_cursors_) return;
  journal_->SaveBeside(CursorsPath(config_.directory), cursors);
  saved_cursors_ = std::move(cursors);
}

void ReplayServer::Run(std::stop_token stop) {
  const std::stop_callback wake(stop, [this] { server_->Wake(); });
  while (!stop.stop_requested()) Turn();
  if (journal_) {
    SavePriorities();
    SaveCursors();
    journal_->Close();
  }
  inserts_->Advance(Clock::now(), 0);
  spdlog::info("replay server: stopped with {} steps accepted",
               inserts_->sessions().accepted_steps());
}

void ReplayServer::Turn() {
  metrics_->CountTurn();
  auto wait = busy_ ? std::chrono::milliseconds(0) : kIdleWait;
  for (int i = 0; i < kMessagesPerTurn; ++i) {
    auto received = server_->Receive(wait);
    if (!received) break;
    Take(std::move(*received), Clock::now());
    wait = std::chrono::milliseconds(0);
  }
  const Time now = Clock::now();
  const bool more_chunks = inserts_->Advance(now, kChunksPerTurn);
  const bool more_samples = samples_->Advance(kRepliesPerTurn, inserts_->acting_version());
  busy_ = more_chunks || more_samples;
  if (journal_ && journal_->segment_full()) {
    journal_->BeginSegment(State(), table_->first_sequence());
    SavePriorities();
  }
  if (now - ticked_ >= kTick) Tick(now);
}

void ReplayServer::Tick(Time now) {
  const double elapsed = std::chrono::duration<double>(now - ticked_).count();
  ticked_ = now;
  ForgetSilent(now);
  if (journal_) SaveCursors();
  ServerMetrics::Sources sources{.table = &*table_,
                                 .limiter = &*limiter_,
                                 .inserts = &*inserts_,
                                 .samples = &*samples_,
                                 .journal = journal_.get(),
                                 .malformed = server_->malformed(),
                                 .connections = server_->connections(),
                                 .peers = {},
                                 .held_inserts_s = inserts_->num_held() > 0 ? elapsed : 0.0,
                                 .held_samples_s = samples_->num_held() > 0 ? elapsed : 0.0};
  for (const auto& [id, peer] : peers_) {
    if (now - peer.heard < std::chrono::duration<double>(config_.silence)) {
      ++sources.peers[peer.role];
    }
  }
  metrics_->Show(sources, now);
  board_.Put(metrics_->report(), now);
}

void ReplayServer::Take(transport::Server::Received received, Time now) {
  if (received.no_room) return Refuse(received.peer, proto::NoRoom(server_->max_connections()));
  if (received.too_fast) {
    return Refuse(
        received.peer,
        {.code = RefusalCode::kTooFast, .text = "too many messages per second", .about = 0});
  }
  const auto header =
      proto::Decode(received.message.header.bytes(), received.message.payload.bytes());
  if (!header) return Refuse(received.peer, header.failure());
  metrics_->CountMessage(*header);
  if (!IsAllowed(received, *header)) {
    // A peer that may send it but has not said hello: the message was meant for a broken
    // connection.
    const bool stranger = !std::holds_alternative<proto::Hello>(*header) &&
                          !peers_.contains(received.peer) &&
                          (!received.role || MaySend(ToString(*received.role), *header));
    return Refuse(
        received.peer,
        {.code = stranger ? RefusalCode::kNoSession : RefusalCode::kNotAllowed,
         .text = fmt::format("this role and name may not send {} here, or not before a hello",
                             proto::NameOf(*header)),
         .about = 0});
  }
  if (const auto it = peers_.find(received.peer); it != peers_.end()) {
    Peer& peer = it->second;
    if (now - peer.heard >= std::chrono::duration<double>(config_.silence))
      peer.is_accounted = false;
    peer.heard = now;
    inserts_->Heard(received.peer, now);
  }
  Handle(received.peer, *header, std::move(received.message.payload), now);
}

bool ReplayServer::IsAllowed(const transport::Server::Received& received,
                             const proto::Header& header) const {
  const auto* const hello = std::get_if<proto::Hello>(&header);
  const auto known = peers_.find(received.peer);
  if (const auto* const report = std::get_if<proto::Report>(&header)) {
    // No role may report for another, as the learner relies on the reports of actors.
    return known != peers_.end() && MaySend(known->second.role, header) &&
           report->role == known->second.role && report->name == known->second.name;
  }
  if (received.role) {
    const std::string_view role = ToString(*received.role);
    if (hello != nullptr &&
        (hello->role != role || !transport::AllowsName(received.names, hello->name))) {
      return false;
    }
    // Only the hello tells which name a peer's messages count for.
    const bool needs_hello =
        !std::holds_alternative<proto::StatusRequest>(header) && hello == nullptr;
    return MaySend(role, header) && (!needs_hello || known != peers_.end());
  }
  if (hello != nullptr) return MaySend(hello->role, header);
  if (std::holds_alternative<proto::StatusRequest>(header)) return true;
  return known != peers_.end() && MaySend(known->second.role, header);
}

void ReplayServer::Handle(const PeerId& peer, const proto::Header& header, transport::Frame payload,
                          Time now) {
  if (const auto* const insert = std::get_if<proto::Insert>(&header)) {
    inserts_->Insert(peer, *insert, std::move(payload), now);
  } else if (const auto* const request = std::get_if<proto::SampleRequest>(&header)) {
    samples_->Ask(peer, peers_.at(peer).name, *request);
  } else if (const auto* const update = std::get_if<proto::PriorityUpdate>(&header)) {
    samples_->SetPriorities(peer, *update, payload.bytes());
  } else if (const auto* const report = std::get_if<proto::Report>(&header)) {
    board_.Put(*report, now);
  } else if (const auto* const hello = std::get_if<proto::Hello>(&header)) {
    Greet(peer, *hello, now);
  } else if (const auto* const goodbye = std::get_if<proto::Goodbye>(&header)) {
    if (const auto it = peers_.find(peer); it != peers_.end()) it->second.is_accounted = true;
    inserts_->Goodbye(peer, *goodbye, now);
  } else if (std::holds_alternative<proto::StatusRequest>(header)) {
    AnswerStatus(peer, now);
  }
}

void ReplayServer::AnswerStatus(const PeerId& peer, Time now) {
  const auto known = peers_.find(peer);
  const bool gets_samples = known != peers_.end() && known->second.role == "learner";
  // Nobody else needs more than one of these large replies at a time. Who asks without reading gets
  // no other.
  const std::int64_t bound = gets_samples ? 2 * config_.max_sample_bytes : 0;
  const auto sent = server_->Send(peer, MakeMessage(board_.Reply(now)), bound);
  if (sent == transport::Server::Sent::kGone) Forget(peer);
}

std::string ReplayServer::FindMismatch(const proto::Hello& hello) const {
  // Peers of earlier versions do not say which run they belong to.
  if (!hello.run.empty()) {
    const std::string keys = proto::DescribeDifference(hello.run, spec_.run);
    if (!keys.empty()) return "its config is of another run: " + keys;
  }
  if (hello.num_beams == spec_.shape.num_beams && hello.spec_hash == spec_.spec_hash) return "";
  return fmt::format("found {} beams and spec {:016x}, expected {} and {:016x}: the configs differ",
                     hello.num_beams, hello.spec_hash, spec_.shape.num_beams, spec_.spec_hash);
}

void ReplayServer::Greet(const PeerId& peer, const proto::Hello& hello, Time now) {
  if (hello.role == "actor" || hello.role == "learner") {
    if (const std::string why = FindMismatch(hello); !why.empty()) {
      return Refuse(peer, {.code = RefusalCode::kWrongSpec, .text = why, .about = 0});
    }
  }
  // Requests of an old connection are obsolete: of the same process, or of one that started before.
  std::vector<PeerId> old;
  for (const auto& [id, other] : peers_) {
    if (id != peer && other.role == hello.role && other.name == hello.name) old.push_back(id);
  }
  const bool is_actor = hello.role == "actor";  // The insert desk knows the sessions of actors.
  for (const PeerId& id : old) {
    const std::uint64_t session = peers_.at(id).session;
    if (!is_actor && session > hello.session) return Refuse(peer, Replaced(hello, session));
    if (!is_actor && session < hello.session) Refuse(id, Replaced(hello, hello.session));
    if (const auto it = peers_.find(id); it != peers_.end()) it->second.is_accounted = true;
    Forget(id);
  }
  // An operator asks once and leaves.
  peers_[peer] = {hello.role, hello.name, hello.session, now, hello.role == "operator"};
  if (is_actor) return inserts_->Hello(peer, hello, now);
  Answer(peer, proto::Welcome{.server = id_, .session = hello.session, .software = spec_.software});
}

void ReplayServer::Answer(const PeerId& peer, const proto::Header& header) {
  if (server_->Send(peer, MakeMessage(header)) == transport::Server::Sent::kGone) Forget(peer);
}

void ReplayServer::Refuse(const PeerId& peer, const proto::Refusal& refusal) {
  NoteRefusal(peer, refusal.code, refusal.text);
  Answer(peer, refusal);
}

void ReplayServer::NoteRefusal(const PeerId& peer, RefusalCode code, std::string_view text) {
  metrics_->CountRefusal(code);
  const auto it = peers_.find(peer);
  const std::string who = it == peers_.end()
                              ? "a peer that has not said hello"
                              : fmt::format("{} {}", it->second.role, it->second.name);
  refusal_log_.Note("replay server", who, code, text, Clock::now());
}

void ReplayServer::NoteLost(Peer& peer) {
  if (peer.is_accounted) return;
  peer.is_accounted = true;
  metrics_->CountLostPeer(peer.role);
  spdlog::warn("replay server: {} {} is gone without a goodbye", peer.role, peer.name);
}

void ReplayServer::Forget(const PeerId& peer) {
  if (const auto it = peers_.find(peer); it != peers_.end()) NoteLost(it->second);
  // The reference may point into an object that is erased below.
  // NOLINTNEXTLINE(performance-unnecessary-copy-initialization)
  const PeerId id = peer;
  inserts_->Gone(id);
  samples_->Gone(id);
  peers_.erase(id);
}

void ReplayServer::ForgetSilent(Time now) {
  const std::chrono::duration<double> silence(config_.silence);
  std::vector<PeerId> silent;
  for (auto& [id, peer] : peers_) {
    if (now - peer.heard >= silence) NoteLost(peer);
    if (now - peer.heard >= silence && peer.role == "learner") samples_->Silent(id);
    if (now - peer.heard >= kForgetAfter * silence) silent.push_back(id);
  }
  for (const PeerId& id : silent) Forget(id);
}

}  // namespace slalom::replay
