#include "learner/service/remote_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

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
                         std::vector<replay::SampleSpec> specs, int prefetch, std::uint64_t cursor)
    : link_(context, replay, std::move(hello)),
      shape_(shape),
      specs_(std::move(specs)),
      prefetch_(prefetch * static_cast<int>(specs_.size())),
      cursor_(cursor),
      requested_(cursor) {
  batches_.payloads.resize(specs_.size());
  batches_.rows.resize(specs_.size());
}

void BatchStream::Request() {
  if (!link_.welcomed()) return;
  // On a new connection, answers to earlier requests never come.
  const std::uint64_t next = cursor_ + static_cast<std::uint64_t>(num_here_);
  if (link_.num_welcomes() != num_welcomes_) requested_ = next;
  num_welcomes_ = link_.num_welcomes();
  while (requested_ < next + static_cast<std::uint64_t>(prefetch_)) {
    if (!Ask(specs_[requested_ % specs_.size()])) return;
    ++requested_;
  }
}

bool BatchStream::Ask(const replay::SampleSpec& spec) {
  proto::SampleRequest request;
  request.cursor = requested_;
  request.batch = spec.batch;
  request.history = spec.history;
  request.n_step = spec.n_step;
  request.gamma = spec.gamma;
  request.prioritized = spec.prioritized;
  request.importance_exponent = spec.importance_exponent;
  return link_.Send(request);
}

const RemoteBatches* BatchStream::Next(milliseconds timeout) {
  const auto give_up = steady_clock::now() + timeout;
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
  if (window_spec_ && reply->history == window_spec_->history) {
    window_payload_ = std::move(received.payload);
    Parse(*reply, *window_spec_, window_payload_, &windows_);
    windows_came_ = true;
    windows_asked_ = -1;
    return false;
  }
  if (reply->cursor != cursor_ + num_here_) return false;  // It was requested twice.
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
                        const transport::Frame& payload, replay::SampledRows* rows) const {
  base::ThrowIf(reply.batch != spec.batch || reply.history != spec.history,
                "batch {} of the replay server at {} is [{}, {}], expected [{}, {}]", reply.cursor,
                link_.endpoint(), reply.batch, reply.history, spec.batch, spec.history);
  const auto failure = replay::ParseSample(
      payload.bytes(), {reply.batch, reply.history, shape_, reply.weighted}, rows);
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
  if (Ask(spec)) windows_asked_ = num_welcomes_;
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

RemoteSource::RemoteSource(transport::Context& context, transport::ClientOptions replay,
                           proto::Hello hello, const env::StepShape& shape,
                           std::vector<replay::SampleSpec> specs, int prefetch,
                           const PolicyServer& policies, metrics::Registry& registry)
    : context_(context),
      replay_(std::move(replay)),
      hello_(std::move(hello)),
      shape_(shape),
      specs_(std::move(specs)),
      prefetch_(prefetch),
      policies_(policies),
      metrics_(registry) {}

void RemoteSource::Start() {
  if (stream_) return;
  stream_ =
      std::make_unique<BatchStream>(context_, replay_, hello_, shape_, specs_, prefetch_, cursor_);
}

const std::vector<replay::SampledRows>* RemoteSource::Next() {
  const auto began = steady_clock::now();
  const RemoteBatches* const batches = stream_->Next(kBatchWait);
  waited_s_ += std::chrono::duration<double>(steady_clock::now() - began).count();
  waiting_ = batches == nullptr;
  if (waiting_) {
    Say(stream_->link().welcomed() ? "" : "waiting for the replay server");
    return nullptr;
  }
  steps_ = batches->header.inserted_steps;
  table_steps_ = batches->header.table_steps;
  acting_version_ = batches->header.acting_version;
  metrics_.AddBatch();
  return &batches->rows;
}

std::int64_t RemoteSource::num_drawn() const {
  return static_cast<std::int64_t>((stream_ ? stream_->cursor() : cursor_) / specs_.size());
}

EndedEpisodes RemoteSource::TakeEndedEpisodes() {
  return {ended_.mean_cost, std::exchange(ended_.count, 0)};
}

void RemoteSource::SetPriorities(std::span<const std::int64_t> sequence,
                                 std::span<const float> priority) {
  stream_->SetPriorities(sequence, priority);
}

const replay::SampledRows* RemoteSource::SampleForFigures(const replay::SampleSpec& spec) {
  const replay::SampledRows* const came = stream_->TakeWindows();
  stream_->AskWindows(spec);
  return came;
}

void RemoteSource::Describe(run::MetricsRow& row) {
  const proto::StatusReply status = stream_->status().value_or(proto::StatusReply{});
  stream_->AskStatus();
  const ActorFigures acting = Summarise(status);
  ended_.mean_cost = acting.mean_cost;
  ended_.count += finished_episodes_.Take(status);
  row.episodes = acting.num_episodes;
  row.success_rate = acting.success_rate;
  row.collision_rate = acting.collision_rate;
  row.timeout_rate = acting.timeout_rate;
  row.episode_return = acting.mean_return;
  row.episode_steps = acting.mean_length;
  row.table_steps = table_steps_;
}

void RemoteSource::Report(const run::MetricsRow& row, double seconds_left, bool finished) {
  const auto version = static_cast<double>(policies_.version());
  const double lag = version - acting_version_;
  metrics_.SetStream(stream_->in_flight(), lag, stream_->link().connections());
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
  stream_->link().ReportEverySecond([&] { return report; });
}

void RemoteSource::Save(const std::filesystem::path&, nlohmann::json& state) {
  state["cursor"] = stream_->cursor();
}

void RemoteSource::Restore(const std::filesystem::path&, const nlohmann::json& state) {
  cursor_ = static_cast<std::uint64_t>(base::WholeNumber(state.at("cursor")));
  steps_ = base::WholeNumber(state.at("steps"));
}

void RemoteSource::Idle() { stream_->link().Receive(milliseconds(0)); }

void RemoteSource::Say(const std::string& what) {
  if (what == said_) return;
  said_ = what;
  if (!what.empty()) spdlog::info("{} at {}", what, replay_.endpoint);
}

}  // namespace slalom::learner
