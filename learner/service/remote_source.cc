#include "learner/service/remote_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/json.h"
#include "base/log.h"
#include "metrics/catalogue.h"
#include "replay/sample_bytes.h"

namespace slalom::learner {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// Longest wait for a batch before policies are looked after.
constexpr milliseconds kBatchWait{5};

// A wait without a batch after which the learner is not well, [s]. Longer than a restart of the
// replay server takes.
constexpr double kPatience = 10.0;

}  // namespace

BatchStream::BatchStream(transport::Context& context, const transport::ClientOptions& replay,
                         proto::Hello hello, const env::StepShape& shape,
                         std::vector<replay::SampleSpec> specs, int prefetch, std::uint64_t cursor,
                         std::int64_t mirror_places)
    : link_(context, replay, std::move(hello)),
      shape_(shape),
      specs_(std::move(specs)),
      prefetch_(prefetch * static_cast<int>(specs_.size())),
      cursor_(cursor),
      requested_(cursor) {
  if (mirror_places > 0 && shape.num_beams > 0) mirror_.emplace(mirror_places, shape.num_beams);
  batches_.payloads.resize(specs_.size());
  batches_.rows.resize(specs_.size());
}

void BatchStream::Request() {
  if (!link_.welcomed()) return;
  // On a new connection, answers to earlier requests never come.
  const std::uint64_t next = cursor_ + static_cast<std::uint64_t>(num_here_);
  if (link_.num_welcomes() != num_welcomes_) {
    requested_ = next;
    if (mirror_) mirror_->Clear();
  }
  num_welcomes_ = link_.num_welcomes();
  while (requested_ < next + static_cast<std::uint64_t>(prefetch_)) {
    if (!Ask(specs_[requested_ % specs_.size()], mirror_.has_value())) return;
    ++requested_;
  }
}

bool BatchStream::Ask(const replay::SampleSpec& spec, bool is_mirrored) {
  proto::SampleRequest request;
  request.cursor = requested_;
  request.batch = spec.batch;
  request.history = spec.history;
  request.n_step = spec.n_step;
  request.gamma = spec.gamma;
  request.prioritized = spec.prioritized;
  request.importance_exponent = spec.importance_exponent;
  if (is_mirrored) {
    request.mirror = static_cast<std::uint64_t>(num_welcomes_);
    request.mirror_places = static_cast<int>(mirror_->num_places());
  }
  return link_.Send(request);
}

const RemoteBatches* BatchStream::Next(milliseconds timeout) {
  const auto give_up = steady_clock::now() + timeout;
  if (mirror_ && num_here_ == 0) mirror_->Keep();  // Nobody reads the last update's rows any more.
  do {
    Request();
    const auto left = std::chrono::ceil<milliseconds>(give_up - steady_clock::now());
    auto received = link_.Receive(std::max(left, milliseconds(0)));
    if (received && Take(std::move(*received))) return &batches_;
  } while (steady_clock::now() < give_up);
  return nullptr;
}

bool BatchStream::Take(service::ReplayLink::Received received) {
  if (auto* status = std::get_if<proto::StatusReply>(&received.header)) {
    status_ = std::move(*status);
    return false;
  }
  const auto* reply = std::get_if<proto::SampleReply>(&received.header);
  if (reply == nullptr) return false;
  // It counts on scans that came before the last welcome. The batch is requested again.
  const auto mirror = static_cast<std::uint64_t>(num_welcomes_);
  if (reply->mirror != 0 && reply->mirror != mirror) return false;
  if (window_spec_ && reply->history == window_spec_->history) {
    window_payload_ = std::move(received.payload);
    Parse(*reply, *window_spec_, window_payload_, &windows_);
    windows_came_ = true;
    windows_asked_ = -1;
    return false;
  }
  if (reply->cursor != cursor_ + num_here_) {  // It was requested twice.
    if (reply->mirror != 0) link_.SayHello();  // The mirror lacks its scans: begin another.
    return false;
  }
  transport::Frame& payload = batches_.payloads[num_here_];
  batches_.header = *reply;
  payload = std::move(received.payload);
  Parse(*reply, specs_[num_here_], payload, &batches_.rows[num_here_]);
  ++num_here_;
  const bool complete = num_here_ == static_cast<int>(specs_.size());
  if (complete) {
    cursor_ += specs_.size();
    num_here_ = 0;
  }
  Request();
  return complete;
}

