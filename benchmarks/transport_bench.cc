#include <benchmark/benchmark.h>

#include <chrono>
#include <cstdint>
#include <thread>
#include <utility>

#include "proto/transport/client.h"
#include "proto/transport/server.h"

/// Throughput of the sockets over loopback TCP, plaintext (0) and CURVE (1), between two threads
/// with a context each, as between two processes.
/// - `OneWay`: an actor's chunk of 64 rows of 720 beams, 95 kB.
/// - `RequestReply`: a learner's batch of 256 with n-step 4, 740 kB, two requests under way; and
///   the time there and back of a message of no size.

namespace slalom::transport {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kChunkBytes = 95'000;
constexpr std::size_t kBatchBytes = 740'000;

/// Options of both ends, and the keys between them.
struct Ends {
  explicit Ends(bool curve) {
    server.endpoint = "tcp://127.0.0.1:*";
    server.max_messages_per_second = 1e9;
    if (!curve) return;
    const KeyPair server_keys = NewKeyPair();
    const KeyPair client_keys = NewKeyPair();
    server.security = {server_keys, {{client_keys.public_key, Role::kActor}}};
    client.security = {client_keys, server_keys.public_key};
  }
  ServerOptions server;
  ClientOptions client;
};

void OneWay(benchmark::State& state) {
  Ends ends(state.range(0) != 0);
  Context server_context;
  Server server(server_context, ends.server);
  ends.client.endpoint = server.endpoint();
  std::jthread sender([&](const std::stop_token& stop) {
    Context context;
    Client client(context, ends.client);
    Frame payload(kChunkBytes);
    while (!stop.stop_requested()) {
      Message message{Frame::Copy("header of an insert"), payload.Share()};
      while (!stop.stop_requested() && !client.Send(std::move(message))) client.Receive(1ms);
    }
  });
  while (!server.Receive(100ms)) {
  }
  for (auto _ : state) {
    while (!server.Receive(100ms)) {
    }
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(kChunkBytes));
  state.SetItemsProcessed(state.iterations());
}

void RequestReply(benchmark::State& state) {
  Ends ends(state.range(0) != 0);
  const auto reply_bytes = static_cast<std::size_t>(state.range(1));
  const int num_under_way = static_cast<int>(state.range(2));
  Context server_context;
  Server server(server_context, ends.server);
  ends.client.endpoint = server.endpoint();
  std::jthread answerer([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const auto request = server.Receive(100ms);
      if (!request) continue;
      // A buffer of its own for each, as for a batch that was just drawn.
      Message reply{Frame::Copy("header of a sample"), Frame(reply_bytes)};
      if (server.Send(request->peer, std::move(reply)) != Server::Sent::kYes) return;
    }
  });
  Context context;
  Client client(context, ends.client);
  const auto request = [&] {
    while (!client.Send({Frame::Copy("sample request"), Frame()})) client.Receive(1ms);
  };
  const auto wait = [&] {
    while (!client.Receive(100ms)) {
    }
  };
  for (int i = 0; i < num_under_way; ++i) request();
  for (auto _ : state) {
    wait();
    request();
  }
  for (int i = 0; i < num_under_way; ++i) wait();
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(reply_bytes));
  state.SetItemsProcessed(state.iterations());
}

BENCHMARK(OneWay)->Arg(0)->Arg(1)->MeasureProcessCPUTime()->UseRealTime()->ArgName("curve");
BENCHMARK(RequestReply)
    ->ArgNames({"curve", "bytes", "under_way"})
    ->Args({0, kBatchBytes, 2})
    ->Args({1, kBatchBytes, 2})
    ->Args({0, 0, 1})
    ->Args({1, 0, 1})
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
}  // namespace slalom::transport
