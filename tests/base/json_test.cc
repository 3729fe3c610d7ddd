#include "base/json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "base/error.h"

namespace slalom::base {
namespace {

std::string Nested(int depth) { return std::string(depth, '[') + std::string(depth, ']'); }

TEST(Json, IsReadToACertainDepth) {
  EXPECT_EQ(ParseJson(Nested(kMaxJsonDepth)).dump(), Nested(kMaxJsonDepth));
  EXPECT_TRUE(ParseJson(Nested(kMaxJsonDepth + 1)).is_discarded());
  EXPECT_TRUE(ParseJson(std::string(10'000'000, '{')).is_discarded());
  EXPECT_TRUE(ParseJson("{\"a\": 1").is_discarded()) << "no JSON";
}

TEST(Json, BracketsInTextsAndBesideEachOtherAreNotDepth) {
  const std::string text = "[\"" + std::string(1000, '[') + "\\\"" + std::string(1000, '{') + "\"]";
  EXPECT_TRUE(ParseJson(text).is_array());
  std::string many = "[";
  for (int i = 0; i < 1000; ++i) many += "[{}],";
  EXPECT_EQ(ParseJson(many + "1]").size(), 1001u);
}

TEST(JsonObject, NamesSourceAndKeyOfWhatIsNotAsExpected) {
  const nlohmann::json json =
      ParseJson(R"({"n": 2.5, "t": "a", "l": [{"k": 1}, {}], "o": {"z": null}})");
  const JsonObject object(json, "file");
  EXPECT_EQ(object.Number("n", 0, 3), 2.5);
  EXPECT_EQ(object.Text("t"), "a");
  EXPECT_EQ(object.Element("l", 0).Count("k"), 1);
  EXPECT_FALSE(object.Object("o").HasValue("z"));
  const auto fails = [&](const std::function<void()>& read, const std::string& error) {
    EXPECT_THAT(read, testing::ThrowsMessage<Error>(error));
  };
  fails([&] { object.Get("x"); }, "file: x is missing");
  fails([&] { object.Element("l", 1).Count("k"); }, "file: l[1].k is missing");
  fails([&] { object.Object("o").Text("z"); }, "file: o.z is null, expected a text");
  fails([&] { object.Number("n", 0, 2); }, "file: n is 2.5, expected a number from 0 to 2");
  fails([&] { object.Count("n"); }, "file: n is 2.5, expected a whole number from 0 to 1e9");
  fails([&] { object.List("t"); }, "file: t is \"a\", expected a list");
  fails([&] { object.Object("t"); }, "file: t. is \"a\", expected an object");
}

}  // namespace
}  // namespace slalom::base