void BatchStream::Parse(const proto::SampleReply& reply, const replay::SampleSpec& spec,
                        const transport::Frame& payload, replay::SampledRows* rows) {
  base::ThrowIf(reply.batch != spec.batch || reply.history != spec.history,
                "batch {} of the replay server at {} is [{}, {}], expected [{}, {}]", reply.cursor,
                link_.endpoint(), reply.batch, reply.history, spec.batch, spec.history);
  base::ThrowIf(reply.mirror != 0 && !mirror_,
                "batch {} of the replay server at {} is for a mirror, expected all scans",
                reply.cursor, link_.endpoint());
  const replay::SampleShape shape{reply.batch, reply.history, shape_, reply.weighted};
  const auto failure =
      reply.mirror == 0
          ? replay::ParseSample(payload.bytes(), shape, rows)
          : replay::ParseMirroredSample(payload.bytes(), shape,
                                        static_cast<std::size_t>(reply.num_scans), &*mirror_, rows);
  if (failure) {
    throw base::Error("batch {} of the replay server at {}: {}", reply.cursor, link_.endpoint(),
                      failure->text);
  }
}

// Uses the number of the next batch, which is requested under the same number afterwards. As the
// rate limiter counts by a learner's cursor, this sample does not take a batch from the run.
void BatchStream::AskWindows(const replay::SampleSpec& spec) {
  if (!link_.welcomed() || link_.num_welcomes() != num_welcomes_) return;
  if (windows_asked_ == num_welcomes_) return;
  window_spec_ = spec;
  // With all scans, as it may lie here for long, while the mirror goes on.
  if (Ask(spec, false)) windows_asked_ = num_welcomes_;
}

const replay::SampledRows* BatchStream::TakeWindows() {
  return std::exchange(windows_came_, false) ? &windows_ : nullptr;
}

void BatchStream::SetPriorities(std::span<const std::int64_t> sequence,
                                std::span<const float> priority) {
  if (!link_.welcomed()) return;
  const int count = static_cast<int>(sequence.size());
  transport::Frame payload(replay::PrioritySize(count));
  replay::WritePriorities(sequence, priority, payload.mutable_bytes());
  static_cast<void>(link_.Send(proto::PriorityUpdate{count}, std::move(payload)));
}

void BatchStream::AskStatus() {
  if (link_.welcomed()) static_cast<void>(link_.Send(proto::StatusRequest{}));
}

StreamMetrics::StreamMetrics(metrics::Registry& registry)
    : registry_(registry),
      batches_(registry.counter(metrics::kBatches)),
      waited_(registry.counter(metrics::kBlockedSeconds, {metrics::queue::kBatches})) {}

void StreamMetrics::AddBatch() {
  batches_.Increment();
  if (waiting_s_ >= kPatience) registry_.SetFault("");
  waiting_s_ = 0.0;
}

void StreamMetrics::AddWait(double seconds) {
  waited_.Increment(seconds);
  waiting_s_ += seconds;
  if (waiting_s_ < kPatience) return;
  registry_.SetFault(fmt::format("no batch came from the replay server for {:.0f} s", waiting_s_));
}

void StreamMetrics::SetStream(int in_flight, double policy_lag, int connections) {
  registry_.gauge(metrics::kQueueDepth, {metrics::queue::kBatches}).Set(in_flight);
  registry_.gauge(metrics::kPolicyLag).Set(policy_lag);
  registry_.counter(metrics::kConnections, {"replay"}).RaiseTo(connections);
}

