#include "proto/messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "base/name.h"
#include "tests/proto/examples.h"

namespace slalom::proto {
namespace {

using testing::HasSubstr;

Refusal RefusalOf(std::string_view frame, std::string_view payload = "") {
  const auto result = Decode(Bytes(frame), Bytes(payload));
  if (result) {
    ADD_FAILURE() << "was not refused: " << Print(*result);
    return {};
  }
  return result.failure();
}

TEST(MessagesTest, EveryHeaderComesBack) {
  std::set<std::size_t> kinds;
  for (const Example& example : Examples()) {
    const std::string frame = Encode(example.header, Bytes(example.payload));
    const auto decoded = Decode(Bytes(frame), Bytes(example.payload));
    ASSERT_TRUE(decoded) << decoded.failure().text;
    EXPECT_EQ(Print(*decoded), Print(example.header));
    EXPECT_EQ(decoded->index(), example.header.index());
    kinds.insert(example.header.index());
  }
  EXPECT_EQ(kinds.size(), std::variant_size_v<Header>);
}

TEST(MessagesTest, TheSameHeaderGivesTheSameBytes) {
  for (const Example& example : Examples()) {
    EXPECT_EQ(Encode(example.header, {}), Encode(Header(example.header), {}));
  }
}

TEST(MessagesTest, EveryDamagedBitIsNoticed) {
  for (const Example& example : Examples()) {
    const std::string good = Encode(example.header, Bytes(example.payload));
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
      std::string frame = good;
      frame[bit / 8] = static_cast<char>(frame[bit / 8] ^ (1 << bit % 8));
      EXPECT_FALSE(Decode(Bytes(frame), Bytes(example.payload))) << "bit " << bit;
    }
    for (std::size_t bit = 0; bit < 8 * example.payload.size(); ++bit) {
      std::string payload = example.payload;
      payload[bit / 8] = static_cast<char>(payload[bit / 8] ^ (1 << bit % 8));
      EXPECT_THAT(RefusalOf(good, payload).text, HasSubstr("checksum"));
    }
    EXPECT_THAT(RefusalOf(good, example.payload + "x").text, HasSubstr("checksum"));
  }
}

TEST(MessagesTest, EveryShorterFrameIsRefused) {
  for (const Example& example : Examples()) {
    const std::string good = Encode(example.header, {});
    for (std::size_t size = 0; size < good.size(); ++size) {
      EXPECT_EQ(RefusalOf(good.substr(0, size)).code, RefusalCode::kBadMessage);
    }
  }
}

TEST(MessagesTest, SaysWhatIsNoMessage) {
  EXPECT_THAT(RefusalOf("").text, HasSubstr("0 bytes long, expected 16"));
  EXPECT_THAT(RefusalOf("GET /metrics HTTP/1.1\r\n\r\n").text, HasSubstr("does not begin"));
  EXPECT_EQ(RefusalOf(FrameByHand(1, 0, 0, "")).code, RefusalCode::kUnknownMessage);
  EXPECT_EQ(RefusalOf(FrameByHand(1, 0, 15, "")).code, RefusalCode::kUnknownMessage);
  EXPECT_EQ(RefusalOf(FrameByHand(1, 0, 65535, "")).code, RefusalCode::kUnknownMessage);
  EXPECT_THAT(RefusalOf(FrameByHand(1, 0, 5, "\x08")).text, HasSubstr("Goodbye"));
  EXPECT_THAT(RefusalOf(FrameByHand(1, 0, 1, std::string(kMaxHeaderBytes + 1, 'x'))).text,
              HasSubstr("1048576 at most"));
  // A string that is no UTF-8.
  EXPECT_EQ(RefusalOf(FrameByHand(1, 0, 1, "\x0a\x01\xff")).code, RefusalCode::kBadMessage);
}

// Of each bound both sides. What is sent is checked, too, so bytes of a good message are changed by
// a peer that does not: here, `Decode` of what was encoded without the check.
struct Fault {
  const char* what;
  int number;
  std::string protobuf;
};

std::string Varint(int field, std::uint64_t value) {
  std::string out;
  const auto put = [&out](std::uint64_t v) {
    for (; v >= 0x80; v >>= 7) out += static_cast<char>(v | 0x80);
    out += static_cast<char>(v);
  };
  put(static_cast<std::uint64_t>(field) << 3);
  put(value);
  return out;
}
std::string Double(int field, double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  std::string out(1, static_cast<char>(field << 3 | 1));
  for (int i = 0; i < 8; ++i) out += static_cast<char>(bits >> (8 * i));
  return out;
}
std::string Text(int field, std::string_view value) {
  std::string out(1, static_cast<char>(field << 3 | 2));
  out += Varint(0, value.size()).substr(1);
  return out + std::string(value);
}
constexpr auto kNegative = static_cast<std::uint64_t>(std::int64_t{-1});

TEST(MessagesTest, EveryBoundIsHeld) {
  const std::string names = Text(1, "actor") + Text(2, "a");
  const std::string insert = Varint(3, 2) + Varint(4, 720);
  const std::string request = Varint(2, 1) + Varint(3, 1) + Varint(4, 1);
  const std::string reply = Varint(2, 1) + Varint(3, 1) + Varint(4, 720);
  const double nan = std::nan("");
  const Fault faults[] = {
      {"role", 1, Text(2, "a")},
      {"name", 1, Text(1, "actor")},
      {"name", 1, Text(1, "actor") + Text(2, std::string(129, 'a'))},
      {"name", 1, Text(1, "actor") + Text(2, "two words")},
      {"name", 1, Text(1, "actor") + Text(2, "\x1b[2J")},
      {"num_beams", 1, names + Varint(5, 4097)},
      {"num_beams", 1, names + Varint(5, 0xffffffff)},
      {"num_streams", 1, names + Varint(6, 4097)},
      {"software", 1, names + Text(7, "a\nb")},
      {"software", 1, names + Text(7, std::string(1025, 'a'))},
      {"window_bytes", 2, Varint(4, kNegative)},
      {"previous_accepted_steps", 2, Varint(6, kNegative)},
      {"software", 2, Text(7, "\x7f")},
      {"num_rows", 3, Varint(4, 720)},
      {"num_rows", 3, Varint(3, 65537) + Varint(4, 720)},
      {"num_rows", 3, Varint(3, 1u << 31) + Varint(4, 720)},
      {"num_beams", 3, Varint(3, 1) + Varint(4, 4097)},
      {"num_steps", 3, insert + Varint(5, 3)},
      {"newest_version", 3, insert + Varint(7, kNegative - 1)},
      {"oldest_version", 3, insert + Varint(6, 3) + Varint(7, 2)},
      {"oldest_version", 3, insert + Varint(6, kNegative - 1)},
      {"window_bytes", 4, Varint(3, kNegative)},
      {"batch", 6, Varint(3, 1) + Varint(4, 1)},
      {"batch", 6, Varint(2, 65537) + Varint(3, 1) + Varint(4, 1)},
      {"history", 6, Varint(2, 1) + Varint(4, 1)},
      {"history", 6, Varint(2, 1) + Varint(3, 257) + Varint(4, 1)},
      {"batch times history", 6, Varint(2, 65536) + Varint(3, 3) + Varint(4, 1)},
      {"n_step", 6, Varint(2, 1) + Varint(3, 1)},
      {"n_step", 6, Varint(2, 1) + Varint(3, 1) + Varint(4, 1025)},
      {"gamma", 6, request + Double(5, 1.5)},
      {"gamma", 6, request + Double(5, -0.5)},
      {"gamma", 6, request + Double(5, nan)},
      {"importance_exponent", 6, request + Double(7, 1.5)},
      {"importance_exponent", 6, request + Double(7, nan)},
      {"batch", 7, Varint(3, 1) + Varint(4, 720)},
      {"batch times history", 7, Varint(2, 65536) + Varint(3, 3) + Varint(4, 720)},
      {"num_beams", 7, Varint(2, 1) + Varint(3, 1) + Varint(4, 4097)},
      {"inserted_steps", 7, reply + Varint(6, kNegative)},
      {"table_steps", 7, reply + Varint(7, kNegative)},
      {"acting_version", 7, reply + Double(8, nan)},
      {"acting_version", 7, reply + Double(8, INFINITY)},
      {"table_weight", 7, reply + Double(9, -1.0)},
      {"count", 8, ""},
      {"count", 8, Varint(1, 65537)},
      {"held_version", 9, Varint(1, kNegative - 1) + Text(2, "a")},
      {"name", 9, Varint(1, 1)},
      {"version", 10, Varint(1, kNegative)},
      {"published_ns", 10, Varint(3, kNegative)},
      {"learner_steps", 10, Varint(4, kNegative)},
      {"role", 11, Text(2, "a")},
      {"name", 11, Text(1, "actor")},
      {"the key of a figure", 11, names + Text(3, Text(1, "a b") + Double(2, 1.0))},
      {"the key of a figure", 11, names + Text(3, "")},
      {"the key of a fact", 11, names + Text(4, Text(1, "") + Text(2, "b"))},
      {"a fact", 11, names + Text(4, Text(1, "a") + Text(2, "\x1b"))},
      {"a fact", 11, names + Text(4, Text(1, "a") + Text(2, std::string(1025, 'b')))},
      {"role", 13, Text(1, "")},
      {"age_s", 13, Text(1, Text(1, names) + Double(2, -1.0))},
      {"age_s", 13, Text(1, Text(1, names) + Double(2, nan))},
      {"code", 14, ""},
      {"text", 14, Varint(1, 1) + Text(2, "\t")},
  };
  for (const Fault& fault : faults) {
    const Refusal refusal = RefusalOf(FrameByHand(1, 0, fault.number, fault.protobuf));
    EXPECT_EQ(refusal.code, RefusalCode::kBadMessage);
    EXPECT_THAT(refusal.text, HasSubstr(std::string(": ") + fault.what));
  }
}

constexpr int kMaxBeams = 4096;
constexpr int kMaxRows = 65536;
constexpr int kMaxBatch = 65536;
constexpr int kMaxHistory = 256;
constexpr int kMaxNStep = 1024;

// The other side of each bound.
TEST(MessagesTest, TheLargestAndSmallestComeThrough) {
  constexpr auto kMost = std::numeric_limits<std::int64_t>::max();
  constexpr auto kMostUnsigned = std::numeric_limits<std::uint64_t>::max();
  const std::string name(base::kMaxNameBytes, 'n');
  const std::string text(kMaxTextBytes, '~');
  std::map<std::string, double> figures;
  std::map<std::string, std::string> facts;
  for (int i = 0; i < kMaxFigures; ++i) {
    figures["figure." + std::to_string(i)] = i % 2 == 0 ? INFINITY : std::nan("");
    facts["fact:" + std::to_string(i)] = text;
  }
  const Header headers[] = {
      Hello{name, name, kMostUnsigned, kMostUnsigned, kMaxBeams, kMaxStreams, text, facts},
      Hello{"a", "b", 0, 0, 0, 0, "", {}},
      Welcome{kMostUnsigned, kMostUnsigned, kMostUnsigned, kMost, kMostUnsigned, kMost, text},
      Insert{kMostUnsigned, kMostUnsigned, kMaxRows, kMaxBeams, kMaxRows, kMost, kMost},
      Insert{0, 0, 1, 1, 0, -1, -1},
      SampleRequest{kMostUnsigned, kMaxBatch, 2, kMaxNStep, 1.0, true, 1.0},
      SampleRequest{0, kMaxFrames / kMaxHistory, kMaxHistory, 1, 0.0, false, 0.0},
      SampleReply{kMostUnsigned, kMaxBatch, 2, kMaxBeams, true, kMost, kMost, -1.0},
      PriorityUpdate{kMaxBatch},
      PriorityUpdate{1},
      SnapshotRequest{kMost, name},
      Snapshot{kMost, kMostUnsigned, kMost, kMost},
      Report{name, name, figures, facts},
      Refusal{RefusalCode::kBadMessage, text, kMostUnsigned},
      Refusal{static_cast<RefusalCode>(0xffffffff), "", 0},
  };
  for (const Header& header : headers) {
    const auto decoded = Decode(Bytes(Encode(header, {})), {});
    ASSERT_TRUE(decoded) << NameOf(header) << ": " << decoded.failure().text;
    EXPECT_EQ(Print(*decoded), Print(header));
  }
}

TEST(RunIdentityTest, NamesTheKeysThatDiffer) {
  const RunIdentity run = {{"courses.train", "\"static\""}, {"run.seed", "2"}};
  EXPECT_EQ(DescribeDifference(run, run), "");
  EXPECT_EQ(DescribeDifference({{"run.seed", "3"}}, run),
            "courses.train is the default, expected \"static\"; run.seed is 3, expected 2");
  RunIdentity many;
  for (char c = 'a'; c <= 'g'; ++c) many[std::string(1, c)] = "1";
  EXPECT_THAT(DescribeDifference(many, {}),
              ::testing::EndsWith("e is 1, expected the default; and 2 more"));
}

TEST(MessagesTest, TextsAreMadeToFit) {
  const std::string text = "line\nline \xc3\xa9" + std::string(2000, 'x');
  const auto decoded = Decode(
      Bytes(Encode(Refusal{.code = RefusalCode::kNotReady, .text = text, .about = 0}, {})), {});
  ASSERT_TRUE(decoded);
  const std::string expected = "line?line ??" + std::string(kMaxTextBytes - 12, 'x');
  EXPECT_EQ(std::get<Refusal>(*decoded).text, expected);
}

TEST(MessagesTest, AStatusIsMadeToFit) {
  const RoleStatus small{.report = {.role = "actor", .name = "a", .figures = {}, .facts = {}}};
  RoleStatus large = small;
  for (int i = 0; i < kMaxFigures; ++i) {
    large.report.facts["fact" + std::to_string(i)] = std::string(kMaxTextBytes, 'x');
  }
  const auto through = [](const StatusReply& status) {
    const auto decoded = Decode(Bytes(Encode(status, {})), {});
    return std::get<StatusReply>(decoded.value());
  };
  // Of four times a quarter of a megabyte and more three fit, and the small one after them.
  const StatusReply bytes =
      through({.roles = {small, large, large, large, large, small}, .omitted = 1});
  EXPECT_EQ(bytes.roles.size(), 5u);
  EXPECT_EQ(bytes.omitted, 2);
  const StatusReply many = through({.roles = std::vector<RoleStatus>(kMaxRoles + 7, small)});
  EXPECT_EQ(many.roles.size(), static_cast<std::size_t>(kMaxRoles));
  EXPECT_EQ(many.omitted, 7);
}

TEST(MessagesTest, OfAProcessThatTwoServersKnowTheNewestReportCounts) {
  const auto role = [](const char* name, double age, bool connected) {
    RoleStatus status{.report = {}, .age_s = age, .connected = connected};
    status.report.role = name == std::string("learner") ? "learner" : "actor";
    status.report.name = name;
    return status;
  };
  const StatusReply first{.roles = {role("learner", 2.0, true), role("a", 9.0, false)},
                          .omitted = 1};
  const StatusReply second{
      .roles = {role("b", 1.0, true), role("a", 0.5, true), role("learner", 3.0, true)},
      .omitted = 4};
  const StatusReply merged = Merge({first, second});
  ASSERT_EQ(merged.roles.size(), 3U);
  EXPECT_EQ(merged.roles[0].age_s, 2.0);
  EXPECT_EQ(merged.roles[1].report.name, "a");
  EXPECT_EQ(merged.roles[1].age_s, 0.5);
  EXPECT_TRUE(merged.roles[1].connected);
  EXPECT_EQ(merged.roles[2].report.name, "b");
  EXPECT_EQ(merged.omitted, 5);
  EXPECT_TRUE(Merge({}).roles.empty());
}

TEST(MessagesTest, WhatIsOutOfBoundsIsNotSent) {
  EXPECT_DEATH((void)Encode(Hello{"actor", "two words", 0, 0, 0, 0, ""}, {}),
               "name is 'two words'");
  EXPECT_DEATH((void)Encode(Insert{0, 0, 0, 720, 0, 0, 0}, {}), "num_rows is 0");
}

TEST(MessagesTest, EveryRefusalHasAName) {
  std::set<std::string_view> names;
  for (const RefusalCode code : kRefusalCodes) names.insert(ToString(code));
  EXPECT_EQ(names.size(), 11u);
  EXPECT_TRUE(names.contains("replaced"));
  EXPECT_FALSE(names.contains("other"));
  EXPECT_EQ(ToString(static_cast<RefusalCode>(0)), "other");
  EXPECT_EQ(ToString(static_cast<RefusalCode>(12)), "other");
}

}  // namespace
}  // namespace slalom::proto
