#include "base/bytes.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace slalom::base {
namespace {

TEST(Bytes, AreReadBackInTheirOrder) {
  ByteWriter out;
  out.Put(std::uint32_t{0x04030201});
  out.PutText("abc");
  out.Put(-2.5);
  EXPECT_EQ(out.text().substr(0, 7),
            "\x01\x02\x03\x04"
            "abc");
  ByteReader in(out.text());
  EXPECT_EQ(in.Get<std::uint32_t>(), 0x04030201u);
  EXPECT_EQ(in.GetText(3), "abc");
  EXPECT_EQ(in.left(), sizeof(double));
  EXPECT_FALSE(in.done());
  EXPECT_EQ(in.Get<double>(), -2.5);
  EXPECT_TRUE(in.done());
}

TEST(Bytes, BeyondTheEndAreZerosFromThereOn) {
  ByteReader in(std::string_view("\x01\x02\x03"));
  EXPECT_EQ(in.Get<std::uint32_t>(), 0u);
  EXPECT_TRUE(in.failed());
  EXPECT_EQ(in.Get<std::uint8_t>(), 0u) << "although three bytes were left";
  EXPECT_TRUE(in.GetBytes(1).empty());
  EXPECT_FALSE(in.done());
}

TEST(Bytes, OfABoolAreZeroOrOne) {
  ByteReader in(std::string_view("\x01\x00\x52\x01", 4));
  EXPECT_TRUE(in.Get<bool>());
  EXPECT_FALSE(in.Get<bool>());
  EXPECT_FALSE(in.failed());
  EXPECT_FALSE(in.Get<bool>());
  EXPECT_TRUE(in.failed());
  EXPECT_FALSE(in.Get<bool>()) << "although a byte was left";
}

}  // namespace
}  // namespace slalom::base