RemoteSource::RemoteSource(transport::Context& context,
                           std::vector<transport::ClientOptions> replay, proto::Hello hello,
                           const env::StepShape& shape, std::vector<replay::SampleSpec> specs,
                           int prefetch, std::int64_t mirror_places, const PolicyServer& policies,
                           metrics::Registry& registry)
    : context_(context),
      hello_(std::move(hello)),
      shape_(shape),
      specs_(std::move(specs)),
      prefetch_(prefetch),
      mirror_places_(mirror_places),
      policies_(policies),
      metrics_(registry),
      turns_(static_cast<int>(replay.size())) {
  SLALOM_CHECK(!replay.empty());
  for (transport::ClientOptions& each : replay) shards_.push_back({.replay = std::move(each)});
}

void RemoteSource::Start() {
  if (last_ != nullptr) return;
  for (Shard& shard : shards_) {
    shard.stream = std::make_unique<BatchStream>(context_, shard.replay, hello_, shape_, specs_,
                                                 prefetch_, shard.cursor, mirror_places_);
    clients_.push_back(&shard.stream->link().client());
  }
  last_ = &shards_.front();
}

const std::vector<replay::SampledRows>* RemoteSource::Next() {
  const auto began = steady_clock::now();
  const RemoteBatches* batches = TakeTurn();
  while (batches == nullptr && steady_clock::now() < began + kBatchWait) {
    transport::Client::WaitForAny(clients_, kBatchWait);
    batches = TakeTurn();
  }
  waited_s_ += std::chrono::duration<double>(steady_clock::now() - began).count();
  waiting_ = batches == nullptr;
  if (waiting_) {
    Say(std::ranges::count(AreWelcomed(), true) > 0 ? "" : "waiting for the replay server");
    return nullptr;
  }
  metrics_.AddBatch();
  return &batches->rows;
}

const RemoteBatches* RemoteSource::TakeTurn() {
  for (const int i : turns_.Order()) {
    Shard& shard = shards_[static_cast<std::size_t>(i)];
    const RemoteBatches* const batches = shard.stream->Next(milliseconds(0));
    if (batches == nullptr) continue;
    const proto::SampleReply& header = batches->header;
    shard.steps = header.inserted_steps;
    shard.table_steps = header.table_steps;
    acting_version_ = header.acting_version;
    last_ = &shard;
    turns_.SetWeight(
        i, header.weighted ? header.table_weight : static_cast<double>(header.table_steps));
    turns_.Took(i, AreWelcomed());
    return batches;
  }
  return nullptr;
}

std::vector<bool> RemoteSource::AreWelcomed() const {
  std::vector<bool> welcomed;
  for (const Shard& shard : shards_) welcomed.push_back(shard.stream->link().welcomed());
  return welcomed;
}

std::int64_t RemoteSource::num_drawn() const {
  std::uint64_t sum = 0;
  for (const Shard& shard : shards_) sum += shard.stream ? shard.stream->cursor() : shard.cursor;
  return static_cast<std::int64_t>(sum / specs_.size());
}

std::int64_t RemoteSource::steps() const {
  std::int64_t sum = 0;
  for (const Shard& shard : shards_) sum += shard.steps;
  return sum;
}

EndedEpisodes RemoteSource::TakeEndedEpisodes() {
  return {ended_.mean_cost, std::exchange(ended_.count, 0)};
}

void RemoteSource::SetPriorities(std::span<const std::int64_t> sequence,
                                 std::span<const float> priority) {
  last_->stream->SetPriorities(sequence, priority);
}

const replay::SampledRows* RemoteSource::SampleForFigures(const replay::SampleSpec& spec) {
  const replay::SampledRows* came = nullptr;
  for (const Shard& shard : shards_) {
    if (const replay::SampledRows* const rows = shard.stream->TakeWindows()) came = rows;
  }
  last_->stream->AskWindows(spec);
  return came;
}

proto::StatusReply RemoteSource::Status() const {
  std::vector<proto::StatusReply> statuses;
  for (const Shard& shard : shards_) {
    if (shard.stream->status()) statuses.push_back(*shard.stream->status());
  }
  return proto::Merge(std::move(statuses));
}

