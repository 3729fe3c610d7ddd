// sessions CONFIG FIRST COUNT SECONDS: sessions of actors FIRST to FIRST + COUNT - 1 with a service
// that runs, by the protocol of actors and with frames of their size, in one thread. Each makes a
// chunk of 10 frames every 200 ms, as a robot does that sees 50 scans a second, and takes each new
// policy. benchmarks/service_figures.py starts it and the service.
//
// Prints once a second "SECONDS CONNECTED ACKNOWLEDGED" and, after each quarter of the time, of
// that quarter the times from a chunk's first sending to its acknowledgement and from a policy's
// publication to its arrival: "acknowledged COUNT P50 P99 LONGEST" [ms], "policies ...".

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "actor/service/outbox.h"
#include "app/train/run_config.h"
#include "app/train/run_identity.h"
#include "app/train/service_process.h"
#include "base/config.h"
#include "proto/policy_link.h"
#include "proto/replay_link.h"
#include "replay/rows.h"

namespace slalom {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr int kFrames = 10;
constexpr milliseconds kEvery{200};
constexpr int kSessionsOfContext = 100;

/// Percentiles of times in milliseconds.
void Print(const char* what, std::vector<double> times) {
  std::ranges::sort(times);
  const auto at = [&](double share) {
    return times.empty() ? 0.0 : times[static_cast<std::size_t>(share * (times.size() - 1))];
  };
  fmt::print("{} {} {:.1f} {:.1f} {:.1f}\n", what, times.size(), at(0.5), at(0.99), at(1.0));
}

struct Times {
  std::vector<double> acknowledged;
  std::vector<double> policies;
};

class Session {
 public:
  Session(const train::RunConfig& config, int number, transport::Context& context, Times* times)
      : times_(times),
        beams_(train::StepShapeOf(config).num_beams),
        link_(context, Options(config, number), HelloOf(config, number)),
        policy_(context, {.endpoint = config.service.learner}, link_.hello().name,
                [](std::span<const std::byte>) { return std::optional<base::Failure>(); },
                {.without_model = true}),
        due_(Clock::now() + kEvery * (number % 100) / 100) {
    outbox_.Begin(1);
  }

  bool welcomed() const { return link_.welcomed(); }
  std::uint64_t safe() const { return safe_; }

  void Turn(Clock::time_point now) {
    while (auto received = link_.Receive(milliseconds(0))) {
      if (const auto* welcome = std::get_if<proto::Welcome>(&received->header)) {
        window_ = welcome->window_bytes;
        Acknowledge(welcome->next_sequence, now);
        SLALOM_CHECK(outbox_.Resume(welcome->next_sequence));
      } else if (const auto* ack = std::get_if<proto::InsertAck>(&received->header)) {
        window_ = ack->window_bytes;
        Acknowledge(ack->next_sequence, now);
      }
    }
    if (policy_.Poll()) times_->policies.push_back(1e3 * policy_.latency_s());
    if (now >= due_ && !outbox_.full()) {
      due_ += kEvery;
      AddChunk();
    }
    while (link_.welcomed()) {
      const actor::OutgoingChunk* const chunk = outbox_.NextToSend(window_);
      if (chunk == nullptr || !link_.Send(chunk->header, chunk->payload.Share())) break;
      if (chunk->header.sequence >= safe_ + sent_at_.size()) sent_at_.push_back(now);
      outbox_.MarkSent();
    }
    link_.ReportEverySecond([&] {
      proto::Report report;
      report.role = "actor";
      report.name = link_.hello().name;
      report.figures = {{"steps_made", static_cast<double>(num_made_ * kFrames)}};
      return report;
    });
  }

