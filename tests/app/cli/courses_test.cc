#include <gmock/gmock.h>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

/// The courses command from end to end, on a small data set of moving obstacles.

namespace slalom::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kColumns[] = "world,object,size_x,size_y,x0,y0,x1,y1,yaw,period_s\n";

class CoursesTest : public ::testing::Test {
 protected:
  CoursesTest() {
    // The box drives over the start, the walls do not.
    Write("dynamic_box.csv", std::string(kColumns) + "307,a,0.2,0.4,-2,14,-2,0.5,0.1,12\n");
    Write("dynamic_box_fixed.csv", "name,size_x,size_y,x,y,yaw\nleft,0.1,13.5,-9,7.25,0\n");
    Write("dynamic_wall.csv", std::string(kColumns) +
                                  "400,right,0.1,4,0,7.25,-4.5,7.25,0.1,4.25\n"
                                  "400,left,0.1,4,-4.5,7.25,0,7.25,0,3.5\n");
    Write("dynamic_wall_fixed.csv", "x,y\n-4.425,0.075\n-0.075,0.075\n");
  }

  void Write(const std::string& name, const std::string& content) {
    base::WriteFileAtomically(scratch_.path() / name, content);
  }

  ProgramResult Courses(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "courses");
    return RunProgram(arguments, scratch_.path());
  }

  ScratchDirectory scratch_;
};

TEST_F(CoursesTest, MovingObstaclesAreImportedListedShownAndDrawn) {
  const ProgramResult refused = Courses({"import", ".", "--output", "coll"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("99 of the 100 worlds of dynamic-box are missing: 300 to "
                              "306, 308 to 399; 99 of"),
                    HasSubstr("--incomplete")));
  const ProgramResult import = Courses({"import", ".", "--output", "coll", "--incomplete"});
  EXPECT_EQ(import.exit_code, 0) << import.err;
  EXPECT_THAT(import.out, HasSubstr("coll: 2 courses; sets dynamic-box-1-of-100, "
                                    "dynamic-wall-1-of-100\n"));
  EXPECT_THAT(import.err, AllOf(HasSubstr("warning: barn-box-307: 1 of 1 moving obstacles"),
                                HasSubstr("not written"), HasSubstr("dynamic-wall-test")));

  const ProgramResult list = Courses({"list", "--collection", "coll"});
  EXPECT_THAT(list.out, AllOf(HasSubstr("dynamic-box-1-of-100        1  1 with a warning"),
                              HasSubstr("dynamic-wall-1-of-100        1\n"),
                              HasSubstr("real-world-3                1\n")));

  const ProgramResult show = Courses({"show", "coll/dynamic-box-1-of-100.courses"});
  EXPECT_THAT(
      show.out,
      AllOf(HasSubstr("name:            barn-box-307\n"), HasSubstr(":"),
            HasSubstr("1 moving: rounds of 12.0 to 12.0 s, 1.12 m/s in the mean, at most 1.41 m/s"),
            HasSubstr("warning:         1 of 1 moving obstacles drive over")));

  const ProgramResult render = Courses({"render", "--collection", "coll", "--courses",
                                        "dynamic-wall-1-of-100", "--output", "wall.svg"});
  EXPECT_EQ(render.exit_code, 0) << render.err;
  EXPECT_THAT(base::ReadFile(scratch_.path() / "wall.svg"), HasSubstr("</svg>"));
}

TEST_F(CoursesTest, JoinedSetsAreWrittenToOneFileThatCanBeRead) {
  const std::string joined = "generated-crowds:3:2+generated-rooms:3:1";
  const ProgramResult made = Courses({"generate", "--courses", joined, "--output", "j.courses"});
  EXPECT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(base::ReadFile(scratch_.path() / "j.courses"),
              HasSubstr("set generated-crowds-3-2-generated-rooms-3-1\n"));
  const ProgramResult show = Courses({"show", "j.courses"});
  EXPECT_EQ(show.exit_code, 0) << show.err;
  EXPECT_THAT(show.out, AllOf(HasSubstr("fresh-crowds-3-001"), HasSubstr("fresh-rooms-3-000")));
}

