#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <variant>

#include "actor/actor.h"
#include "metrics/catalogue.h"
#include "policy/policy_spec.h"
#include "proto/replay_link.h"
#include "replay/rows.h"
#include "replay/service/server.h"
#include "tests/support/fake_environment.h"
#include "tests/support/wait_until.h"

namespace slalom::learner {

inline constexpr int kBeams = 8;
inline constexpr int kStreams = 4;
inline constexpr std::uint64_t kSpecHash = 3;
inline constexpr std::int64_t kSteps = 800;
inline constexpr std::int64_t kActingVersion = 2;
inline constexpr std::int64_t kUpdates = 400;  // What so many steps earn.

using test::WaitUntil;

/// A small network for the robots of this table.
inline policy::PolicySpec SmallSpec() {
  policy::PolicySpec spec;
  spec.observation.num_beams = kBeams;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {16, 16};
  return spec;
}

/// A replay server that holds `num_steps` steps, a multiple of `kStreams`, the same ones each time.
class FilledReplay {
 public:
  explicit FilledReplay(std::int64_t num_steps = kSteps, double updates_per_step = 0.5)
      : registry_("replay", "replay"),
        server_({},
                {.endpoint = "tcp://127.0.0.1:*",
                 .table = {.capacity = 10000},
                 .shape = kBeams,
                 .spec_hash = kSpecHash,
                 .seed = 4,
                 .updates_per_step = updates_per_step,
                 .learning_starts = 0},
                context_, registry_),
        thread_([this](std::stop_token stop) { server_.Run(stop); }) {
    testing::FakeEnvironment environments(kStreams, {0.5}, 20, kBeams);
    testing::SummingAgent agent(kStreams);
    actor::ActorConfig config;
    config.num_environments = kStreams;
    actor::Actor actor(config, environments, agent, 1);
    replay::Chunk chunk(kBeams);
    while (actor.stats().num_steps < num_steps) actor.Step(&chunk);

    transport::Context context;
    proto::Hello hello;
    hello.role = "actor";
    hello.name = "a";
    hello.session = 1;
    hello.spec_hash = kSpecHash;
    hello.num_beams = kBeams;
    hello.num_streams = kStreams;
    service::ReplayLink link(context, {.endpoint = endpoint()}, hello);
    transport::Frame rows(replay::RowBytes::Size(chunk.num_rows(), kBeams));
    replay::RowBytes::Write(chunk, rows.mutable_bytes());
    bool sent = false;
    for (bool safe = false; !safe;) {
      const auto received = link.Receive(std::chrono::milliseconds(100));
      if (link.welcomed() && !sent) {
        sent = link.Send(proto::Insert{.session = 1,
                                       .sequence = 0,
                                       .num_rows = chunk.num_rows(),
                                       .num_beams = kBeams,
                                       .num_steps = static_cast<int>(num_steps),
                                       .oldest_version = kActingVersion,
                                       .newest_version = kActingVersion},
                         rows.Share());
      }
      safe = received && std::holds_alternative<proto::InsertAck>(received->header);
    }
  }

  const std::string& endpoint() const { return server_.endpoint(); }
  /// Ends the server, as a process that is stopped.
  void Stop() {
    thread_.request_stop();
    thread_.join();
  }
  double requests() {
    return registry_.counter(metrics::kMessages, {proto::NameOf(proto::SampleRequest{})}).value();
  }
  double priorities_updated() { return registry_.counter(metrics::kPrioritiesUpdated).value(); }

 private:
  transport::Context context_;
  metrics::Registry registry_;
  replay::ReplayServer server_;
  std::jthread thread_;
};

}  // namespace slalom::learner