void RemoteSource::Describe(run::MetricsRow& row) {
  const proto::StatusReply status = Status();
  const ActorFigures acting = Summarise(status);
  ended_.mean_cost = acting.mean_cost;
  ended_.count += finished_episodes_.Take(status);
  row.episodes = acting.num_episodes;
  row.success_rate = acting.success_rate;
  row.collision_rate = acting.collision_rate;
  row.timeout_rate = acting.timeout_rate;
  row.episode_return = acting.mean_return;
  row.episode_steps = acting.mean_length;
  row.table_steps = 0;
  for (const Shard& shard : shards_) {
    shard.stream->AskStatus();
    row.table_steps += shard.table_steps;
  }
}

void RemoteSource::Report(const run::MetricsRow& row, double seconds_left, bool finished) {
  const auto version = static_cast<double>(policies_.version());
  const double lag = version - acting_version_;
  int in_flight = 0;
  int connections = 0;
  for (const Shard& shard : shards_) {
    in_flight += shard.stream->in_flight();
    connections += shard.stream->link().connections();
  }
  metrics_.SetStream(in_flight, lag, connections);
  metrics_.AddWait(std::exchange(waited_s_, 0.0));
  proto::Report report;
  report.role = hello_.role;
  report.name = hello_.name;
  report.figures = {{"updates", static_cast<double>(row.updates)},
                    {"updates_per_s", row.updates_per_s},
                    {"policy_version", version},
                    {"policy_lag", lag},
                    {"readers", static_cast<double>(policies_.num_readers())},
                    {"critic_loss", row.learning.critic_loss},
                    {"q_mean", row.learning.q_mean},
                    {"seconds_left", seconds_left}};
  // Figures of a second without updates are NaN, and so is the time left of a run not begun.
  std::erase_if(report.figures, [](const auto& figure) { return std::isnan(figure.second); });
  report.facts = {{"state", finished ? "finished" : "training"}};
  for (const Shard& shard : shards_) {
    shard.stream->link().ReportEverySecond([&] { return report; });
  }
  SayWhoIsAway();
}

// One server's place stands without a list, as it did before there could be several.
void RemoteSource::Save(const std::filesystem::path&, nlohmann::json& state) {
  if (shards_.size() == 1) {
    state["cursor"] = shards_.front().stream->cursor();
    return;
  }
  for (const Shard& shard : shards_) {
    state["shards"].push_back({{"cursor", shard.stream->cursor()}, {"steps", shard.steps}});
  }
}

void RemoteSource::Restore(const std::filesystem::path&, const nlohmann::json& state) {
  const nlohmann::json saved =
      state.contains("shards") ? state.at("shards") : nlohmann::json::array({state});
  base::ThrowIf(saved.size() > shards_.size(),
                "it is of {} replay servers, but service.replay has {}: a new one may be added "
                "behind the others, and none taken away",
                saved.size(), shards_.size());
  for (Shard& shard : shards_) shard.cursor = shard.steps = 0;
  for (std::size_t i = 0; i < saved.size(); ++i) {
    shards_[i].cursor = static_cast<std::uint64_t>(base::WholeNumber(saved[i].at("cursor")));
    shards_[i].steps = base::WholeNumber(saved[i].at("steps"));
  }
}

void RemoteSource::Idle() {
  for (const Shard& shard : shards_) shard.stream->link().Receive(milliseconds(0));
}

void RemoteSource::SayWhoIsAway() {
  if (shards_.size() == 1) return;
  for (Shard& shard : shards_) {
    const bool is_away = !shard.stream->link().welcomed();
    if (is_away == std::exchange(shard.is_away, is_away)) continue;
    if (is_away) {
      spdlog::warn("no replay server answers at {}: batches come from the others",
                   shard.replay.endpoint);
    } else {
      spdlog::info("the replay server at {} answers again", shard.replay.endpoint);
    }
  }
}

void RemoteSource::Say(const std::string& what) {
  if (what == said_) return;
  said_ = what;
  if (what.empty()) return;
  std::vector<std::string_view> endpoints;
  for (const Shard& shard : shards_) endpoints.push_back(shard.replay.endpoint);
  spdlog::info("{} at {}", what, fmt::join(endpoints, ", "));
}

}  // namespace slalom::learner