TEST_F(CoursesTest, AMapAndAWorldBecomeCourses) {
  Write("map.pgm", "P2 4 2 255\n254 254 254 254\n254 254 254 254\n");
  Write("map.yaml",
        "image: map.pgm\nresolution: 1\norigin: [-2, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
        "free_thresh: 0.196\n");
  Write("hall.world", "<sdf version='1.6'><world name='w'/></sdf>");
  const std::vector<std::string> ends = {"--start", "-1", "1", "0.5", "--goal", "1.5", "1"};
  const auto import = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "import");
    arguments.insert(arguments.end(), ends.begin(), ends.end());
    return Courses(arguments);
  };
  const ProgramResult map = import({"map.yaml", "--output", "office.course"});
  EXPECT_EQ(map.exit_code, 0) << map.err;
  EXPECT_THAT(map.out, HasSubstr("office.course: course office, 0 cylinders and 4 boxes on 6.0 x"));
  EXPECT_THAT(map.err, HasSubstr("0 of 8 cells are unknown"));
  const std::string course = base::ReadFile(scratch_.path() / "office.course");
  EXPECT_THAT(course, AllOf(HasSubstr("\nstart -1 1 0.5\n"), HasSubstr("\ngoal 1.5 1\n")));
  EXPECT_EQ(Courses({"show", "office.course"}).exit_code, 0);
  const ProgramResult world = import({"hall.world", "--output", "hall.course"});
  EXPECT_EQ(world.exit_code, 0) << world.err;
  EXPECT_THAT(world.err, HasSubstr("the world has no obstacle"));

  const auto refusal = [&](const std::vector<std::string>& arguments) {
    const ProgramResult result = import(arguments);
    EXPECT_EQ(result.exit_code, 1);
    return result.err;
  };
  EXPECT_THAT(refusal({"map.yaml", "--output", "office.course"}), HasSubstr("office.course"));
  EXPECT_EQ(base::ReadFile(scratch_.path() / "office.course"), course);
  EXPECT_THAT(refusal({"map.pgm", "--output", "a.course"}), HasSubstr("description of a map"));
  EXPECT_THAT(refusal({".", "--output", "a"}), HasSubstr("--start is for a world or map"));
  EXPECT_THAT(refusal({"map.yaml", "--output", "a.course", "--incomplete"}),
              HasSubstr("--incomplete is for the original data set"));
  EXPECT_THAT(refusal({"hall.world", "--output", "a.course", "--unknown", "free"}),
              HasSubstr("--unknown is for a map"));
  EXPECT_THAT(refusal({"hall.world", "--output", "a b.course"}), HasSubstr("\"a b\""));
  const ProgramResult endless = Courses({"import", "map.yaml", "--output", "a.course"});
  EXPECT_EQ(endless.exit_code, 1);
  EXPECT_THAT(endless.err, HasSubstr("--start is missing"));
  EXPECT_FALSE(std::filesystem::exists(scratch_.path() / "a.course"));
}

TEST_F(CoursesTest, WhatCannotBeImportedOrFoundIsNamed) {
  EXPECT_THAT(Courses({"import", ".", "--motions", "/", "--output", "coll"}).err,
              HasSubstr("/: holds neither dynamic_box.csv nor dynamic_wall.csv"));
  Write("dynamic_wall.csv", std::string(kColumns) + "400,right,0.1,4,0,7.25,-4.5,7.25,0.1,zero\n");
  const ProgramResult import = Courses({"import", ".", "--output", "coll"});
  EXPECT_EQ(import.exit_code, 1);
  EXPECT_THAT(import.err, HasSubstr("dynamic_wall.csv:2: period_s is \"zero\""));
  EXPECT_FALSE(std::filesystem::exists(scratch_.path() / "coll"));

  const ProgramResult show = Courses({"show", "dynamic-bx"});
  EXPECT_EQ(show.exit_code, 1);
  EXPECT_THAT(show.err, AllOf(HasSubstr("\"dynamic-bx\""), HasSubstr("dynamic-box-test"),
                              HasSubstr("real-world-2"), HasSubstr("generated-wall:SEED:COUNT")));
  EXPECT_THAT(Courses({"show", "static-test", "static-1-25"}).err,
              HasSubstr("did you mean 'static-1-250'?"));
  EXPECT_EQ(Courses({"list", "--seed", "-1"}).exit_code, 2);
}

}  // namespace
}  // namespace slalom::test
