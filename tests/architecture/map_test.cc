// The table and the picture of ARCHITECTURE.md agree, and the map has no circle and no edge up.

#include "tests/architecture/map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace slalom::architecture {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

TEST(MapTest, HasNoFault) {
  const Map map = ReadMap(ReadPage());
  EXPECT_GT(map.rows.size(), 12u);
  EXPECT_EQ(map.floors.size(), 5u);
  EXPECT_THAT(FaultsOf(map), IsEmpty());
}

// Ground, a roof on it, a hut beside the roof.
Map Small() {
  Map map;
  map.rows = {{"ground", {}}, {"hut", {"ground"}}, {"roof", {"ground", "hut"}}};
  map.levels = {{"ground", {{"ground/rock"}, {"ground", "ground/*"}, {"ground/grass"}}}};
  map.floors = {{"roof", "hut"}, {"ground"}};
  return map;
}

TEST(MapTest, EveryFaultIsFound) {
  EXPECT_THAT(FaultsOf(Small()), IsEmpty());
  Map map = Small();
  map.rows["ground"] = {"roof"};
  EXPECT_THAT(FaultsOf(map), Contains("ground/ may include roof/ on a higher floor"));
  EXPECT_THAT(FaultsOf(map), Contains("hut/ is part of a circle"));
  map = Small();
  map.rows["roof/tiles"] = {kEverything};
  map.rows["hut"].insert("roof");
  EXPECT_THAT(FaultsOf(map), Contains("hut/ is part of a circle"));
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
  map.rows["hut"].insert("roof/tiles");
  EXPECT_THAT(FaultsOf(map), Contains("hut/ may include roof/tiles/, which is not on the map"));
  map = Small();
  map.levels["ground"].push_back({"hut", "ground/rock"});
  EXPECT_THAT(FaultsOf(map),
              ElementsAre("ground/rock/ has two levels", "hut/ is not inside ground/"));
}

TEST(MapTest, AFolderIncludesTheLevelsBelowItsOwn) {
  const Map map = Small();
  EXPECT_TRUE(map.Allows("ground", "ground/rock"));
  EXPECT_TRUE(map.Allows("ground/clay", "ground/rock"));
  EXPECT_TRUE(map.Allows("ground/grass", "ground/clay"));
  EXPECT_FALSE(map.Allows("ground/rock", "ground"));
  EXPECT_FALSE(map.Allows("ground/clay", "ground/sand"));
  EXPECT_FALSE(map.Allows("ground", "ground/grass"));
}

TEST(MapTest, ANameStandsForWhatIsBelowIt) {
  const Map map = Small();
  EXPECT_TRUE(map.Allows("hut", "ground"));
  EXPECT_TRUE(map.Allows("hut/door", "ground/rock"));
  EXPECT_FALSE(map.Allows("hut", "ground/grass"));
  EXPECT_FALSE(map.Allows("hut", "ground/clay"));
  EXPECT_FALSE(map.Allows("ground/grass", "hut"));
}

TEST(MapTest, ThePathsOfAFolderAreIts) {
  const Map map = Small();
  EXPECT_EQ(map.FolderOf("ground/rock/deep/a.h"), "ground/rock");
  EXPECT_EQ(map.FolderOf("ground/clay/a.h"), "ground/clay");
  EXPECT_EQ(map.FolderOf("ground/a.h"), "ground");
  EXPECT_EQ(map.FolderOf("hut/door/a.h"), "hut");
  EXPECT_EQ(map.FolderOf("attic/box/a.h"), "attic");
  EXPECT_EQ(map.FolderOf("a.h"), "");
  EXPECT_EQ(map.RowOf("ground/rock"), "ground");
}

TEST(MapTest, APageIsReadAsWritten) {
  const std::string page =
      "## The house\n\n```\n a/ what it does [X]\n -----\n d/ e/\n```\n\n"
      "| folder | may include | inside it, from low to high | namespaces |\n|---|---|---|---|\n"
      "| `a/` | everything | `a/b/`, `a/*/` < `a/` | `a`, `b` |\n| `a/b/` | `d/`, `e/` | | |\n"
      "| `d/` | | | `d` |\n\n";
  const Map map = ReadMap(page);
  EXPECT_THAT(map.floors, ElementsAre(ElementsAre("a"), ElementsAre("d", "e")));
  EXPECT_THAT(map.rows, ElementsAre(Pair("a", Names{kEverything}), Pair("a/b", Names{"d", "e"}),
                                    Pair("d", Names{})));
  EXPECT_THAT(map.levels, ElementsAre(Pair("a", ElementsAre(Names{"a/b", "a/*"}, Names{"a"}))));
  EXPECT_THAT(map.namespaces, ElementsAre(Pair("a", Names{"a", "b"}), Pair("d", Names{"d"})));
  EXPECT_THROW((void)ReadMap("# Page\n"), std::runtime_error);
}

}  // namespace
}  // namespace slalom::architecture
