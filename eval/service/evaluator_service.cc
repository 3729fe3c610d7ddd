#include "eval/service/evaluator_service.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "metrics/catalogue.h"

namespace slalom::eval {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kWait{100};

proto::Hello MakeHello(const EvaluatorIdentity& identity, int num_beams) {
  proto::Hello hello;
  hello.role = "evaluator";
  hello.name = identity.name;
  hello.spec_hash = identity.spec_hash;
  hello.num_beams = num_beams;
  return hello;
}

}  // namespace

EvaluatorService::EvaluatorService(const EvaluatorServiceConfig& config, EvaluationTask task,
                                   EvaluatorIdentity identity, ReadPolicy read_policy,
                                   base::ParallelFor& parallel, transport::Context& context,
                                   metrics::Registry& registry)
    : config_(config),
      task_(std::move(task)),
      identity_(std::move(identity)),
      read_policy_(std::move(read_policy)),
      parallel_(parallel),
      registry_(registry),
      scores_(identity_.state_directory / "scores.csv", identity_.course_set),
      replay_(context, identity_.replay, MakeHello(identity_, task_.environment.lidar.num_beams)),
      policy_(context, identity_.learner, identity_.name,
              [this](std::span<const std::byte> policy) {
                // Read when it is scored: most are replaced before.
                newest_.assign(reinterpret_cast<const char*>(policy.data()), policy.size());
                return std::nullopt;
              },
              {.shipped = true}) {
  if (fs::exists(best())) best_success_rate_ = scores_.best_before();
  registry_.counter(metrics::kEvaluations);
  registry_.counter(metrics::kPoliciesRejected);
}

void EvaluatorService::Listen() {
  while (replay_.Receive(milliseconds(0))) {
  }
  if (policy_.Poll()) {
    registry_.counter(metrics::kPoliciesReceived).Increment();
    registry_.gauge(metrics::kPolicyVersion).Set(static_cast<double>(policy_.version()));
  }
  registry_.counter(metrics::kConnections, {"replay"}).RaiseTo(replay_.connections());
  registry_.counter(metrics::kConnections, {"learner"}).RaiseTo(policy_.connections());
  replay_.ReportEverySecond([this] { return MakeReport(); });
}

void EvaluatorService::Run(std::stop_token stop) {
  spdlog::info("waiting for the learner's first policy at {}", identity_.learner.endpoint);
  auto next = steady_clock::now();
  while (!stop.stop_requested()) {
    Listen();
    if (policy_.version() == scored_version_ || !policy_.has_policy() ||
        steady_clock::now() < next) {
      transport::Client::WaitForAny({&replay_.client(), &policy_.client()}, kWait);
      continue;
    }
    next = steady_clock::now() + std::chrono::duration_cast<steady_clock::duration>(
                                     std::chrono::duration<double>(config_.interval));
    Score(stop);
  }
}

void EvaluatorService::Score(std::stop_token stop) {
  const std::int64_t version = policy_.version();
  const std::string policy = newest_;
  const auto make_agent = read_policy_(std::as_bytes(std::span(policy)));
  if (!make_agent) {
    const std::string text = fmt::format("policy {} of the learner at {}: {}", version,
                                         identity_.learner.endpoint, make_agent.failure().text);
    if (num_scored_ == 0) throw base::Error(text);
    spdlog::error("{}; it is not scored", text);
    registry_.counter(metrics::kPoliciesRejected).Increment();
    scored_version_ = version;
    return;
  }
  const auto began = steady_clock::now();
  const auto evaluation = EvaluateOnCourses(
      task_, *make_agent, &parallel_, [this](const EpisodeCount&) { Listen(); }, std::move(stop));
  if (!evaluation) return;
  const double seconds = std::chrono::duration<double>(steady_clock::now() - began).count();
  // First the policy: a score that says "kept" without it would keep later ones from being saved.
  const bool kept = KeepBest(policy, evaluation->summary.set.success_rate.value);
  Record(*evaluation, version, seconds, kept);
}

bool EvaluatorService::KeepBest(std::string_view policy, double success_rate) {
  if (success_rate <= best_success_rate_) return false;
  try {
    base::WriteFileAtomically(best(), policy);
    best_success_rate_ = success_rate;
    return true;
  } catch (const base::Error& error) {
    spdlog::error("{}; the best policy so far is not kept", error.what());
    return false;
  }
}

void EvaluatorService::Record(const Evaluation& evaluation, std::int64_t version, double seconds,
                              bool kept) {
  const Figures& set = evaluation.summary.set;
  const Interval interval = set.success_rate.interval.value_or(Interval{0.0, 1.0});
  const double time =
      set.traversal_time ? set.traversal_time->value : std::numeric_limits<double>::quiet_NaN();
  if (const auto failure = scores_.Append(set, version, seconds, kept)) {
    spdlog::error("{}; the score is in the log alone", failure->text);
  }
  const std::string_view courses = identity_.course_set;
  registry_.counter(metrics::kEvaluations).Increment();
  registry_.gauge(metrics::kEvaluationVersion).Set(static_cast<double>(version));
  registry_.gauge(metrics::kEvaluationSuccessRate, {courses}).Set(set.success_rate.value);
  registry_.gauge(metrics::kEvaluationCollisionRate, {courses}).Set(set.collision_rate.value);
  registry_.gauge(metrics::kEvaluationTimeoutRate, {courses}).Set(set.timeout_rate.value);
  registry_.gauge(metrics::kEvaluationTime, {courses}).Set(time);
  registry_.gauge(metrics::kEvaluationScore, {courses}).Set(set.barn_score.value);
  registry_.gauge(metrics::kEvaluationDuration).Set(seconds);
  scored_version_ = version;
  success_rate_ = set.success_rate.value;
  ++num_scored_;
  spdlog::info(
      "policy {}: success {:.1f} % ({:.1f}-{:.1f}), collision {:.1f} %, time {} on "
      "{} ({} episodes, {:.1f} s)",
      version, 100.0 * success_rate_, 100.0 * interval.low, 100.0 * interval.high,
      100.0 * set.collision_rate.value, std::isnan(time) ? "-" : fmt::format("{:.2f} s", time),
      courses, set.num_episodes, seconds);
}

proto::Report EvaluatorService::MakeReport() const {
  proto::Report report;
  report.role = "evaluator";
  report.name = identity_.name;
  report.figures = {{"evaluations", static_cast<double>(num_scored_)},
                    {"policy_version", static_cast<double>(policy_.version())}};
  if (num_scored_ > 0) {
    report.figures["scored_version"] = static_cast<double>(scored_version_);
    report.figures["success_rate"] = success_rate_;
  }
  report.facts = {{"courses", identity_.course_set}};
  return report;
}

}  // namespace slalom::eval