 private:
  static transport::ClientOptions Options(const train::RunConfig& config, int number) {
    const auto num_servers = static_cast<int>(config.service.replay.size());
    const int shard = train::ShardOf(std::to_string(number), num_servers);
    return {.endpoint = config.service.replay[static_cast<std::size_t>(shard)]};
  }
  static proto::Hello HelloOf(const train::RunConfig& config, int number) {
    proto::Hello hello;
    hello.role = "actor";
    hello.name = fmt::format("session-{}", number);
    hello.session = 1;
    hello.spec_hash = train::SpecHash(config);
    hello.num_beams = train::StepShapeOf(config).num_beams;
    hello.num_streams = 1;
    hello.run = train::ServiceIdentity(config);
    return hello;
  }

  void Acknowledge(std::uint64_t next, Clock::time_point now) {
    outbox_.Acknowledge(next);
    for (; safe_ < next; ++safe_) {
      if (sent_at_.empty()) continue;
      const std::chrono::duration<double, std::milli> took = now - sent_at_.front();
      times_->acknowledged.push_back(took.count());
      sent_at_.pop_front();
    }
  }

  void AddChunk() {
    replay::Chunk chunk(beams_);
    const std::vector<std::uint16_t> scan(static_cast<std::size_t>(beams_), 250);
    const std::vector<float> state(env::kStateSize, 0.5f);
    for (int i = 0; i < kFrames; ++i) {
      chunk.AddStep(0, num_made_ == 0 && i == 0, {scan, state}, {}, {.reward = 1.0f});
    }
    ++num_made_;
    transport::Frame payload(replay::RowBytes::Size(kFrames, beams_));
    replay::RowBytes::Write(chunk, payload.mutable_bytes());
    const std::int64_t version = policy_.version();
    outbox_.Add({.num_rows = kFrames,
                 .num_beams = beams_,
                 .num_steps = kFrames,
                 .oldest_version = version,
                 .newest_version = version},
                std::move(payload));
  }

  Times* const times_;
  const int beams_;
  service::ReplayLink link_;
  service::PolicyLink policy_;
  actor::Outbox outbox_{1 << 20};
  std::int64_t window_ = 0;
  std::int64_t num_made_ = 0;
  std::uint64_t safe_ = 0;
  std::deque<Clock::time_point> sent_at_;  // Of the chunks from `safe_` on.
  Clock::time_point due_;
};

int Run(const std::string& file, int first, int count, int seconds) {
  const auto config = config::Load<train::RunConfig>(file, {});
  std::deque<transport::Context> contexts;  // A context has 1,023 sockets at most.
  Times times;
  std::vector<std::unique_ptr<Session>> sessions;
  for (int i = 0; i < count; ++i) {
    if (i % kSessionsOfContext == 0) contexts.emplace_back();
    sessions.push_back(std::make_unique<Session>(config, first + i, contexts.back(), &times));
  }
  const auto begin = Clock::now();
  auto next_line = begin + std::chrono::seconds(1);
  for (int line = 1; line <= seconds;) {
    const auto now = Clock::now();
    for (const auto& session : sessions) session->Turn(now);
    if (now >= next_line) {
      const auto connected = std::ranges::count_if(sessions, &Session::welcomed);
      std::uint64_t safe = 0;
      for (const auto& session : sessions) safe += session->safe();
      fmt::print("{} {} {}\n", line, connected, safe);
      if (line % (seconds / 4) == 0) {
        Print("acknowledged", std::exchange(times.acknowledged, {}));
        Print("policies", std::exchange(times.policies, {}));
      }
      std::fflush(stdout);
      next_line += std::chrono::seconds(1);
      ++line;
    }
    std::this_thread::sleep_for(milliseconds(10));
  }
  return 0;
}

}  // namespace
}  // namespace slalom

int main(int argc, char** argv) {
  if (argc != 5) {
    fmt::print(stderr, "usage: sessions CONFIG FIRST COUNT SECONDS\n");
    return 2;
  }
  return slalom::Run(argv[1], std::atoi(argv[2]), std::atoi(argv[3]), std::atoi(argv[4]));
}
