#include "actor/service/actor_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/random.h"
#include "metrics/catalogue.h"
#include "replay/rows.h"

namespace slalom::actor {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kWait{50};
// So that the process exits within 5 s of SIGTERM, including the time to write the spool.
constexpr milliseconds kPatience{3000};
// A chunk that is refused this often was not damaged on the way; it is wrong.
constexpr int kMaxRefusals = 5;

const std::filesystem::path& Made(const std::filesystem::path& directory) {
  base::MakeDirectories(directory);
  return directory;
}

}  // namespace

ActorService::ActorService(const ActorServiceConfig& config, const ActorConfig& actor_config,
                           const SamplingConfig& sampling, ActorIdentity identity,
                           env::BatchEnvironment& environments, env::Agent& agent,
                           service::InstallPolicy install, transport::Context& context,
                           metrics::Registry& registry)
    : config_(config),
      actor_config_(actor_config),
      sampling_(sampling),
      identity_(std::move(identity)),
      environments_(environments),
      agent_(agent),
      ledger_(Made(identity_.state_directory) / "ledger"),
      outbox_(config.unacknowledged_bytes),
      replay_(context, identity_.replay, {}),
      policy_(context, identity_.learner, identity_.name, std::move(install),
              {.without_model = !identity_.plans}),
      metrics_(registry, identity_.course_set, config.unacknowledged_bytes,
               environments.batch_size()),
      chunk_(environments.shape()),
      reported_steps_(ledger_.account().made),
      reported_at_(steady_clock::now()) {
  SpreadNoise(actor_config_,
              environments_.batch_size());  // Throws early if the config contradicts itself.
  const auto spooled_streams = LoadSpool();
  if (spooled_streams && outbox_.session() == ledger_.session()) {
    spdlog::info("{} steps of the last session are still to be sent", outbox_.steps());
    phase_ = Phase::kDraining;
    replay_.SetHello(MakeHello(outbox_.session(), *spooled_streams));
    return;
  }
  if (spooled_streams) {
    spdlog::warn(
        "{}: this spool is of session {}, but the ledger of session {}; its steps are not sent",
        spool().string(), outbox_.session(), ledger_.session());
  }
  StartSession(ledger_.session() + 1);
}

proto::Hello ActorService::MakeHello(std::uint64_t session, int num_streams) const {
  proto::Hello hello;
  hello.role = "actor";
  hello.name = identity_.name;
  hello.session = session;
  hello.spec_hash = identity_.spec_hash;
  hello.num_beams = chunk_.shape.num_beams;
  hello.num_streams = num_streams;
  hello.run = identity_.run;
  return hello;
}

std::optional<int> ActorService::LoadSpool() {
  try {
    return outbox_.LoadSpool(spool());
  } catch (const DamagedSpool& error) {
    SetSpoolAside(error.what());
    return std::nullopt;
  }
}

// Otherwise every start would end in the same way. The next session counts its steps as lost.
void ActorService::SetSpoolAside(std::string_view why) {
  const std::filesystem::path aside = spool().string() + ".damaged";
  std::error_code error;
  std::filesystem::rename(spool(), aside, error);
  if (error) {
    throw base::Error("{}; {}: cannot rename it to {} ({})", why, spool().string(),
                      aside.filename().string(), error.message());
  }
  spdlog::error("{}; it is kept as {}, and its steps are lost", why, aside.string());
}

void ActorService::EndDraining() {
  outbox_.SaveSpool(spool(), 0);  // Removes the file.
  static_cast<void>(replay_.Send(proto::Goodbye{outbox_.session()}));
  StartSession(ledger_.session() + 1);
}

void ActorService::StartSession(std::uint64_t session) {
  phase_ = Phase::kStarting;
  outbox_.Begin(session);
  replay_.SetHello(MakeHello(session, environments_.batch_size()));
}

void ActorService::Replace(std::string_view why) {
  spdlog::warn("session {} cannot continue: {}; a new session begins", outbox_.session(), why);
  reason_ = LossReason::kReplaced;
  actor_.reset();
  chunk_.Clear();
  chunk_steps_ = 0;
  StartSession(ledger_.session() + 1);
}

void ActorService::OnWelcome(const proto::Welcome& welcome) {
  window_bytes_ = welcome.window_bytes;
  if (phase_ == Phase::kStarting && welcome.next_sequence > 0) {
    // The number has been used: this state directory is older than the server's memory.
    return StartSession(outbox_.session() + 1);
  }
  if (phase_ == Phase::kStarting) {
    const std::int64_t accepted =
        welcome.previous_session == ledger_.session() ? welcome.previous_accepted_steps : 0;
    const std::uint64_t last_session = ledger_.session();
    const std::int64_t lost_before = ledger_.account().total_lost();
    ledger_.BeginSession(outbox_.session(), accepted, reason_);
    if (const std::int64_t lost = ledger_.account().total_lost() - lost_before; lost > 0) {
      spdlog::warn("{} steps of session {} are lost: the replay server does not have them", lost,
                   last_session);
    }
    outbox_.Begin(outbox_.session());
    outbox_.SaveSpool(spool(), 0);  // The outbox is empty, so this removes the file.
    const std::uint64_t seed =
        base::DeriveSeed(identity_.seed, "actor",
                         {base::Checksum(std::string_view(identity_.name)), outbox_.session()});
    actor_ = std::make_unique<Actor>(actor_config_, environments_, agent_, seed, sampling_);
    phase_ = Phase::kRunning;
    spdlog::info("session {} with the replay server at {}", outbox_.session(), replay_.endpoint());
    return;
  }
  Acknowledge(welcome.next_sequence);
  if (!outbox_.Resume(welcome.next_sequence)) {
    Replace("the replay server no longer has what it acknowledged");
  }
}

