// The three forms of the map in ARCHITECTURE.md agree, and the map has no circle and no edge up.

#include "tests/architecture/map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace slalom::architecture {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(MapTest, HasNoFault) {
  const Map map = ReadMap(ReadPage());
  EXPECT_GT(map.edges.size(), 20u);
  EXPECT_EQ(map.floors.size(), 8u);
  EXPECT_THAT(FaultsOf(map), IsEmpty());
}

TEST(MapTest, TheDrawingIsThatOfTheTable) {
  const Map map = ReadMap(ReadPage());
  EXPECT_EQ(map.drawing, Draw(map.edges)) << "put this drawing into ARCHITECTURE.md:\n"
                                          << Draw(map.edges);
}

// Ground, a roof on it, a hut beside the roof.
Map Small() {
  Map map;
  map.edges = {{"ground", {}}, {"hut", {"ground"}}, {"roof", {"ground", "hut"}}};
  map.floors = {{"roof", "hut"}, {"ground"}};
  return map;
}

TEST(MapTest, EveryFaultIsFound) {
  EXPECT_THAT(FaultsOf(Small()), IsEmpty());
  Map map = Small();
  map.edges["ground"] = {"roof"};
  EXPECT_THAT(FaultsOf(map), testing::Contains("ground/ may include roof/ on a higher floor"));
  EXPECT_THAT(FaultsOf(map), testing::Contains("hut/ is part of a circle"));
  map = Small();
  map.floors[0] = {"roof"};
  EXPECT_THAT(FaultsOf(map), ElementsAre("hut/ is not in the picture"));
  map = Small();
  map.floors[1].push_back("hut");
  EXPECT_THAT(FaultsOf(map), ElementsAre("hut/ is in the picture twice"));
  map = Small();
  map.floors[1].push_back("cellar");
  EXPECT_THAT(FaultsOf(map), ElementsAre("cellar/ is in the picture alone"));
  map = Small();
  map.edges["hut"].insert("cellar");
  EXPECT_THAT(FaultsOf(map), ElementsAre("hut/ may include cellar/, which has no row"));
}

TEST(MapTest, ADrawingLeavesOutWhatOthersImply) {
  EXPECT_EQ(Draw(Small().edges), "graph TD\n  hut --> ground\n  roof --> hut\n");
  EXPECT_EQ(Draw({{"a", {}}, {"b/c", {"a"}}, {"d", {"a", "b/c"}}}),
            "graph TD\n  b_c[\"b/c\"] --> a\n  d --> b_c[\"b/c\"]\n");
}

TEST(MapTest, APageIsReadAsWritten) {
  const std::string page =
      "## The house\n\n```\n top | a/ what b/c/ does [X]\n ----+---\n low | d/*/ on e/\n```\n\n"
      "| folder | may include, beside itself |\n|---|---|\n| `a/` | `b/c/`, `d/*/` |\n| `e/` | "
      "|\n\n"
      "```mermaid\ngraph TD\n```\n";
  const Map map = ReadMap(page);
  EXPECT_THAT(map.floors, ElementsAre(ElementsAre("a", "b/c"), ElementsAre("d/*", "e")));
  EXPECT_THAT(map.edges,
              ElementsAre(testing::Pair("a", Names{"b/c", "d/*"}), testing::Pair("e", Names{})));
  EXPECT_EQ(map.drawing, "graph TD\n");
  EXPECT_THROW((void)ReadMap("# Page\n"), std::runtime_error);
}

}  // namespace
}  // namespace slalom::architecture
