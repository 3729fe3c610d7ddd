// write_fuzz_seeds DIRECTORY: good inputs of each fuzzer, with which its corpus began, in
// DIRECTORY/FUZZER/seed-N. What the fuzzers found from there on stands beside them.

#include <cstdio>
#include <map>

#include "actor/actor_state.h"
#include "actor/service/ledger.h"
#include "actor/service/outbox.h"
#include "base/file.h"
#include "policy/policy.h"
#include "proto/messages.h"
#include "replay/journal.h"
#include "replay/manifest.h"
#include "replay/rows.h"
#include "replay/sample_bytes.h"
#include "sim/courses/course_file.h"
#include "sim/courses/episode_file.h"

namespace slalom::fuzz {
namespace {

using Seeds = std::vector<std::string>;

void Append(std::string* text, std::span<const std::byte> bytes) {
  text->append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}
template <class T>
void AppendNumber(std::string* text, T value) {
  text->append(reinterpret_cast<const char*>(&value), sizeof(value));
}
template <class T>
void AppendColumn(std::string* text, const std::vector<T>& column) {
  Append(text, std::as_bytes(std::span(column)));
}

/// Two streams: an episode that ends in a collision, and the beginning of one.
replay::Chunk MakeChunk(int beams) {
  replay::Chunk chunk(beams);
  const std::vector<std::uint16_t> ranges(static_cast<std::size_t>(beams), 300);
  const float state[env::kStateSize] = {1.0f, -0.5f, 0.25f, 0.0f};
  const env::FrameView frame{ranges, state};
  chunk.AddStep(0, true, frame, std::array{0.5f, 0.1f}, {.reward = 1.0f});
  chunk.AddStep(1, true, frame, std::array{0.5f, -0.1f}, {.reward = 1.0f});
  chunk.AddStep(0, false, frame, std::array{1.0f, 0.0f},
                {.reward = -1.0f, .cost = 1.0f, .outcome = env::Outcome::kCollision});
  chunk.AddFinal(0, frame);
  return chunk;
}

std::string RowsOf(const replay::Chunk& chunk) {
  std::string rows(replay::RowBytes::Size(chunk.num_rows(), chunk.shape), '\0');
  std::vector<std::uint64_t> aligned(rows.size() / 8 + 1);
  const auto bytes = std::as_writable_bytes(std::span(aligned)).first(rows.size());
  replay::RowBytes::Write(chunk, bytes);
  std::memcpy(rows.data(), bytes.data(), rows.size());
  return rows;
}

Seeds MessageSeeds() {
  const proto::Report report{.role = "actor",
                             .name = "actor-1",
                             .figures = {{"steps", 3.5}, {"rate", 1e9}},
                             .facts = {{"courses", "static"}}};
  const proto::Header headers[] = {
      proto::Hello{"actor", "actor-1", 7, 1234567890123, 720, 16, "slalom 0.1.0"},
      proto::Welcome{1, 7, 3, 1 << 20, 6, 1000, "slalom 0.1.0"},
      proto::Insert{7, 300, 64, 720, 60, 1, 2},
      proto::InsertAck{7, 301, 1 << 20},
      proto::Goodbye{7},
      proto::SampleRequest{9, 256, 4, 5, 0.99, true, 0.4},
      proto::SampleReply{9, 256, 4, 720, true, 1000, 900, 1.5},
      proto::PriorityUpdate{256},
      proto::SnapshotRequest{-1, "evaluator"},
      proto::Snapshot{43, 1234567890123, 1700000000, 5},
      report,
      proto::StatusRequest{},
      proto::StatusReply{{{report, 0.5, true}, {report, 2.0, false}}, 1},
      proto::Refusal{proto::RefusalCode::kOutOfOrder, "expected chunk 301", 303}};
  Seeds seeds;
  for (const proto::Header& header : headers) seeds.push_back(proto::Encode(header, {}));
  return seeds;
}

Seeds RowsSeeds() {
  constexpr int kBeams = 2;
  std::string seed("\x01\x03\x0f\x01\x01", 5);  // Beams, streams, capacity, history, n_step.
  const replay::Chunk chunk = MakeChunk(kBeams);
  for (int i = 0; i < 2; ++i) {
    seed += static_cast<char>(chunk.num_rows());
    seed += static_cast<char>(2 * i);  // Base of the streams.
    seed += '\x0f';                    // Nothing is cut.
    seed += RowsOf(chunk);
  }
  return {seed};
}

Seeds SampleSeeds() {
  replay::Table table({.capacity = 16}, 2);
  table.Insert(MakeChunk(2));
  replay::SampledRows rows;
  base::Random random(1);
  Seeds seeds;
  for (const bool weighted : {false, true}) {
    if (!table.SampleRows({.batch = 2, .history = 2, .n_step = 1}, random, &rows)) continue;
    const auto size = replay::SampleSize({2, 2, 2, weighted}).value();
    std::vector<std::uint64_t> aligned(size / 8 + 1);
    const auto bytes = std::as_writable_bytes(std::span(aligned)).first(size);
    replay::WriteSample(rows, weighted, bytes);
    std::string seed = {static_cast<char>(weighted), 1, 1, 1, 1};
    Append(&seed, bytes);
    seeds.push_back(seed);
  }
  return seeds;
}

Seeds PolicySeeds() {
  policy::PolicySnapshot snapshot;
  snapshot.version = 3;
  snapshot.spec.observation.num_beams = 4;
  snapshot.spec.network.sectors = 2;
  snapshot.spec.network.encoder_layers = {2};
  snapshot.spec.network.head_layers = {};
  const auto size = static_cast<std::size_t>(snapshot.spec.actor_shape().num_parameters());
  snapshot.weights = std::make_shared<const std::vector<float>>(size, 0.5f);
  std::string with = policy::PrintPolicy(snapshot, {{"commit", "abc"}});
  // Another key in the checksum's place, so that the weights may change.
  std::string without = with;
  without.replace(without.find("checksum_xxh3"), 13, "Checksum_xxh3");
  return {with, without};
}

Seeds ManifestSeeds() {
  replay::Manifest manifest{.shape = 720,
                            .capacity = 1000,
                            .begin = 10,
                            .end = 300,
                            .open = {1, 0, 1},
                            .part_files = {{"replay-000001.rows", 0, 200, 0x1234},
                                           {"replay-000002.rows", 200, 300, 0xabcdef}}};
  const std::string text = replay::PrintManifest(manifest);
  return {text, text.substr(0, text.rfind("checksum"))};
}

Seeds ActorStateSeeds() {
  actor::ActorState state;
  state.seed = 5;
  state.num_steps = 100;
  state.num_episodes = 3;
  state.recent = {{env::Outcome::kSuccess, 30, 12.5f}, {env::Outcome::kCollision, 3, -1.0f}};
  state.open.resize(2);
  state.open[0].actions = {0.5f, 0.25f, 1.0f, -1.0f};
  state.sampler = {.num_fresh_draws = 9,
                   .named = {{0, 1.5f, 0.5f}},
                   .candidates = {{4, 1.0f, 0.0f}},
                   .learnable = {{2, 3.0f, 1.0f}},
                   .recent = {{2, 3.0f, 1.0f}, {3, 0.0f, 4.0f}}};
  const std::string bytes = state.Serialize();
  return {bytes, bytes.substr(0, bytes.size() - 8)};
}

Seeds EpisodesSeeds() {
  const std::vector<sim::EpisodeTrack> tracks = {
      {.course = "barn-007",
       .outcome = env::Outcome::kSuccess,
       .poses = {{{-2.0, 3.0}, 1.57}, {{-1.5, 3.5}, 1.0}},
       .episode = 1,
       .step = 0.2,
       .motion_start = 0.5,
       .beams = sim::TrackBeams{{0.12, 0.0}, -2.3, 0.05},
       .scans_cm = {{120, 130}, {110, 100}}},
      {.course = "barn-008", .outcome = env::Outcome::kTimeout, .poses = {{{0.0, 0.0}, 0.0}}}};
  return {sim::PrintEpisodes(tracks)};
}

/// Rows as the columns of a part file.
Seeds PartFileSeeds() {
  const replay::Chunk chunk = MakeChunk(2);
  // Beams, first row, rows, overwritten, spare capacity, streams, nothing cut off.
  std::string seed("\x01\x00\x03\x00\x03\x02\x00", 7);
  AppendColumn(&seed, chunk.stream);
  AppendColumn(&seed, chunk.flags);
  AppendColumn(&seed, chunk.ranges_cm);
  AppendColumn(&seed, chunk.state);
  AppendColumn(&seed, chunk.action);
  AppendColumn(&seed, chunk.reward);
  AppendColumn(&seed, chunk.cost);
  return {seed};
}

Seeds JournalSeeds() {
  replay::StateRecord state;
  replay::Session session;
  session.id = 1;
  session.name = "actor-1";
  session.number = 7;
  session.num_streams = 2;
  const std::string rows = RowsOf(MakeChunk(2));
  replay::RowsRecord chunk;
  chunk.id = 1;
  chunk.num_rows = 4;
  chunk.num_steps = 3;
  chunk.rows = std::as_bytes(std::span(rows));
  replay::Session ended = session;
  ended.next_sequence = 1;
  ended.accepted_steps = 3;
  ended.ended = true;
  // Beams, nothing cut off, records, the first row.
  std::string seed("\x01\x00\x01\x00", 4);
  for (const replay::RecordBytes& record :
       {replay::PrintRecord(state), replay::PrintRecord(replay::SessionRecord{session}),
        replay::PrintRecord(chunk), replay::PrintRecord(replay::SessionRecord{ended}),
        replay::PrintRecord(replay::ForgetRecord{1})}) {
    seed += static_cast<char>(record.type);
    seed += static_cast<char>(record.head.size());
    Append(&seed, record.head);
    if (record.type == 4) {
      AppendNumber(&seed, static_cast<std::uint16_t>(record.rows.size()));
      Append(&seed, record.rows);
    }
  }
  return {seed};
}

/// The beginning of a spool without its checksum, and a whole one.
Seeds SpoolSeeds() {
  const auto path = std::filesystem::temp_directory_path() / "slalom-seed-spool";
  actor::Outbox outbox(1 << 20);
  outbox.Begin(7);
  const std::string rows = RowsOf(MakeChunk(2));
  for (int i = 0; i < 2; ++i) {
    outbox.Add({.num_rows = 4, .num_beams = 2, .num_steps = 3, .newest_version = 5},
               transport::Frame::Copy(rows));
  }
  outbox.SaveSpool(path, 2);
  const std::string bytes = base::ReadFile(path);
  std::filesystem::remove(path);
  return {std::string(1, '\1') + bytes.substr(0, bytes.size() - 8), std::string(1, '\0') + bytes};
}

Seeds LedgerSeeds() {
  const auto path = std::filesystem::temp_directory_path() / "slalom-seed-ledger";
  {
    actor::Ledger ledger(path);
    ledger.BeginSession(1, 0, actor::LossReason::kKilled);
    ledger.AddMade(100);
    ledger.AcknowledgeAllBut(40);
    ledger.BeginSession(2, 70, actor::LossReason::kKilled);
    ledger.AddMade(5);
  }
  const std::string bytes = base::ReadFile(path);
  std::filesystem::remove(path);
  return {bytes, ""};
}

}  // namespace
}  // namespace slalom::fuzz

int main(int argc, char** argv) {
  using namespace slalom;
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_fuzz_seeds DIRECTORY\n");
    return 2;
  }
  const std::map<std::string, fuzz::Seeds> all = {
      {"actor_state", fuzz::ActorStateSeeds()}, {"episodes", fuzz::EpisodesSeeds()},
      {"journal", fuzz::JournalSeeds()},        {"manifest", fuzz::ManifestSeeds()},
      {"message", fuzz::MessageSeeds()},        {"part_file", fuzz::PartFileSeeds()},
      {"policy", fuzz::PolicySeeds()},          {"rows", fuzz::RowsSeeds()},
      {"sample", fuzz::SampleSeeds()},          {"spool", fuzz::SpoolSeeds()},
      {"ledger", fuzz::LedgerSeeds()},
  };
  for (const auto& [name, seeds] : all) {
    const auto directory = std::filesystem::path(argv[1]) / name;
    base::MakeDirectories(directory);
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      base::WriteFileAtomically(directory / ("seed-" + std::to_string(i)), seeds[i]);
    }
  }
  return 0;
}
