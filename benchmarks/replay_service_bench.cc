// The replay server over loopback TCP at the sizes that training uses: frames of 720 beams, chunks
// of 64 rows, samples of 256. Producers, consumers and the server have contexts (and so ZeroMQ
// threads) of their own, as processes would. Its parts are then measured in process.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "base/check.h"
#include "proto/transport/client.h"
#include "replay/journal.h"
#include "replay/priorities.h"
#include "replay/rows.h"
#include "replay/sample_bytes.h"
#include "replay/service/server.h"

namespace slalom::replay {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr int kBeams = 720;
constexpr int kRows = 64;  // Streams of a producer, and rows of a chunk.
constexpr int kBatch = 256;
constexpr std::int64_t kCapacity = 100000;

double ResidentMegabytes() {
  std::ifstream statm("/proc/self/statm");
  double total = 0.0, resident = 0.0;
  statm >> total >> resident;
  return resident * 4096.0 / 1e6;
}

transport::Frame ChunkBytes(bool first, int num_beams = kBeams) {
  Chunk chunk(num_beams);
  const std::vector<std::uint16_t> scan(static_cast<std::size_t>(num_beams), 250);
  const std::vector<float> state(env::kStateSize, 1.0f);
  const env::FrameView frame{scan, state};
  for (int s = 0; s < kRows; ++s) chunk.AddStep(s, first, frame, {}, {.reward = 1.0f});
  transport::Frame bytes(RowBytes::Size(kRows, num_beams));
  RowBytes::Write(chunk, bytes.mutable_bytes());
  return bytes;
}

/// Keys of server, actor and learner; empty for plaintext.
struct Keys {
  explicit Keys(bool curve) {
    if (!curve) return;
    server = transport::NewKeyPair();
    actor = transport::NewKeyPair();
    learner = transport::NewKeyPair();
  }
  transport::ServerSecurity ForServer() const {
    if (!server) return {};
    return {.keys = server,
            .allowed = {{actor->public_key, transport::Role::kActor},
                        {learner->public_key, transport::Role::kLearner}}};
  }
  transport::ClientSecurity For(const std::optional<transport::KeyPair>& own) const {
    if (!server) return {};
    return {.keys = own, .server_key = server->public_key};
  }

  std::optional<transport::KeyPair> server, actor, learner;
};

/// A server in a thread, with a journal or without.
class Service {
 public:
  Service(bool curve, bool journal)
      : keys_(curve), directory_(std::filesystem::temp_directory_path() / "slalom-replay-bench") {
    std::filesystem::remove_all(directory_);
    ReplayServerConfig config;
    if (journal) config.directory = directory_.string();
    config.max_ahead_steps = 0;
    config.max_messages_per_second = 1e6;
    server_.emplace(config,
                    ReplayServerSpec{.endpoint = "tcp://127.0.0.1:*",
                                     .security = keys_.ForServer(),
                                     .table = {.capacity = kCapacity},
                                     .shape = kBeams,
                                     .updates_per_step = 1e6,
                                     .learning_starts = 0},
                    context_, registry_);
    thread_ = std::jthread([this](std::stop_token stop) { server_->Run(stop); });
  }
  ~Service() {
    thread_.request_stop();
    thread_.join();
    server_.reset();
    std::filesystem::remove_all(directory_);
  }

  const std::string& endpoint() const { return server_->endpoint(); }
  const Keys& keys() const { return keys_; }

 private:
  const Keys keys_;
  const std::filesystem::path directory_;
  transport::Context context_;
  metrics::Registry registry_{"replay", "replay"};
  std::optional<ReplayServer> server_;
  std::jthread thread_;
};

/// One end of a connection.
class Peer {
 public:
  Peer(const Service& service, const transport::ClientSecurity& security)
      : client_(context_, {.endpoint = service.endpoint(), .security = security}) {}

  bool TrySend(transport::Message& message) { return client_.Send(std::move(message)); }
  void Send(const proto::Header& header, transport::Frame payload = {}) {
    transport::Message message = MakeMessage(header, std::move(payload));
    while (!TrySend(message)) transport::Client::WaitForAny({&client_}, milliseconds(1));
  }
  std::optional<transport::Message> Receive(milliseconds timeout) {
    return client_.Receive(timeout);
  }
  proto::Header Expect() {
    const auto message = client_.Receive(std::chrono::seconds(20));
    SLALOM_CHECK(message.has_value());
    const auto header = proto::Decode(message->header.bytes(), message->payload.bytes());
    SLALOM_CHECK(header.ok());
    return *header;
  }

