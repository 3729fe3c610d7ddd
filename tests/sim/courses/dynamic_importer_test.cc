#include "sim/courses/dynamic_importer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"
#include "sim/courses/barn_importer.h"
#include "sim/courses/course_sets.h"
#include "sim/courses/dynamic_generator.h"
#include "tests/sim/courses/barn_data.h"
#include "tests/support/error_of.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using test::ErrorOf;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST_F(PublishedWorlds, MoveAsTheFilesSay) {
  const std::vector<DynamicMotions> all = ReadMotions(directory());
  ASSERT_EQ(all.size(), 2u);
  for (std::size_t kind = 0; kind < 2; ++kind) {
    const auto expected =
        ReadBarnMotions(directory() / (kind == 0 ? "dynamic_box.csv" : "dynamic_wall.csv"));
    ASSERT_EQ(all[kind].worlds.size(), 100u);
    for (int i = 0; i < 100; ++i) {
      EXPECT_EQ(all[kind].worlds.at(FirstWorld(all[kind].kind) + i),
                expected[static_cast<std::size_t>(i)]);
    }
  }
  // The first line, read by eye.
  const MovingObstacle& box = all[0].worlds.at(300).front();
  EXPECT_EQ(box.radius, 0.0);
  EXPECT_EQ(box.half_size, (base::Vec2{0.09, 0.24}));
  EXPECT_EQ(box.key_frames,
            (std::vector<KeyFrame>{{0.0, {{-0.59, 14.0}, -0.26}}, {11.04, {{-2.89, 0.5}, -0.26}}}));
  EXPECT_EQ(box.playback, Playback::kLoop);
}

TEST_F(PublishedWorlds, HaveTheGeneratedArenas) {
  const std::vector<DynamicMotions> all = ReadMotions(directory());
  const auto sorted = [](std::vector<Circle> circles) {
    std::sort(circles.begin(), circles.end(), [](const Circle& a, const Circle& b) {
      return std::pair(a.p_W.x, a.p_W.y) < std::pair(b.p_W.x, b.p_W.y);
    });
    return circles;
  };
  EXPECT_EQ(sorted(all[1].fixed->circles), sorted(DynamicWallArena("x").circles));
  EXPECT_THAT(all[1].fixed->boxes, IsEmpty());
  EXPECT_THAT(all[0].fixed->circles, IsEmpty());
  const std::vector<Box> boxes = DynamicBoxArena("x").boxes;
  ASSERT_EQ(all[0].fixed->boxes.size(), boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    EXPECT_EQ(all[0].fixed->boxes[i].X_WB.p, boxes[i].X_WB.p);
    EXPECT_EQ(all[0].fixed->boxes[i].half_size, boxes[i].half_size);
    EXPECT_NEAR(all[0].fixed->boxes[i].X_WB.yaw, boxes[i].X_WB.yaw, 1e-5);  // 1.5708.
  }
}

TEST_F(PublishedWorlds, MotionsAloneMakeTheDynamicSets) {
  const BarnImport import = ImportBarn(directory(), std::nullopt);
  EXPECT_EQ(import.courses.size(), 200u);
  EXPECT_THAT(import.warnings, IsEmpty());
  EXPECT_THAT(import.skipped, IsEmpty());
  const test::ScratchDirectory scratch;
  const WrittenCollection written = WriteCollection(import, scratch.path());
  EXPECT_THAT(written.sets, ElementsAre("dynamic-box", "dynamic-box-train", "dynamic-box-test",
                                        "dynamic-wall", "dynamic-wall-train", "dynamic-wall-test"));
  EXPECT_EQ(written.incomplete.size(), 11u);
  const CourseSet set = ResolveCourses("dynamic-wall-test", scratch.path(), 1);
  ASSERT_EQ(set.courses.size(), 50u);
  EXPECT_EQ(*set.courses[0], *import.courses.at(450));
  EXPECT_EQ(set.courses[0]->name, "barn-wall-450");
  EXPECT_EQ(ResolveCourses("dynamic-box-train", scratch.path(), 1).courses[49]->name,
            "barn-box-349");
}

TEST_F(PublishedWorlds, FixedObstaclesComeFromTheWorldWhereItIsThere) {
  const std::filesystem::path samples = directory() / "sample_worlds";
  const BarnImport import = ImportBarn(samples, directory());
  EXPECT_EQ(import.courses.size(), 202u);
  EXPECT_THAT(import.skipped, IsEmpty());
  // World 300 of the samples has its walls' yaw to more digits than dynamic_box_fixed.csv.
  EXPECT_NE(import.courses.at(300)->boxes, import.courses.at(301)->boxes);
  EXPECT_EQ(import.courses.at(301)->boxes, import.courses.at(302)->boxes);
}

constexpr char kHeader[] = "world,object,size_x,size_y,x0,y0,x1,y1,yaw,period_s\n";
constexpr char kGood[] = "300,0,0.2,0.4,-1,14,-2,0.5,0.1,12\n";

