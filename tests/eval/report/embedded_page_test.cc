#include "eval/report/embedded_page.h"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "base/random.h"

namespace slalom::eval {
namespace {

std::string Base64Of(std::string_view text) {
  return Base64(std::vector<std::uint8_t>(text.begin(), text.end()));
}

// The test vectors of RFC 4648, section 10.
TEST(Base64, MatchesTheStandardsVectors) {
  EXPECT_EQ(Base64Of(""), "");
  EXPECT_EQ(Base64Of("f"), "Zg==");
  EXPECT_EQ(Base64Of("fo"), "Zm8=");
  EXPECT_EQ(Base64Of("foo"), "Zm9v");
  EXPECT_EQ(Base64Of("foob"), "Zm9vYg==");
  EXPECT_EQ(Base64Of("fooba"), "Zm9vYmE=");
  EXPECT_EQ(Base64Of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Base64(std::vector<std::uint8_t>{0xfb, 0xff, 0xfe}), "+//+");
}

/// What the page makes of packed numbers, written independently of the packing.
std::vector<double> Unpack(const PackedNumbers& packed) {
  static constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<int> bytes;
  int bits = 0;
  int num_bits = 0;
  for (const char c : packed.base64) {
    if (c == '=') break;
    bits = bits * 64 + static_cast<int>(kDigits.find(c));
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes.push_back(bits >> num_bits);
    bits %= 1 << num_bits;
  }
  std::vector<double> numbers;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    const int integer = bytes[i] + 256 * bytes[i + 1];
    numbers.push_back(packed.scale * (integer >= 32768 ? integer - 65536 : integer));
  }
  return numbers;
}

TEST(PackNumbers, GivesNumbersBackWithinHalfAScale) {
  base::Random random(3);
  for (const double largest : {1e-4, 1.0, 30.0, 5000.0}) {
    std::vector<double> numbers{0.0, largest, -largest};
    for (int i = 0; i < 200; ++i) numbers.push_back(random.Uniform(-largest, largest));
    const PackedNumbers packed = PackNumbers(numbers, 0.001);
    EXPECT_DOUBLE_EQ(packed.scale, std::max(0.001, largest / 32000.0));
    const std::vector<double> unpacked = Unpack(packed);
    ASSERT_EQ(unpacked.size(), numbers.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      EXPECT_NEAR(unpacked[i], numbers[i], 0.5001 * packed.scale);
    }
  }
  EXPECT_EQ(PackNumbers({}, 0.01).base64, "");
}

}  // namespace
}  // namespace slalom::eval
