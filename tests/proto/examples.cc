#include "tests/proto/examples.h"

#include <fmt/format.h>

#include "base/file.h"

namespace slalom::proto {
namespace {

std::string PrintReport(const Report& m) {
  std::string text = fmt::format("{} {}", m.role, m.name);
  for (const auto& [key, value] : m.figures) text += fmt::format(" {}={}", key, value);
  for (const auto& [key, value] : m.facts) text += fmt::format(" {}='{}'", key, value);
  return text;
}

std::string PrintFields(const Hello& m) {
  return fmt::format("{} {} {} {} {} {} {}", m.role, m.name, m.session, m.spec_hash, m.num_beams,
                     m.num_streams, m.software);
}
std::string PrintFields(const Welcome& m) {
  return fmt::format("{} {} {} {} {} {} {}", m.server, m.session, m.next_sequence, m.window_bytes,
                     m.previous_session, m.previous_accepted_steps, m.software);
}
std::string PrintFields(const Insert& m) {
  return fmt::format("{} {} {} {} {} {} {}", m.session, m.sequence, m.num_rows, m.num_beams,
                     m.num_steps, m.oldest_version, m.newest_version);
}
std::string PrintFields(const InsertAck& m) {
  return fmt::format("{} {} {}", m.session, m.next_sequence, m.window_bytes);
}
std::string PrintFields(const Goodbye& m) { return fmt::format("{}", m.session); }
std::string PrintFields(const SampleRequest& m) {
  return fmt::format("{} {} {} {} {} {} {}", m.cursor, m.batch, m.history, m.n_step, m.gamma,
                     m.prioritized, m.importance_exponent);
}
std::string PrintFields(const SampleReply& m) {
  return fmt::format("{} {} {} {} {} {} {} {}", m.cursor, m.batch, m.history, m.num_beams,
                     m.weighted, m.inserted_steps, m.table_steps, m.acting_version);
}
std::string PrintFields(const PriorityUpdate& m) { return fmt::format("{}", m.count); }
std::string PrintFields(const SnapshotRequest& m) {
  return fmt::format("{} {}", m.held_version, m.name);
}
std::string PrintFields(const Snapshot& m) {
  return fmt::format("{} {} {} {}", m.version, m.spec_hash, m.published_ns, m.learner_steps);
}
std::string PrintFields(const Report& m) { return PrintReport(m); }
std::string PrintFields(const StatusRequest&) { return ""; }
std::string PrintFields(const StatusReply& m) {
  std::string text = fmt::format("{}", m.omitted);
  for (const RoleStatus& role : m.roles) {
    text += fmt::format(" [{} {} {}]", PrintReport(role.report), role.age_s, role.connected);
  }
  return text;
}
std::string PrintFields(const Refusal& m) {
  return fmt::format("{} '{}' {}", static_cast<std::uint32_t>(m.code), m.text, m.about);
}

}  // namespace

std::vector<Example> Examples() {
  const Report report{.role = "actor",
                      .name = "actor-3",
                      .figures = {{"steps", 1234.5}, {"lag", -1.0}, {"blocked_s", 0.0}},
                      .facts = {{"courses", "static-train"}, {"host", "node 7"}}};
  return {
      {Hello{.role = "actor",
             .name = "actor-3",
             .session = 7,
             .spec_hash = 0x123456789abcdef0,
             .num_beams = 720,
             .num_streams = 16,
             .software = "slalom 0.1.0"},
       ""},
      {Welcome{.server = 0xfedcba9876543210,
               .session = 7,
               .next_sequence = 11,
               .window_bytes = 8 << 20,
               .previous_session = 6,
               .previous_accepted_steps = 100000,
               .software = "slalom 0.1.0"},
       ""},
      {Insert{.session = 7,
              .sequence = 300,
              .num_rows = 64,
              .num_beams = 720,
              .num_steps = 60,
              .oldest_version = -1,
              .newest_version = 42},
       "rows"},
      {InsertAck{.session = 7, .next_sequence = 301, .window_bytes = 4 << 20}, ""},
      {Goodbye{.session = 7}, ""},
      {SampleRequest{.cursor = 1000,
                     .batch = 256,
                     .history = 4,
                     .n_step = 5,
                     .gamma = 0.99,
                     .prioritized = true,
                     .importance_exponent = 0.4},
       ""},
      {SampleReply{.cursor = 1000,
                   .batch = 256,
                   .history = 4,
                   .num_beams = 720,
                   .weighted = true,
                   .inserted_steps = 123456789,
                   .table_steps = 200000,
                   .acting_version = 41.5},
       std::string("a sample\0with zeros", 19)},
      {PriorityUpdate{.count = 256}, "priorities"},
      {SnapshotRequest{.held_version = -1, .name = "evaluator"}, ""},
      {Snapshot{.version = 43,
                .spec_hash = 0x123456789abcdef0,
                .published_ns = 1700000000123456789,
                .learner_steps = 123400000},
       "a policy"},
      {report, ""},
      {StatusRequest{}, ""},
      {StatusReply{
           .roles = {{.report = report, .age_s = 0.75, .connected = true},
                     {.report = {.role = "learner", .name = "l", .figures = {}, .facts = {}},
                      .age_s = 3.0,
                      .connected = false}},
           .omitted = 2},
       ""},
      {Refusal{.code = RefusalCode::kOutOfOrder, .text = "expected chunk 301", .about = 303}, ""},
  };
}

std::string FrameByHand(int major, int minor, int number, std::string_view protobuf,
                        std::string_view payload) {
  std::string frame = "SLLM";
  frame += static_cast<char>(major);
  frame += static_cast<char>(minor);
  frame += static_cast<char>(number & 255);
  frame += static_cast<char>(number >> 8);
  std::uint64_t checksum = base::Checksum(std::string_view(frame));
  checksum = base::Checksum(protobuf, checksum);
  checksum = base::Checksum(payload, checksum);
  for (int i = 0; i < 8; ++i) frame += static_cast<char>(checksum >> (8 * i));
  return frame + std::string(protobuf);
}

std::string Print(const Header& header) {
  return std::string(NameOf(header)) + ": " +
         std::visit([](const auto& message) { return PrintFields(message); }, header);
}

}  // namespace slalom::proto