 private:
  transport::Context context_;
  transport::Client client_;
};

/// Sends chunks as fast as its window lets it.
class Producer {
 public:
  Producer(const Service& service, const std::string& name)
      : peer_(service, service.keys().For(service.keys().actor)) {
    peer_.Send(proto::Hello{.role = "actor",
                            .name = name,
                            .session = 1,
                            .num_beams = kBeams,
                            .num_streams = kRows,
                            .software = ""});
    window_ = std::get<proto::Welcome>(peer_.Expect()).window_bytes;
  }

  void SendChunk() {
    const transport::Frame& payload = sent_ == 0 ? first_ : later_;
    const auto size = static_cast<std::int64_t>(payload.size());
    while (static_cast<std::int64_t>(sent_ + 1 - safe_) * size > window_) TakeAcks(true);
    TakeAcks(false);
    peer_.Send(proto::Insert{.session = 1,
                             .sequence = sent_++,
                             .num_rows = kRows,
                             .num_beams = kBeams,
                             .num_steps = kRows},
               payload.Share());
  }
  void Finish() {
    while (safe_ < sent_) TakeAcks(true);
  }

 private:
  void TakeAcks(bool wait) {
    auto message = peer_.Receive(milliseconds(wait ? 1000 : 0));
    for (; message; message = peer_.Receive(milliseconds(0))) {
      const auto header = proto::Decode(message->header.bytes(), message->payload.bytes());
      const auto& ack = std::get<proto::InsertAck>(*header);
      safe_ = ack.next_sequence;
      window_ = ack.window_bytes;
    }
  }

  Peer peer_;
  const transport::Frame first_ = ChunkBytes(true);
  const transport::Frame later_ = ChunkBytes(false);
  std::int64_t window_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t safe_ = 0;
};

/// Keeps some requests under way.
class Consumer {
 public:
  static constexpr std::size_t kAhead = 3;

  Consumer(const Service& service, bool prioritized, bool mirrors = false)
      : peer_(service, service.keys().For(service.keys().learner)), prioritized_(prioritized) {
    if (mirrors) mirror_.emplace(kCapacity, kBeams);
    peer_.Send(
        proto::Hello{.role = "learner", .name = "learner", .num_beams = kBeams, .software = ""});
    SLALOM_CHECK(std::holds_alternative<proto::Welcome>(peer_.Expect()));
  }

  void TakeSample() {
    while (asked_.size() < kAhead) {
      peer_.Send(proto::SampleRequest{.cursor = cursor_++,
                                      .batch = kBatch,
                                      .history = 1,
                                      .n_step = 4,
                                      .gamma = 0.99,
                                      .prioritized = prioritized_,
                                      .importance_exponent = 0.4,
                                      .mirror = mirror_ ? 1U : 0U,
                                      .mirror_places = static_cast<int>(mirror_ ? kCapacity : 0)});
      asked_.push_back(Clock::now());
    }
    if (mirror_) mirror_->Keep();
    message_ = peer_.Receive(std::chrono::seconds(20));
    SLALOM_CHECK(message_.has_value());
    const auto bytes = message_->payload.bytes();
    const auto header = proto::Decode(message_->header.bytes(), bytes);
    const auto& reply = std::get<proto::SampleReply>(*header);
    const SampleShape shape{.batch = reply.batch,
                            .history = reply.history,
                            .step = reply.num_beams,
                            .weighted = reply.weighted};
    const auto fault =
        mirror_ ? ParseMirroredSample(bytes, shape, static_cast<std::size_t>(reply.num_scans),
                                      &*mirror_, &rows_)
                : ParseSample(bytes, shape, &rows_);
    SLALOM_CHECK(!fault.has_value());
    const auto took = Clock::now() - asked_.front();
    milliseconds_.push_back(std::chrono::duration<double, std::milli>(took).count());
    asked_.pop_front();
  }

  /// Percentile of the times from request to reply, with `kAhead` under way, [ms].
  double Percentile(double p) {
    std::sort(milliseconds_.begin(), milliseconds_.end());
    return milliseconds_[static_cast<std::size_t>(p * (milliseconds_.size() - 1))];
  }