void ActorService::Acknowledge(std::uint64_t next_sequence) {
  const int chunks = outbox_.Acknowledge(next_sequence);
  metrics_.AddAcknowledged(chunks);
  if (chunks > 0) refused_in_a_row_ = 0;
  ledger_.AcknowledgeAllBut(outbox_.steps() + chunk_steps_);
}

void ActorService::OnAck(const proto::InsertAck& ack) {
  if (ack.session != outbox_.session() || phase_ == Phase::kStarting) return;
  window_bytes_ = ack.window_bytes;
  Acknowledge(ack.next_sequence);
}

void ActorService::OnRefusal(const proto::Refusal& refusal) {
  metrics_.AddRefused(proto::ToString(refusal.code));
  if (refusal.code == proto::RefusalCode::kReplaced) {
    base::ThrowIf(
        phase_ == Phase::kRunning,
        "another process took over as actor '{}' (session {}, this one's is {}); choose another "
        "service.name",
        identity_.name, refusal.about, outbox_.session());
    // This state directory is older than the server's memory.
    if (phase_ == Phase::kDraining) reason_ = LossReason::kReplaced;
    return StartSession(std::max(refusal.about, outbox_.session()) + 1);
  }
  if (refusal.code == proto::RefusalCode::kBadMessage && ++refused_in_a_row_ > kMaxRefusals) {
    if (phase_ == Phase::kDraining) {
      refused_in_a_row_ = 0;
      SetSpoolAside(fmt::format("{}: the replay server keeps refusing chunk {}: {}",
                                spool().string(), refusal.about, refusal.text));
      return StartSession(ledger_.session() + 1);
    }
    throw base::Error("the replay server at {} keeps refusing chunk {}: {}", replay_.endpoint(),
                      refusal.about, refusal.text);
  }
}

void ActorService::Listen(milliseconds timeout) {
  if (timeout.count() > 0) {
    transport::Client::WaitForAny({&replay_.client(), &policy_.client()}, timeout);
  }
  while (auto received = replay_.Receive(milliseconds(0))) {
    if (const auto* ack = std::get_if<proto::InsertAck>(&received->header)) OnAck(*ack);
    if (const auto* welcome = std::get_if<proto::Welcome>(&received->header)) OnWelcome(*welcome);
    if (const auto* refusal = std::get_if<proto::Refusal>(&received->header)) OnRefusal(*refusal);
  }
  if (policy_.Poll()) metrics_.AddPolicyInstalled(policy_.latency_s());
}

void ActorService::SendChunks() {
  if (!replay_.welcomed()) return;
  while (const OutgoingChunk* chunk = outbox_.NextToSend(window_bytes_)) {
    if (!replay_.Send(chunk->header, chunk->payload.Share())) return;
    const std::int64_t resent = outbox_.resent();
    const int steps = chunk->header.num_steps;
    outbox_.MarkSent();
    metrics_.AddSent(steps, outbox_.resent() > resent);
  }
}

void ActorService::Step() {
  if (chunk_.num_rows() == 0) {
    chunk_began_ = steady_clock::now();
    chunk_oldest_version_ = policy_.version();
  }
  actor_->Step(&chunk_);
  CountMade();
}

// Before any of them can be sent, so that the count is never below the server's.
void ActorService::CountMade() {
  const int steps = chunk_.num_steps();
  ledger_.AddMade(steps - chunk_steps_);
  chunk_steps_ = steps;
}

bool ActorService::ChunkIsDue() const {
  return chunk_.num_rows() >= config_.chunk_rows ||
         (chunk_.num_rows() > 0 && steady_clock::now() - chunk_began_ >=
                                       std::chrono::duration<double>(config_.chunk_seconds));
}

void ActorService::CloseChunk() {
  if (chunk_.num_rows() == 0) return;
  proto::Insert header;
  header.num_rows = chunk_.num_rows();
  header.num_beams = chunk_.shape.num_beams;
  header.num_steps = chunk_steps_;
  // A killed learner goes back to its checkpoint, and its versions with it.
  const std::int64_t last_version = policy_.version();
  header.oldest_version = std::min(chunk_oldest_version_, last_version);
  header.newest_version = std::max(chunk_oldest_version_, last_version);
  transport::Frame payload(replay::RowBytes::Size(header.num_rows, chunk_.shape));
  replay::RowBytes::Write(chunk_, payload.mutable_bytes());
  outbox_.Add(header, std::move(payload));
  chunk_.Clear();
  chunk_steps_ = 0;
}

