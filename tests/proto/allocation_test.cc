// What a frame can make its reader allocate. The allocations of this program are counted.

#include <gtest/gtest.h>

#include "tests/proto/examples.h"
#include "tests/support/allocation_count.h"

namespace slalom::proto {
namespace {

std::size_t BytesAllocatedBy(std::string_view frame) {
  const long before = test::NumAllocatedBytes();
  (void)Decode(Bytes(frame), {});
  return static_cast<std::size_t>(test::NumAllocatedBytes() - before);
}

std::string Repeat(std::string_view unit, std::size_t size) {
  std::string text;
  while (text.size() + unit.size() <= size) text += unit;
  return text;
}

/// A field with bytes: its tag, its length and they.
std::string Field(int number, std::string_view bytes) {
  std::string out(1, static_cast<char>(number << 3 | 2));
  std::size_t size = bytes.size();
  for (; size >= 0x80; size >>= 7) out += static_cast<char>(size | 0x80);
  out += static_cast<char>(size);
  return out + std::string(bytes);
}

void ExpectBounded(const std::string& what, int number, const std::string& protobuf) {
  const std::string frame = FrameByHand(1, 0, number, protobuf);
  EXPECT_LE(BytesAllocatedBy(frame), 64 * frame.size() + (1 << 20)) << what;
}

TEST(AllocationTest, AFrameMakesItsReaderAllocateFewTimesItsSize) {
  constexpr int kHello = 1;
  constexpr int kReport = 11;
  constexpr int kStatusReply = 13;
  const std::size_t most = kMaxHeaderBytes;
  ExpectBounded("empty roles", kStatusReply, Repeat(Field(1, ""), most));
  ExpectBounded("roles with empty reports", kStatusReply, Repeat(Field(1, Field(1, "")), most));
  ExpectBounded("as many empty roles as there may be", kStatusReply,
                Repeat(Field(1, Field(1, "")), 4 * kMaxRoles));
  ExpectBounded("empty facts", kReport, Repeat(Field(4, ""), most));
  ExpectBounded("a role with empty figures", kStatusReply,
                Field(1, Field(1, Repeat(Field(3, ""), most / 2))));
  std::string figures;
  for (int i = 0; figures.size() < most - 100; ++i) {
    figures += Field(3, Field(1, std::to_string(i)));
  }
  ExpectBounded("figures of all names", kReport, figures);
  std::string few;
  for (int i = 0; i < kMaxFigures; ++i) few += Field(3, Field(1, std::to_string(i)));
  ExpectBounded("roles full of figures", kStatusReply, Repeat(Field(1, Field(1, few)), most));
  ExpectBounded("a report in pieces", kStatusReply,
                Field(1, Repeat(Field(1, Field(1, "x")), most / 2)));
  ExpectBounded("keys of a run of all names", kHello, [&] {
    std::string keys;
    for (int i = 0; keys.size() < most - 100; ++i) keys += Field(8, Field(1, std::to_string(i)));
    return keys;
  }());
  ExpectBounded("unknown fields", kReport, Repeat(Field(15, ""), most));
  ExpectBounded("unknown fields in roles", kStatusReply, Repeat(Field(1, Field(15, "")), most));
  ExpectBounded("nested groups", kReport, Repeat("\x7b", most));
  ExpectBounded("one long text", kReport, Field(1, std::string(most - 100, 'x')));
  ExpectBounded("the same text again and again", kReport, Repeat(Field(1, "xxxxxxx"), most));
}

// The count sees what is there to be seen.
TEST(AllocationTest, CountsAllocations) {
  const long before = test::NumAllocatedBytes();
  const std::string text(1000, 'x');
  EXPECT_GE(test::NumAllocatedBytes() - before, 1000);
}

}  // namespace
}  // namespace slalom::proto
