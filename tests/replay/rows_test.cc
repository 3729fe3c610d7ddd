#include "replay/rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <string>

#include "base/random.h"
#include "replay/table.h"
#include "tests/replay/aligned_bytes.h"

namespace slalom::replay {
namespace {

using testing::HasSubstr;

constexpr int kBeams = 3;
constexpr int kStreams = 4;

AlignedBytes Written(const Chunk& chunk) {
  AlignedBytes bytes(RowBytes::Size(chunk.num_rows(), chunk.shape));
  RowBytes::Write(chunk, bytes.span());
  return bytes;
}

/// A row whose numbers tell which it is. Flags as given.
void Add(Chunk* chunk, int stream, std::uint8_t flags) {
  const auto id = static_cast<float>(chunk->num_rows() + 1);
  const std::vector<std::uint16_t> ranges(kBeams, static_cast<std::uint16_t>(id));
  const std::vector<float> state{id, -id, 0.5f, 0.25f};
  const std::array action{0.1f * id, -0.1f};
  if (flags & kRowFinal) {
    chunk->AddRow({stream, flags, {ranges, state}, {}, 0.0f, 0.0f});
  } else {
    chunk->AddRow({stream, flags, {ranges, state}, action, id, 1.0f});
  }
}

Chunk MakeChunk(std::initializer_list<std::pair<int, int>> rows) {
  Chunk chunk(kBeams);
  for (const auto& [stream, flags] : rows) Add(&chunk, stream, static_cast<std::uint8_t>(flags));
  return chunk;
}

Chunk SmallChunk() {
  return MakeChunk({{0, kRowFirst}, {1, kRowFirst | kRowTerminated}, {0, 0}, {1, kRowFinal}});
}

void ExpectSameRow(const RowView& a, const RowView& b) {
  EXPECT_EQ(a.stream, b.stream);
  EXPECT_EQ(a.flags, b.flags);
  EXPECT_TRUE(std::ranges::equal(a.frame.ranges_cm, b.frame.ranges_cm));
  EXPECT_TRUE(std::ranges::equal(a.frame.state, b.frame.state));
  EXPECT_TRUE(std::ranges::equal(a.action, b.action));
  EXPECT_EQ(a.reward, b.reward);
  EXPECT_EQ(a.cost, b.cost);
}

TEST(RowBytesTest, GivesTheRowsThatWereWritten) {
  const Chunk chunk = SmallChunk();
  AlignedBytes bytes = Written(chunk);
  const auto rows = RowBytes::Parse(bytes.span(), 4, kBeams, kStreams);
  ASSERT_TRUE(rows) << rows.failure().text;
  EXPECT_EQ(rows->num_rows(), 4);
  EXPECT_EQ(rows->num_steps(), 3);
  for (int r = 0; r < 4; ++r) ExpectSameRow(rows->row(r), chunk.row(r));
}

// Places counted by hand from docs/protocol.md: two rows of three beams.
TEST(RowBytesTest, ColumnsLieWhereTheProtocolSays) {
  Chunk chunk(3);
  const std::vector<std::uint16_t> ranges{0x0102, 0x0304, 0x0506};
  const std::vector<float> state{1.0f, 2.0f, 3.0f, 4.0f};
  const env::FrameView frame{ranges, state};
  const std::array action{0.5f, -0.5f};
  chunk.AddRow({7, kRowFirst, frame, action, 8.0f, 9.0f});
  chunk.AddRow({5, kRowFinal, frame, {}, 0.0f, 0.0f});
  AlignedBytes bytes = Written(chunk);
  const std::span<const std::byte> all = bytes.span();
  ASSERT_EQ(all.size(), 2u * (16 + 8 + 4 + 4 + 4 + 6 + 1));
  const auto number = [&](std::size_t at) {
    float value = 0;
    std::memcpy(&value, all.data() + at, 4);
    return value;
  };
  EXPECT_EQ(number(4), 2.0f);        // State of row 0, y.
  EXPECT_EQ(number(16 + 8), 3.0f);   // State of row 1.
  EXPECT_EQ(number(32 + 4), -0.5f);  // Action of row 0.
  EXPECT_EQ(number(48), 8.0f);       // Reward of row 0.
  EXPECT_EQ(number(56), 9.0f);       // Cost of row 0.
  EXPECT_EQ(static_cast<int>(all[64]), 7);
  EXPECT_EQ(static_cast<int>(all[68]), 5);
  EXPECT_EQ(static_cast<int>(all[72]), 2);  // Low byte of the first range.
  EXPECT_EQ(static_cast<int>(all[73]), 1);
  EXPECT_EQ(static_cast<int>(all[72 + 6]), 2);
  EXPECT_EQ(static_cast<int>(all[84]), kRowFirst);
  EXPECT_EQ(static_cast<int>(all[85]), kRowFinal);
}

TEST(RowBytesTest, RefusesAnotherNumberOfBytes) {
  AlignedBytes bytes = Written(SmallChunk());
  const std::span<std::byte> all = bytes.span();
  EXPECT_FALSE(RowBytes::Parse(all.first(all.size() - 1), 4, kBeams, kStreams));
  EXPECT_FALSE(RowBytes::Parse(all, 3, kBeams, kStreams));
  EXPECT_FALSE(RowBytes::Parse(all, 4, kBeams + 1, kStreams));
  EXPECT_FALSE(RowBytes::Parse({}, 0, kBeams, kStreams));
  EXPECT_FALSE(RowBytes::Parse(all, -4, kBeams, kStreams));
  const auto largest = std::numeric_limits<int>::max();
  EXPECT_THAT(RowBytes::Parse(all, largest, largest, kStreams).failure().text, HasSubstr("bytes"));
}

TEST(RowBytesTest, RefusesAStartThatIsNotAligned) {
  const Chunk chunk = SmallChunk();
  AlignedBytes bytes = Written(chunk);
  std::memmove(bytes.span(2).data(), bytes.span().data(), bytes.span().size());
  EXPECT_THAT(RowBytes::Parse(bytes.span(2), 4, kBeams, kStreams).failure().text,
              HasSubstr("multiple of 4"));
}

TEST(RowBytesTest, RefusesNumbersThatAreNotFinite) {
  const Chunk good = SmallChunk();
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::function<void(Chunk&)> faults[] = {
      [&](Chunk& c) { c.state.back() = nan; },   [&](Chunk& c) { c.state.front() = -infinity; },
      [&](Chunk& c) { c.action[3] = infinity; }, [&](Chunk& c) { c.reward[2] = nan; },
      [&](Chunk& c) { c.cost[0] = infinity; },
  };
  for (const auto& fault : faults) {
    Chunk chunk = good;
    fault(chunk);
    AlignedBytes bytes = Written(chunk);
    const auto rows = RowBytes::Parse(bytes.span(), 4, kBeams, kStreams);
    ASSERT_FALSE(rows);
    EXPECT_THAT(rows.failure().text, HasSubstr("not finite"));
  }
}

// Returns and losses of larger ones overflow, and would end the learner.
TEST(RowBytesTest, RefusesNumbersThatNoSimulatorMakes) {
  const Chunk good = SmallChunk();
  const std::function<void(Chunk&, float)> places[] = {
      [](Chunk& c, float value) { c.state.back() = value; },
      [](Chunk& c, float value) { c.reward[2] = value; },
      [](Chunk& c, float value) { c.cost[0] = value; },
  };
  for (const auto& put : places) {
    for (const float value : {RowBytes::kMaxNumber, 3e38f, -3e38f}) {
      Chunk chunk = good;
      put(chunk, value);
      AlignedBytes bytes = Written(chunk);
      const auto rows = RowBytes::Parse(bytes.span(), 4, kBeams, kStreams);
      ASSERT_EQ(rows.ok(), value == RowBytes::kMaxNumber) << value;
      if (!rows) EXPECT_THAT(rows.failure().text, HasSubstr("expected 1000000 at most"));
    }
  }
}

TEST(RowBytesTest, RefusesFlagsThatDoNotGoTogether) {
  for (int flags = 0; flags < 256; ++flags) {
    Chunk chunk = SmallChunk();
    chunk.flags[2] = static_cast<std::uint8_t>(flags);
    chunk.action[4] = chunk.action[5] = 0.0f;
    chunk.reward[2] = chunk.cost[2] = 0.0f;
    AlignedBytes bytes = Written(chunk);
    // A step, perhaps the first, perhaps terminated; or a final frame and nothing else.
    const bool good = flags == 0 || flags == 1 || flags == 2 || flags == 4 || flags == 6;
    EXPECT_EQ(RowBytes::Parse(bytes.span(), 4, kBeams, kStreams).ok(), good) << flags;
  }
}

TEST(RowBytesTest, RefusesAFinalRowWithAnActionARewardOrACost) {
  const std::function<void(Chunk&)> faults[] = {
      [](Chunk& c) { c.action[6] = 0.1f; },
      [](Chunk& c) { c.reward[3] = 1.0f; },
      [](Chunk& c) { c.cost[3] = 1.0f; },
  };
  for (const auto& fault : faults) {
    Chunk chunk = SmallChunk();
    fault(chunk);
    AlignedBytes bytes = Written(chunk);
    EXPECT_THAT(RowBytes::Parse(bytes.span(), 4, kBeams, kStreams).failure().text,
                HasSubstr("row 3 is final"));
  }
}

TEST(RowBytesTest, RefusesStreamsThatTheSenderDoesNotHave) {
  for (const int stream : {-1, kStreams, std::numeric_limits<int>::min()}) {
    Chunk chunk = SmallChunk();
    chunk.stream[1] = stream;
    AlignedBytes bytes = Written(chunk);
    EXPECT_THAT(RowBytes::Parse(bytes.span(), 4, kBeams, kStreams).failure().text,
                HasSubstr("row 1 is of stream"));
  }
}

std::optional<base::Failure> Check(const Table& table, const Chunk& chunk, int stream_base = 0) {
  AlignedBytes bytes = Written(chunk);
  return table.CheckEpisodes(
      *RowBytes::Parse(bytes.span(), chunk.num_rows(), chunk.shape, kStreams), stream_base);
}

void InsertRows(Table* table, const Chunk& chunk, int stream_base = 0) {
  AlignedBytes bytes = Written(chunk);
  table->InsertRows(*RowBytes::Parse(bytes.span(), chunk.num_rows(), chunk.shape, kStreams),
                    stream_base);
}

TEST(CheckEpisodesTest, RefusesEachThingThatIsNoEpisode) {
  const Table table({.capacity = 16}, kBeams);
  EXPECT_FALSE(Check(table, SmallChunk()));
  EXPECT_THAT(Check(table, MakeChunk({{0, 0}}))->text, HasSubstr("none is running"));
  EXPECT_THAT(Check(table, MakeChunk({{0, kRowFinal}}))->text, HasSubstr("none is running"));
  EXPECT_THAT(Check(table, MakeChunk({{0, kRowFirst}, {1, 0}}))->text,
              HasSubstr("row 1, stream 1: found a step in mid-episode"));
  EXPECT_THAT(Check(table, MakeChunk({{0, kRowFirst}, {0, kRowFirst}}))->text,
              HasSubstr("a row of the episode that is still running"));
  EXPECT_THAT(Check(table, MakeChunk({{0, kRowFirst}, {0, kRowFinal}, {0, 0}}))->text,
              HasSubstr("row 2"));
  EXPECT_THAT(Check(table, MakeChunk({{0, kRowFirst | kRowTerminated}, {0, 0}}))->text,
              HasSubstr("expected the final row"));
  EXPECT_THAT(Check(table, MakeChunk({{0, kRowFirst | kRowTerminated}, {0, kRowFirst}}))->text,
              HasSubstr("still running"));
  EXPECT_THAT(Check(Table({.capacity = 16}, kBeams + 1), SmallChunk())->text,
              HasSubstr("expected 4, 4 and 2"));
}

TEST(CheckEpisodesTest, GoesOnWhereTheTableStands) {
  Table table({.capacity = 16}, kBeams);
  InsertRows(&table, MakeChunk({{0, kRowFirst}, {1, kRowFirst | kRowTerminated}}), 10);
  EXPECT_FALSE(Check(table, MakeChunk({{0, 0}, {1, kRowFinal}, {1, kRowFirst}}), 10));
  EXPECT_TRUE(Check(table, MakeChunk({{0, kRowFirst}}), 10));
  EXPECT_THAT(Check(table, MakeChunk({{1, 0}}), 10)->text, HasSubstr("final row"));
  // Elsewhere nothing is open.
  EXPECT_TRUE(Check(table, MakeChunk({{0, 0}}), 0));
  EXPECT_FALSE(Check(table, MakeChunk({{0, kRowFirst}}), 0));
  EXPECT_FALSE(Check(table, MakeChunk({{0, kRowFirst}}), 1 << 20));
  table.Cut(10);
  EXPECT_FALSE(Check(table, MakeChunk({{0, kRowFirst}}), 10));
}

// The slot of a stream's last row may hold a row of another by now, which says nothing of it.
TEST(CheckEpisodesTest, DoesNotTakeARowThatWasOverwrittenForTheLastOne) {
  Table table({.capacity = 4}, kBeams);
  InsertRows(&table, MakeChunk({{0, kRowFirst}}));
  InsertRows(&table, MakeChunk({{1, kRowFirst}, {1, 0}, {1, 0}, {1, kRowTerminated}}));
  EXPECT_FALSE(Check(table, MakeChunk({{0, 0}})));
  EXPECT_TRUE(Check(table, MakeChunk({{1, 0}})));
}

// What `CheckEpisodes` lets through `Insert` takes without an abort, and the table is the same as
// when the rows come in a `Chunk`; what it refuses breaks the rules written out again here.
TEST(CheckEpisodesTest, AgreesWithRandomChunks) {
  base::Random random(4);
  Table from_bytes({.capacity = 64}, kBeams);
  Table from_chunks({.capacity = 64}, kBeams);
  constexpr int kBase = 3;
  std::vector<std::string> history(kStreams);  // Letters F first, S step, T terminated, E end.
  int num_good = 0;
  for (int i = 0; i < 4000; ++i) {
    Chunk chunk(kBeams);
    std::vector<std::string> next = history;
    const auto rows = 1 + random.UniformInt(4);
    for (std::uint64_t r = 0; r < rows; ++r) {
      const auto stream = static_cast<int>(random.UniformInt(kStreams));
      static constexpr std::uint8_t kKinds[] = {kRowFirst, 0, kRowTerminated, kRowFinal,
                                                kRowFirst | kRowTerminated};
      static constexpr const char* kLetters[] = {"F", "S", "T", "E", "FT"};
      const auto kind = random.UniformInt(5);
      Add(&chunk, stream, kKinds[kind]);
      next[stream] += kLetters[kind];
    }
    // Of the letters only what can follow what: a terminated step is written T, first ones FT.
    bool good = true;
    for (const std::string& h : next) {
      for (std::size_t k = 0; k < h.size(); ++k) {
        const char before = k == 0 ? 'E' : h[k - 1];
        const std::string_view allowed = before == 'E' ? "F" : before == 'T' ? "E" : "STE";
        good = good && allowed.find(h[k]) != std::string_view::npos;
      }
    }
    ASSERT_EQ(!Check(from_bytes, chunk, kBase).has_value(), good) << "chunk " << i;
    if (!good) continue;
    ++num_good;
    history = next;
    InsertRows(&from_bytes, chunk, kBase);
    for (auto& stream : chunk.stream) stream += kBase;
    from_chunks.Insert(chunk);
  }
  EXPECT_GT(num_good, 300);
  ASSERT_EQ(from_bytes.total_inserted(), from_chunks.total_inserted());
  for (auto s = from_bytes.first_sequence(); s < from_bytes.total_inserted(); ++s) {
    ExpectSameRow(from_bytes.row(s), from_chunks.row(s));
  }
  const SampleSpec spec{.batch = 50, .history = 2, .n_step = 3, .gamma = 0.9};
  EXPECT_EQ(from_bytes.CountEligible(2, 3), from_chunks.CountEligible(2, 3));
  base::Random one(1);
  base::Random other(1);
  SampledRows a;
  SampledRows b;
  ASSERT_TRUE(from_bytes.SampleRows(spec, one, &a));
  ASSERT_TRUE(from_chunks.SampleRows(spec, other, &b));
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.next_sequence, b.next_sequence);
}

}  // namespace
}  // namespace slalom::replay