const char* ActorService::Obstacle() const {
  if (phase_ != Phase::kRunning) return "the replay server";
  if (!policy_.has_policy()) return "the learner's first policy";
  if (MustWait()) return "the replay server to accept rows";
  return nullptr;
}

bool ActorService::MustWait() const {
  // A connected server that holds inserts back does not want steps of old policies later. Without a
  // window, one chunk is made ahead, to be sent as soon as the server has room.
  const bool ahead = !outbox_.empty() && outbox_.bytes() >= window_bytes_;
  return outbox_.full() || (replay_.welcomed() && ahead);
}

void ActorService::SayObstacle(const char* obstacle) {
  // Inserts being held back is normal operation of the rate limiter, so only metrics show it.
  const bool held = phase_ == Phase::kDraining || MustWait();
  if (held && replay_.welcomed()) obstacle = nullptr;
  if (obstacle == said_obstacle_) return;
  metrics_.SetObstacle(obstacle);
  if (obstacle != nullptr) {
    spdlog::info("waiting for {} (replay server {}, learner {})", obstacle,
                 identity_.replay.endpoint, identity_.learner.endpoint);
  }
  said_obstacle_ = obstacle;
}

void ActorService::Run(std::stop_token stop, const std::function<void()>& between) {
  try {
    while (!stop.stop_requested()) {
      Turn(kWait);
      if (between) between();
    }
  } catch (...) {
    KeepUnsent();
    throw;
  }
  Finish(kPatience);
}

void ActorService::KeepUnsent() {
  if (phase_ == Phase::kStarting) return;
  try {
    CountMade();  // An environment may have failed to begin its next episode after a step.
    CloseChunk();
    outbox_.SaveSpool(spool(), replay_.hello().num_streams);
  } catch (const std::exception& error) {
    spdlog::error("{}; what was not acknowledged is lost", error.what());
  }
}

void ActorService::Turn(milliseconds wait) {
  metrics_.AddTurn();
  // A welcome may confirm the end of a spool, too, as the server may have held it for us.
  if (phase_ == Phase::kDraining && outbox_.empty()) EndDraining();
  const char* const obstacle = Obstacle();
  SayObstacle(obstacle);
  if (obstacle == nullptr) {
    Step();
    if (ChunkIsDue()) CloseChunk();
    SendChunks();
    Listen(milliseconds(0));
  } else {
    const auto began = steady_clock::now();
    SendChunks();
    Listen(wait);
    if (MustWait()) {
      metrics_.AddBlocked(metrics::queue::kUnacknowledged,
                          std::chrono::duration<double>(steady_clock::now() - began).count());
    }
  }
  replay_.ReportEverySecond([this] { return MakeReport(); });
}

void ActorService::Finish(milliseconds patience) {
  const auto began = steady_clock::now();
  if (phase_ == Phase::kRunning) CloseChunk();
  // If the server is gone, too, a machine may be shutting down.
  while (phase_ != Phase::kStarting && !outbox_.empty() &&
         steady_clock::now() - began < (replay_.welcomed() ? patience : patience / 3)) {
    SendChunks();
    Listen(kWait);
  }
  if (phase_ != Phase::kStarting) {
    if (outbox_.empty()) static_cast<void>(replay_.Send(proto::Goodbye{outbox_.session()}));
    outbox_.SaveSpool(spool(), replay_.hello().num_streams);
  }
  const StepAccount account = ledger_.account();
  spdlog::info("stopped: {} steps made, {} accepted, {} kept for the next start, {} lost",
               account.made, account.accepted, account.pending, account.total_lost());
}

proto::Report ActorService::MakeReport() {
  const StepAccount account = ledger_.account();
  const ActorStats episodes = actor_ ? actor_->stats() : ActorStats{};
  metrics_.Update(account, outbox_, episodes, replay_, policy_);
  const auto now = steady_clock::now();
  const double elapsed = std::chrono::duration<double>(now - reported_at_).count();
  const double steps_per_s = static_cast<double>(account.made - reported_steps_) / elapsed;
  reported_at_ = now;
  reported_steps_ = account.made;
  proto::Report report;
  report.role = "actor";
  report.name = identity_.name;
  report.figures = {{"steps_made", static_cast<double>(account.made)},
                    {"steps_accepted", static_cast<double>(account.accepted)},
                    {"steps_pending", static_cast<double>(account.pending)},
                    {"steps_lost", static_cast<double>(account.total_lost())},
                    {"steps_per_s", steps_per_s},
                    {"policy_version", static_cast<double>(policy_.version())},
                    {"episodes", static_cast<double>(episodes.num_episodes)}};
  if (episodes.num_recent > 0) {
    report.figures["success_rate"] = episodes.success_rate;
    report.figures["collision_rate"] = episodes.collision_rate;
    report.figures["timeout_rate"] = episodes.timeout_rate;
    report.figures["mean_return"] = episodes.mean_return;
    report.figures["mean_cost"] = episodes.mean_cost;
    report.figures["mean_length"] = episodes.mean_length;
  }
  return report;
}

}  // namespace slalom::actor
