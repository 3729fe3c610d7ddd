#include "replay/sample_bytes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>

#include "tests/replay/aligned_bytes.h"
#include "tests/replay/model.h"

namespace slalom::replay {
namespace {

using testing::HasSubstr;

constexpr int kBeams = 7;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// A sample of a table of random episodes, with weights that tell the samples apart.
struct Drawn {
  Drawn(int batch, int history, const env::StepShape& step = kBeams)
      : model(300, step, 5, 9), table({.capacity = 300}, step) {
    for (int i = 0; i < 150; ++i) model.Advance(&table);
    base::Random random(1);
    const SampleSpec spec{.batch = batch, .history = history, .n_step = 3, .gamma = 0.9};
    EXPECT_TRUE(table.SampleRows(spec, random, &rows));
    for (int b = 0; b < batch; ++b) rows.weight[b] = 1.0f / static_cast<float>(b + 1);
  }
  SampleShape shape(bool weighted) const {
    return {rows.batch, rows.history, rows.shape, weighted};
  }
  AlignedBytes Bytes(bool weighted) const {
    AlignedBytes bytes(SampleSize(shape(weighted)).value());
    WriteSample(rows, weighted, bytes.span());
    return bytes;
  }

  ReplayModel model;
  Table table;
  SampledRows rows;
};

template <class T>
bool Same(const AlignedBuffer<T>& a, const AlignedBuffer<T>& b) {
  return a.size() == b.size() && std::equal(a.data(), a.data() + a.size(), b.data());
}

// The table goes on while samples are sent, and a mirror may be smaller than it.
TEST(SampleBytesTest, WithAMirrorEachScanIsSentOnce) {
  constexpr std::int64_t kCapacity = 120;
  const SampleSpec spec{.batch = 20, .history = 2, .n_step = 3, .gamma = 0.9};
  for (const std::int64_t num_places : {kCapacity, std::int64_t{50}, std::int64_t{1}}) {
    ReplayModel model(kCapacity, kBeams, 5, 9);
    Table table({.capacity = kCapacity}, kBeams);
    for (int i = 0; i < 40; ++i) model.Advance(&table);
    MirroredRows sent(num_places);
    ScanMirror mirror(num_places, kBeams);
    base::Random random(1);
    std::vector<AlignedBytes> payloads;
    std::size_t num_sent = 0;
    for (int i = 0; i < 200; ++i) {
      model.Advance(&table);
      SampledRows rows;
      SampledRows read[2];
      const int num_kinds = 1 + i % 2;  // Batches that are read before the mirror keeps them.
      for (int k = 0; k < num_kinds; ++k) {
        ASSERT_TRUE(table.SampleRows(spec, random, &rows));
        MirroredScans scans;
        for (const auto* const stack : {&rows.ranges_cm, &rows.next_ranges_cm}) {
          for (const std::uint16_t* const scan : *stack) {
            const std::int64_t row = table.SequenceOf(scan);
            EXPECT_EQ(table.row(row).frame.ranges_cm.data(), scan);
            scans.places.push_back(sent.Take(row));
            if (scans.places.back() < 0) scans.to_send.push_back(scan);
          }
        }
        num_sent += scans.to_send.size();
        const SampleShape shape{spec.batch, spec.history, kBeams, false};
        AlignedBytes& bytes =
            payloads.emplace_back(MirroredSampleSize(shape, scans.to_send.size()));
        WriteMirroredSample(rows, false, scans, bytes.span());
        const auto fault =
            ParseMirroredSample(bytes.span(), shape, scans.to_send.size(), &mirror, &read[k]);
        ASSERT_FALSE(fault) << fault->text;
        EXPECT_EQ(read[k].sequence, rows.sequence);
        for (std::size_t f = 0; f < rows.ranges_cm.size(); ++f) {
          EXPECT_TRUE(
              std::equal(rows.ranges_cm[f], rows.ranges_cm[f] + kBeams, read[k].ranges_cm[f]));
          EXPECT_TRUE(std::equal(rows.next_ranges_cm[f], rows.next_ranges_cm[f] + kBeams,
                                 read[k].next_ranges_cm[f]));
        }
      }
      mirror.Keep();
      payloads.clear();
    }
    if (num_places == kCapacity) {
      EXPECT_LE(num_sent, static_cast<std::size_t>(table.total_inserted()));
    }
  }
}

TEST(SampleBytesTest, WithAMirrorRefusesWhatItsWriterWouldNotSend) {
  const Drawn drawn(2, 1);
  const SampleShape shape = drawn.shape(false);
  MirroredScans scans;
  scans.places = {~3, 5, 3, ~5};
  scans.to_send = {drawn.rows.ranges_cm[0], drawn.rows.ranges_cm[1]};
  const auto fault = [&](std::vector<std::int32_t> places, std::size_t num_scans,
                         std::int64_t num_places = 8) {
    scans.places = std::move(places);
    AlignedBytes bytes(MirroredSampleSize(shape, scans.to_send.size()));
    WriteMirroredSample(drawn.rows, false, scans, bytes.span());
    ScanMirror mirror(num_places, kBeams);
    SampledRows rows;
    const auto failure = ParseMirroredSample(bytes.span(), shape, num_scans, &mirror, &rows);
    return failure ? failure->text : "";
  };
  EXPECT_EQ(fault({~3, ~5, 3, 5}, 2), "");
  EXPECT_THAT(fault({~3, 5, 3, ~5}, 2), HasSubstr("frame 1 is of a scan that did not come"));
  EXPECT_THAT(fault({~3, ~5, 3, 5}, 2, 5), HasSubstr("frame 1 has place -6, expected one of 5"));
  EXPECT_THAT(fault({~3, 3, 3, 3}, 2), HasSubstr("found 1 new scans, expected 2"));
  EXPECT_THAT(fault({~3, ~5, ~4, 3}, 2), HasSubstr("frame 2 has place -5"));
  EXPECT_THAT(fault({~3, ~5, 3, 5}, 1), HasSubstr("bytes, expected"));
  EXPECT_THAT(fault({~3, ~5, 3, 5}, 5), HasSubstr("found 5 new scans, expected at most 4"));
}

TEST(SampleBytesTest, GivesWhatWasWritten) {
  SampledRows read;  // The same for all, so that sizes change from call to call.
  const std::tuple<int, int, env::StepShape> cases[] = {{64, 1, kBeams},    {3, 4, {0, 3, 1}},
                                                        {1, 8, kBeams},     {130, 2, kBeams},
                                                        {5, 3, {4, 17, 6}}, {2, 1, {0, 1, 9}}};
  for (const auto& [batch, history, step] : cases) {
    for (const bool weighted : {false, true}) {
      const Drawn drawn(batch, history, step);
      AlignedBytes bytes = drawn.Bytes(weighted);
      const auto fault = ParseSample(bytes.span(), drawn.shape(weighted), &read);
      ASSERT_FALSE(fault) << fault->text;
      EXPECT_EQ(read.batch, batch);
      EXPECT_EQ(read.history, history);
      EXPECT_EQ(read.shape, step);
      EXPECT_EQ(read.sequence, drawn.rows.sequence);
      EXPECT_EQ(read.next_sequence, drawn.rows.next_sequence);
      EXPECT_TRUE(Same(read.state, drawn.rows.state));
      EXPECT_TRUE(Same(read.next_state, drawn.rows.next_state));
      EXPECT_TRUE(Same(read.action, drawn.rows.action));
      EXPECT_TRUE(Same(read.n_step_return, drawn.rows.n_step_return));
      EXPECT_TRUE(Same(read.cost_return, drawn.rows.cost_return));
      EXPECT_TRUE(Same(read.discount, drawn.rows.discount));
      ASSERT_EQ(read.weight.size(), static_cast<std::size_t>(batch));
      for (int b = 0; b < batch; ++b) {
        EXPECT_EQ(read.weight[b], weighted ? drawn.rows.weight[b] : 1.0f);
      }
      const auto frames = static_cast<std::size_t>(batch) * history;
      ASSERT_EQ(read.ranges_cm.size(), frames);
      ASSERT_EQ(read.next_ranges_cm.size(), frames);
      for (std::size_t f = 0; f < frames; ++f) {
        EXPECT_TRUE(std::equal(read.ranges_cm[f], read.ranges_cm[f] + step.num_beams,
                               drawn.rows.ranges_cm[f]));
        EXPECT_TRUE(std::equal(read.next_ranges_cm[f], read.next_ranges_cm[f] + step.num_beams,
                               drawn.rows.next_ranges_cm[f]));
      }
    }
  }
}

// Places counted by hand from docs/protocol.md: B = 2, H = 3, N = 7, with weights.
TEST(SampleBytesTest, ColumnsLieWhereTheProtocolSays) {
  const Drawn drawn(2, 3);
  AlignedBytes aligned = drawn.Bytes(true);
  const std::span<const std::byte> bytes = aligned.span();
  ASSERT_EQ(bytes.size(), 16u + 16u + 96u + 96u + 16u + 4u * 8u + 84u + 84u);
  const auto at = [&]<class T>(std::size_t place, T like) {
    std::memcpy(&like, bytes.data() + place, sizeof(T));
    return like;
  };
  EXPECT_EQ(at(8, std::int64_t{}), drawn.rows.sequence[1]);
  EXPECT_EQ(at(16, std::int64_t{}), drawn.rows.next_sequence[0]);
  EXPECT_EQ(at(32 + 4 * 12, 0.0f), drawn.rows.state[12]);  // Sample 1, oldest frame, goal x.
  EXPECT_EQ(at(128, 0.0f), drawn.rows.next_state[0]);
  EXPECT_EQ(at(224 + 8 + 4, 0.0f), drawn.rows.action[3]);
  EXPECT_EQ(at(240, 0.0f), drawn.rows.n_step_return[0]);
  EXPECT_EQ(at(248, 0.0f), drawn.rows.cost_return[0]);
  EXPECT_EQ(at(256, 0.0f), drawn.rows.discount[0]);
  EXPECT_EQ(at(264 + 4, 0.0f), drawn.rows.weight[1]);
  EXPECT_EQ(at(272, std::uint16_t{}), drawn.rows.ranges_cm[0][0]);
  EXPECT_EQ(at(272 + 84 + 14, std::uint16_t{}), drawn.rows.next_ranges_cm[1][0]);
}

TEST(SampleBytesTest, RefusesAnotherNumberOfBytes) {
  const Drawn drawn(2, 3);
  AlignedBytes bytes = drawn.Bytes(true);
  const std::span<std::byte> all = bytes.span();
  SampledRows rows;
  EXPECT_TRUE(ParseSample(all.first(all.size() - 1), {2, 3, kBeams, true}, &rows));
  EXPECT_TRUE(ParseSample(all, {2, 3, kBeams, false}, &rows));
  EXPECT_TRUE(ParseSample(all, {3, 3, kBeams, true}, &rows));
  EXPECT_TRUE(ParseSample({}, {2, 3, kBeams, true}, &rows));
  EXPECT_EQ(rows.state.size(), 0u);  // Nothing was allocated for it.
}

TEST(SampleBytesTest, RefusesSizesBeyondAllMemory) {
  const int most = std::numeric_limits<int>::max();
  EXPECT_FALSE(SampleSize({most, most, most, true}));
  EXPECT_FALSE(SampleSize({most, most, 1, false}));
  EXPECT_TRUE(SampleSize({1 << 16, 256, 4096, true}));
  AlignedBytes bytes(64);
  SampledRows rows;
  EXPECT_TRUE(ParseSample(bytes.span(), {most, most, most, true}, &rows));
}

TEST(SampleBytesTest, RefusesAStartThatIsNotAligned) {
  const Drawn drawn(2, 3);
  AlignedBytes bytes = drawn.Bytes(false);
  std::memmove(bytes.span(4).data(), bytes.span().data(), bytes.span().size());
  SampledRows rows;
  EXPECT_THAT(ParseSample(bytes.span(4), drawn.shape(false), &rows)->text,
              HasSubstr("multiple of 8"));
}

TEST(SampleBytesTest, RefusesNumbersThatCannotBe) {
  struct Fault {
    std::function<void(SampledRows&)> make;
    const char* text;
  };
  const Fault faults[] = {
      {[](SampledRows& r) { r.state[23] = kNan; }, "not finite"},
      {[](SampledRows& r) { r.next_state[0] = INFINITY; }, "not finite"},
      {[](SampledRows& r) { r.action[2] = kNan; }, "not finite"},
      {[](SampledRows& r) { r.n_step_return[1] = kNan; }, "not finite"},
      {[](SampledRows& r) { r.cost_return[0] = -INFINITY; }, "not finite"},
      {[](SampledRows& r) { r.discount[0] = kNan; }, "not finite"},
      {[](SampledRows& r) { r.weight[1] = kNan; }, "not finite"},
      {[](SampledRows& r) { r.discount[1] = 1.5f; }, "sample 1: discount is 1.5"},
      {[](SampledRows& r) { r.discount[1] = -0.5f; }, "sample 1: discount"},
      {[](SampledRows& r) { r.weight[0] = -0.5f; }, "sample 0: weight"},
      {[](SampledRows& r) { r.sequence[1] = -1; }, "sample 1: found rows -1"},
      {[](SampledRows& r) { r.next_sequence[0] = r.sequence[0]; }, "sample 0: found rows"},
  };
  for (const Fault& fault : faults) {
    Drawn drawn(2, 3);
    fault.make(drawn.rows);
    AlignedBytes bytes = drawn.Bytes(true);
    SampledRows rows;
    const auto found = ParseSample(bytes.span(), drawn.shape(true), &rows);
    ASSERT_TRUE(found) << fault.text;
    EXPECT_THAT(found->text, HasSubstr(fault.text));
  }
}

TEST(PriorityBytesTest, GivesWhatWasWritten) {
  const std::vector<std::int64_t> sequence{5, 0, std::int64_t{1} << 60};
  const std::vector<float> priority{0.5f, 0.0f, 1e30f};
  AlignedBytes bytes(PrioritySize(3));
  WritePriorities(sequence, priority, bytes.span());
  const auto read = ParsePriorities(bytes.span(), 3);
  ASSERT_TRUE(read) << read.failure().text;
  EXPECT_TRUE(std::ranges::equal(read->sequence, sequence));
  EXPECT_TRUE(std::ranges::equal(read->priority, priority));
}

TEST(PriorityBytesTest, RefusesWhatIsNoPriority) {
  const auto failure = [](std::int64_t sequence, float priority, int count,
                          std::size_t offset = 0) {
    AlignedBytes bytes(PrioritySize(1));
    WritePriorities(std::span(&sequence, 1), std::span(&priority, 1), bytes.span(offset));
    return ParsePriorities(bytes.span(offset), count).failure().text;
  };
  EXPECT_THAT(failure(-1, 1.0f, 1), HasSubstr("row -1"));
  EXPECT_THAT(failure(1, -1.0f, 1), HasSubstr("found -1"));
  EXPECT_THAT(failure(1, kNan, 1), HasSubstr("found nan"));
  EXPECT_THAT(failure(1, INFINITY, 1), HasSubstr("not finite"));
  EXPECT_THAT(failure(1, 1.0f, 2), HasSubstr("found 12 bytes"));
  EXPECT_THAT(failure(1, 1.0f, -1), HasSubstr("found 12 bytes"));
  EXPECT_THAT(failure(1, 1.0f, 1, 4), HasSubstr("multiple of 8"));
}

}  // namespace
}  // namespace slalom::replay
