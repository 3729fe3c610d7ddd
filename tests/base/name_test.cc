#include "base/name.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace slalom::base {
namespace {

TEST(NameTest, NamesAreWhatLabelsAndFilesCanHold) {
  EXPECT_TRUE(IsName("actor-3.node_7:9400@x"));
  EXPECT_FALSE(IsName("a/b"));
  EXPECT_FALSE(IsName(""));
  EXPECT_FALSE(IsName("a b"));
  EXPECT_FALSE(IsName("\xc3\xa9"));
  EXPECT_TRUE(IsName(std::string(128, 'z')));
  EXPECT_FALSE(IsName(std::string(129, 'z')));
}

TEST(EditDistance, CountsLettersAddedTakenAwayChangedAndSwapped) {
  EXPECT_EQ(EditDistance("", ""), 0u);
  EXPECT_EQ(EditDistance("train", "train"), 0u);
  EXPECT_EQ(EditDistance("", "abc"), 3u);
  EXPECT_EQ(EditDistance("abc", ""), 3u);
  EXPECT_EQ(EditDistance("corses", "courses"), 1u);
  EXPECT_EQ(EditDistance("coursees", "courses"), 1u);
  EXPECT_EQ(EditDistance("cpurses", "courses"), 1u);
  EXPECT_EQ(EditDistance("trian", "train"), 1u) << "two neighbours swapped are one mistake";
  EXPECT_EQ(EditDistance("kitten", "sitting"), 3u);
  EXPECT_EQ(EditDistance("ca", "abc"), 3u) << "no letter is touched twice";
}

/// All words over {a, b} of up to `length` letters.
std::vector<std::string> Words(std::size_t length) {
  std::vector<std::string> words = {""};
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i].size() == length) break;
    words.push_back(words[i] + "a");
    words.push_back(words[i] + "b");
  }
  return words;
}

TEST(EditDistance, IsSymmetricAndZeroForEqualWordsAlone) {
  for (const std::string& a : Words(4)) {
    for (const std::string& b : Words(4)) {
      EXPECT_EQ(EditDistance(a, b), EditDistance(b, a)) << a << " " << b;
      EXPECT_EQ(EditDistance(a, b) == 0, a == b) << a << " " << b;
    }
  }
}

TEST(NearestName, IsNearOrNone) {
  const std::vector<std::string> commands = {"train", "evaluate", "report", "courses"};
  EXPECT_EQ(NearestName("trian", commands), "train");
  EXPECT_EQ(NearestName("eval", commands), std::nullopt);
  EXPECT_EQ(NearestName("evalute", commands), "evaluate");
  EXPECT_EQ(NearestName("fly", commands), std::nullopt);
  EXPECT_EQ(NearestName("", commands), std::nullopt);
  EXPECT_EQ(NearestName("train", std::vector<std::string>{}), std::nullopt);
  const std::vector<std::string> equals = {"aab", "aac"};
  EXPECT_EQ(NearestName("aad", equals), "aab") << "the first of those that are equally near";
  EXPECT_EQ(Suggestion("trian", commands), "; did you mean 'train'?");
  EXPECT_EQ(Suggestion("fly", commands), "");
}

}  // namespace
}  // namespace slalom::base
