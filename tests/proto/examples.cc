#include "tests/proto/examples.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <tuple>
#include <type_traits>

#include "base/file.h"

namespace slalom::proto {
namespace {

template <class T>
std::string TextOf(const T& value) {
  if constexpr (requires { T::Fields(value); }) {
    const auto parts = std::apply(
        [](const auto&... members) { return std::vector<std::string>{TextOf(members)...}; },
        T::Fields(value));
    return fmt::format("[{}]", fmt::join(parts, " "));
  } else if constexpr (std::is_same_v<T, std::vector<RoleStatus>>) {
    std::string text;
    for (const RoleStatus& entry : value) text += TextOf(entry);
    return text;
  } else if constexpr (std::is_enum_v<T>) {
    return fmt::format("{}", static_cast<std::uint32_t>(value));
  } else {
    return fmt::format("{}", value);
  }
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
                     .importance_exponent = 0.4,
                     .mirror = 2,
                     .mirror_places = 5000},
       ""},
      {SampleReply{.cursor = 1000,
                   .batch = 256,
                   .history = 4,
                   .num_beams = 720,
                   .weighted = true,
                   .inserted_steps = 123456789,
                   .table_steps = 200000,
                   .acting_version = 41.5,
                   .table_weight = 12.25,
                   .mirror = 3,
                   .num_scans = 17},
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
  return std::visit([&](const auto& m) { return fmt::format("{} {}", NameOf(header), TextOf(m)); },
                    header);
}

}  // namespace slalom::proto