TEST(DynamicImporter, BadLinesAreNamed) {
  const test::ScratchDirectory scratch;
  const auto refusal = [&](const std::string& text) {
    base::WriteFileAtomically(scratch.path() / "dynamic_box.csv", text);
    return ErrorOf([&] { ReadMotions(scratch.path()); });
  };
  const auto refusal_of_line = [&](const std::string& line) {
    return refusal(std::string(kHeader) + kGood + "\n" + line + "\n");
  };
  EXPECT_EQ(refusal(std::string(kHeader) + kGood), "");
  EXPECT_EQ(refusal("\xef\xbb\xbf" + std::string(kHeader) + kGood), "");
  EXPECT_EQ(refusal_of_line("301,0,0.2,0.4,-1,14,-2,0.5,0.1,12\r"), "");
  EXPECT_THAT(refusal("x,y\n1,2\n"),
              AllOf(HasSubstr("dynamic_box.csv:1:"), HasSubstr("world,object,size_x")));
  EXPECT_THAT(refusal(""), HasSubstr("dynamic_box.csv:1:"));
  EXPECT_THAT(refusal(kHeader), HasSubstr("holds no motion"));
  EXPECT_THAT(refusal_of_line("301,0,0.2,0.4,-1,14,-2,0.5,0.1"),
              AllOf(HasSubstr("dynamic_box.csv:4:"), HasSubstr("9 fields, expected 10")));
  EXPECT_THAT(refusal_of_line("301,0,0.2,wide,-1,14,-2,0.5,0.1,12"),
              AllOf(HasSubstr(":4: size_y is \"wide\""), HasSubstr("expected a number")));
  EXPECT_THAT(refusal_of_line("301,0,0.2,nan,-1,14,-2,0.5,0.1,12"), HasSubstr("\"nan\""));
  EXPECT_THAT(refusal_of_line("301,0,-0.2,0.4,-1,14,-2,0.5,0.1,12"),
              HasSubstr(":4: size_x is -0.2, expected above 0"));
  EXPECT_THAT(refusal_of_line("301,0,0.2,0.4,-1,14,-2,0.5,0.1,0"),
              HasSubstr("period_s is 0, expected above 0"));
  EXPECT_THAT(refusal_of_line("301,0,0.2,0.4,-1,14,-2,0.5,0.1,1e-9"), HasSubstr("m/s"));
  EXPECT_THAT(refusal_of_line("400,0,0.2,0.4,-1,14,-2,0.5,0.1,12"),
              HasSubstr(":4: world is 400, expected one of 300 to 399"));
  EXPECT_THAT(refusal_of_line("300.5,0,0.2,0.4,-1,14,-2,0.5,0.1,12"), HasSubstr("world is 300.5"));
  EXPECT_THAT(refusal_of_line("300,0,0.2,0.4,-1,14,-2,0.5,0.1,12"),
              HasSubstr(":4: object 0 of world 300 stands here a second time"));
}

TEST(DynamicImporter, MissingAndContradictingFilesAreNamed) {
  const test::ScratchDirectory scratch;
  const auto import = [&] { return ImportBarn(scratch.path(), std::nullopt); };
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), scratch.path()); }),
              HasSubstr("neither dynamic_box.csv nor dynamic_wall.csv"));
  base::WriteFileAtomically(scratch.path() / "dynamic_box.csv", std::string(kHeader) + kGood);
  EXPECT_THAT(import().skipped, ElementsAre(HasSubstr("dynamic_box_fixed.csv")));
  EXPECT_THAT(ErrorOf([&] { WriteCollection(import(), scratch.path() / "out"); }),
              HasSubstr("no course to write"));

  base::WriteFileAtomically(scratch.path() / "dynamic_box_fixed.csv",
                            "name,size_x,size_y,x,y,yaw\nwall,0.1,0,1,2,3\n");
  EXPECT_THAT(ErrorOf(import), HasSubstr("dynamic_box_fixed.csv:2: size_y is 0"));
  base::WriteFileAtomically(scratch.path() / "dynamic_box_fixed.csv",
                            "name,size_x,size_y,x,y,yaw\nwall,1,1,-2,3,0\n");
  EXPECT_THAT(ErrorOf(import), AllOf(HasSubstr("dynamic_box.csv"), HasSubstr("barn-box-300"),
                                     HasSubstr("at the start")));
  base::WriteFileAtomically(scratch.path() / "dynamic_box_fixed.csv",
                            "name,size_x,size_y,x,y,yaw\nwall,0.1,13.5,-9,7.25,0\n");
  EXPECT_EQ(import().courses.at(300)->boxes.size(), 1u);

  // A world of the same number with another number of moving obstacles.
  base::WriteFileAtomically(
      scratch.path() / "world_300.world",
      "<sdf><world><model><plugin/></model><model><plugin/></model></world></sdf>");
  EXPECT_THAT(ErrorOf(import), AllOf(HasSubstr("world_300.world: has 2 moving obstacles"),
                                     HasSubstr("dynamic_box.csv has 1 for world 300")));
}

}  // namespace
}  // namespace slalom::sim