 private:
  Peer peer_;
  const bool prioritized_;
  std::uint64_t cursor_ = 0;
  std::deque<Clock::time_point> asked_;
  std::vector<double> milliseconds_;
  std::optional<transport::Message> message_;  // The last one, whose scans the mirror keeps yet.
  std::optional<ScanMirror> mirror_;
  SampledRows rows_;
};

void Fill(Producer* producer) {
  for (std::int64_t rows = 0; rows < kCapacity + kRows; rows += kRows) producer->SendChunk();
  producer->Finish();
}

void InsertOverTcp(benchmark::State& state) {
  Service service(state.range(0) != 0, state.range(1) != 0);
  Producer producer(service, "producer");
  Fill(&producer);
  for (auto _ : state) producer.SendChunk();
  producer.Finish();
  state.SetItemsProcessed(state.iterations() * kRows);
  state.counters["resident_MB"] = ResidentMegabytes();
}
BENCHMARK(InsertOverTcp)
    ->ArgNames({"curve", "journal"})
    ->Args({0, 0})
    ->Args({0, 1})
    ->Args({1, 0})
    ->Args({1, 1})
    ->UseRealTime()
    ->MinTime(2.0)
    ->Unit(benchmark::kMicrosecond);

/// `paced`: frames/s that a producer inserts at the same time; 0: none; -1: as fast as it can.
void SampleOverTcp(benchmark::State& state) {
  const bool curve = state.range(0) != 0;
  const std::int64_t paced = state.range(2);
  Service service(curve, paced != 0);
  Producer producer(service, "producer");
  Fill(&producer);
  Consumer consumer(service, state.range(1) != 0, state.range(3) != 0);
  consumer.TakeSample();
  std::int64_t chunks = 0;
  const auto begin = Clock::now();
  std::jthread inserting([&](std::stop_token stop) {
    if (paced == 0) return;
    for (; !stop.stop_requested(); ++chunks) {
      if (paced > 0) {
        std::this_thread::sleep_until(
            begin + std::chrono::nanoseconds(chunks * kRows * 1000000000 / paced));
      }
      producer.SendChunk();
    }
    producer.Finish();
  });
  for (auto _ : state) consumer.TakeSample();
  inserting.request_stop();
  inserting.join();
  const double elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
  state.SetItemsProcessed(state.iterations() * kBatch);
  state.counters["p50_ms"] = consumer.Percentile(0.5);
  state.counters["p99_ms"] = consumer.Percentile(0.99);
  state.counters["inserted/s"] = static_cast<double>(chunks * kRows) / elapsed;
  state.counters["resident_MB"] = ResidentMegabytes();
}
BENCHMARK(SampleOverTcp)
    ->ArgNames({"curve", "prioritized", "inserting", "mirror"})
    ->Args({0, 0, 0, 0})
    ->Args({0, 0, 0, 1})
    ->Args({0, 1, 0, 0})
    ->Args({0, 0, 50000, 0})
    ->Args({0, 0, 50000, 1})
    ->Args({0, 0, -1, 0})
    ->Args({1, 0, 0, 0})
    ->Args({1, 0, 0, 1})
    ->Args({1, 0, 50000, 0})
    ->Args({1, 0, 50000, 1})
    ->UseRealTime()
    ->MinTime(2.0)
    ->Unit(benchmark::kMicrosecond);

/// Samples of several servers that share the rows, as one learner takes them, in turn.
void SampleFromServers(benchmark::State& state) {
  std::deque<Service> services;
  std::deque<Consumer> consumers;
  for (int i = 0; i < state.range(1); ++i) {
    const Service& service = services.emplace_back(state.range(0) != 0, /*journal=*/false);
    Producer producer(service, "producer");
    Fill(&producer);
    consumers.emplace_back(service, /*prioritized=*/false, state.range(2) != 0).TakeSample();
  }
  std::size_t turn = 0;
  for (auto _ : state) consumers[turn++ % consumers.size()].TakeSample();
  state.SetItemsProcessed(state.iterations() * kBatch);
}
BENCHMARK(SampleFromServers)
    ->ArgNames({"curve", "servers", "mirror"})
    ->ArgsProduct({{0, 1}, {1, 2}, {0, 1}})
    ->UseRealTime()
    ->MinTime(2.0)
    ->Unit(benchmark::kMicrosecond);

/// Episodes that never end: nearly all rows may be drawn.
Table FullTable(bool prioritized, std::int64_t num_rows = 500000, int num_beams = kBeams) {
  Table table({.capacity = num_rows}, num_beams);
  if (prioritized) table.UsePriorities(0.6);
  const transport::Frame first = ChunkBytes(true, num_beams), later = ChunkBytes(false, num_beams);
  for (std::int64_t i = 0; table.num_rows() < num_rows; ++i) {
    const auto rows = RowBytes::Parse((i == 0 ? first : later).bytes(), kRows, num_beams, kRows);
    table.InsertRows(*rows, 0);
  }
  return table;
}

void SampleInProcess(benchmark::State& state) {
  const bool prioritized = state.range(0) != 0;
  Table table = FullTable(prioritized);
  base::Random random(1);
  Batch batch;
  const SampleSpec spec{.batch = kBatch,
                        .history = 1,
                        .n_step = 4,
                        .prioritized = prioritized,
                        .importance_exponent = 0.4};
  for (auto _ : state) SLALOM_CHECK(table.Sample(spec, random, &batch));
  state.SetItemsProcessed(state.iterations() * kBatch);
}
BENCHMARK(SampleInProcess)->ArgName("prioritized")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

/// Of rows without scans, as a hundred million with scans would take 149 GB.
void SampleOfMany(benchmark::State& state) {
  const bool prioritized = state.range(0) != 0;
  const Table table = FullTable(prioritized, state.range(1), /*num_beams=*/0);
  base::Random random(1);
  SampledRows rows;
  const SampleSpec spec{.batch = kBatch,
                        .history = 1,
                        .n_step = 4,
                        .prioritized = prioritized,
                        .importance_exponent = 0.4};
  for (auto _ : state) SLALOM_CHECK(table.SampleRows(spec, random, &rows));
  state.SetItemsProcessed(state.iterations() * kBatch);
}
BENCHMARK(SampleOfMany)
    ->ArgNames({"prioritized", "rows"})
    ->ArgsProduct({{0, 1}, {1000000, 10000000, 100000000}})
    ->Iterations(5000)
    ->Unit(benchmark::kMicrosecond);

void DrawByPriority(benchmark::State& state) {
  base::Random random(1);
  Priorities priorities(state.range(0), 0.6);
  for (std::int64_t i = 0; i < state.range(0); ++i) priorities.Set(i, 0.01 + random.Uniform());
  std::vector<std::int64_t> slots(kBatch);
  for (auto _ : state) {
    priorities.Draw(random, slots);
    benchmark::DoNotOptimize(slots.data());
  }
  state.SetItemsProcessed(state.iterations() * kBatch);
}
BENCHMARK(DrawByPriority)
    ->ArgName("slots")
    ->Arg(200000)
    ->Arg(1000000)
    ->Unit(benchmark::kMicrosecond);

/// Recovers a table from the files of a number of steps (in the page cache).
void Recover(benchmark::State& state) {
  const std::int64_t rows = state.range(0);
  const auto directory = std::filesystem::temp_directory_path() / "slalom-recover-bench";
  std::filesystem::remove_all(directory);
  const JournalOptions options{.directory = directory, .shape = kBeams};
  const transport::Frame first = ChunkBytes(true), later = ChunkBytes(false);
  {
    Sessions sessions;
    Session session{.id = 1, .name = "a", .number = 1};
    session.num_streams = kRows;
    const StateRecord begin;
    Journal journal(options, JournalLock(directory), {}, 1, begin, [] {});
    SLALOM_CHECK(sessions.Put(session).ok());
    journal.Append(SessionRecord{session});
    for (std::int64_t row = 0; row < rows; row += kRows) {
      if (journal.segment_full()) {
        journal.BeginSegment(
            {.first_row = row, .open = std::vector<std::uint8_t>(kRows, 1), .sessions = sessions},
            0);
      }
      const std::uint64_t k = row / kRows;
      journal.Append(RowsRecord{.id = 1,
                                .num_rows = kRows,
                                .num_steps = kRows,
                                .sequence = k,
                                .first_row = row,
                                .rows = (k == 0 ? first : later).bytes()},
                     nullptr);
      SLALOM_CHECK(!sessions.Accept(1, k, kRows));
    }
  }
  for (auto _ : state) {
    const Recovered recovered = RecoverJournal(options, {.capacity = rows});
    SLALOM_CHECK_GE(recovered.table.num_steps(), rows);
  }
  state.SetItemsProcessed(state.iterations() * rows);
  std::filesystem::remove_all(directory);
}
BENCHMARK(Recover)->ArgName("steps")->Arg(100000)->Arg(1000000)->Iterations(1)->UseRealTime()->Unit(
    benchmark::kMillisecond);

}  // namespace
}  // namespace slalom::replay
