#include "learner/service/remote_source.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json.h"
#include "base/log.h"
#include "metrics/catalogue.h"

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
