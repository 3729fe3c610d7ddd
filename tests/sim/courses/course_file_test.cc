#include "sim/courses/course_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "sim/courses/course_generator.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// A number below 1e5 in size whose bits are otherwise arbitrary.
double DrawNumber(base::Random& random) {
  while (true) {
    const double number = std::bit_cast<double>(random.NextU64());
    if (std::abs(number) <= 1e5) return number;
  }
}

base::Vec2 DrawPoint(base::Random& random) { return {DrawNumber(random), DrawNumber(random)}; }

/// An obstacle whose key frames, though wild, could be driven.
MovingObstacle DrawMoving(base::Random& random) {
  MovingObstacle obstacle;
  if (random.UniformInt(2) == 0) {
    obstacle.radius = random.Uniform() + 0.1;
  } else {
    obstacle.half_size = {random.Uniform() + 0.1, random.Uniform() + 0.1};
  }
  double time = 0.0;
  for (std::uint64_t n = 2 + random.UniformInt(15); n > 0; --n) {
    obstacle.key_frames.push_back({time, {{random.Uniform(), random.Uniform()}, random.Uniform()}});
    time += random.Uniform() + 0.1;
  }
  if (random.UniformInt(2) == 0) obstacle.playback = Playback::kPingPong;
  return obstacle;
}

std::shared_ptr<const Course> DrawCourse(int index, base::Random& random) {
  Course course;
  course.name = "course-" + std::to_string(index);
  course.start = {DrawPoint(random), DrawNumber(random)};
  course.goal_W = DrawPoint(random);
  course.bounds = {{-1.0 - random.Uniform(), -1.0}, {1.0, 1.0 + random.Uniform()}};
  for (std::uint64_t n = random.UniformInt(4); n > 0; --n) {
    course.circles.push_back({DrawPoint(random), std::abs(DrawNumber(random)) + 1e-3});
  }
  for (std::uint64_t n = random.UniformInt(4); n > 0; --n) {
    course.boxes.push_back(
        {{DrawPoint(random), DrawNumber(random)}, {random.Uniform() + 0.1, 0.1}});
  }
  for (std::uint64_t n = random.UniformInt(4); n > 0; --n) {
    course.reference_path_W.push_back(DrawPoint(random));
  }
  for (std::uint64_t n = random.UniformInt(4); n > 0; --n) {
    course.moving.push_back(DrawMoving(random));
  }
  if (random.UniformInt(2) == 0) {
    course.difficulty = Difficulty{DrawNumber(random), DrawNumber(random), DrawNumber(random),
                                   DrawNumber(random), DrawNumber(random)};
  }
  return std::make_shared<const Course>(std::move(course));
}

CourseSet Parse(const std::string& text) { return ParseCourseSet(text, "x.courses", "."); }

/// What the error for `text` says; empty: there is none.
std::string ErrorOf(const std::string& text) {
  try {
    Parse(text);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

TEST(CourseFile, GivesBackTheSameDoubles) {
  base::Random random(21);
  for (int i = 0; i < 300; ++i) {
    CourseSet set{"some.set-1", {}};
    for (int n = 0; n < 3; ++n) set.courses.push_back(DrawCourse(n, random));
    const CourseSet back = Parse(PrintCourseSet(set));
    EXPECT_EQ(back.name, set.name);
    ASSERT_EQ(back.courses.size(), 3u);
    for (int n = 0; n < 3; ++n) EXPECT_EQ(*back.courses[n], *set.courses[n]);
  }
}

TEST(CourseFile, RefusesEveryTruncationAndEveryChangedByte) {
  base::Random random(22);
  const std::string text = PrintCourseSet({"set", {DrawCourse(0, random), DrawCourse(1, random)}});
  EXPECT_EQ(ErrorOf(text.substr(0, text.size() - 1)), "") << "without the last line's end";
  for (std::size_t size = 0; size < text.size() - 1; ++size) {
    EXPECT_NE(ErrorOf(text.substr(0, size)), "") << "cut to " << size << " bytes";
  }
  for (std::size_t at = 0; at < text.size(); ++at) {
    for (const int flip : {0x01, 0x10, 0x80}) {
      std::string changed = text;
      changed[at] = static_cast<char>(changed[at] ^ flip);
      EXPECT_NE(ErrorOf(changed), "") << "byte " << at << " changed by " << flip;
    }
  }
  EXPECT_NE(ErrorOf(text + "\n"), "");
}

constexpr char kByHand[] =
    "slalom-courses 1\n"
    "# Made by hand.\n"
    "\n"
    "course corner   # a name\n"
    "  start 0 0 0\n"
    "  goal\t5 1e0\r\n"
    "  bounds -1 -1 6 6\n"
    "  box 2 3 0.5 1 0.1\n"
    "end\n"
    "checksum none\n";

TEST(CourseFile, CanBeWrittenByHand) {
  const CourseSet set = Parse(kByHand);
  EXPECT_EQ(set.name, "");
  ASSERT_EQ(set.courses.size(), 1u);
  const Course& course = *set.courses[0];
  EXPECT_EQ(course.name, "corner");
  EXPECT_EQ(course.goal_W, (base::Vec2{5.0, 1.0}));
  EXPECT_EQ(course.boxes, (std::vector<Box>{{{{2.0, 3.0}, 0.5}, {1.0, 0.1}}}));
  EXPECT_FALSE(course.difficulty.has_value());
}

/// kByHand with one piece of text replaced.
std::string Edited(const std::string& from, const std::string& to) {
  std::string text = kByHand;
  return text.replace(text.find(from), from.size(), to);
}

TEST(CourseFile, ErrorsNameFileLineAndWhatWasExpected) {
  EXPECT_THAT(ErrorOf(""), HasSubstr("x.courses: the file is empty"));
  EXPECT_THAT(ErrorOf("<sdf>\n"), AllOf(HasSubstr("x.courses:1:"), HasSubstr("slalom-courses 1")));
  EXPECT_THAT(ErrorOf(Edited("courses 1", "courses 3")), HasSubstr("x.courses:1: unknown version"));
  EXPECT_THAT(ErrorOf(Edited("start 0 0 0", "start 0 0")),
              HasSubstr("x.courses:5: \"start\" takes 3 numbers (x y yaw), found 2"));
  EXPECT_THAT(ErrorOf(Edited("start 0 0 0", "start 0 0 1m")), HasSubstr("x.courses:5: \"1m\""));
  EXPECT_THAT(ErrorOf(Edited("start 0 0 0", "start 0 0 nan")), HasSubstr("x.courses:5: \"nan\""));
  EXPECT_THAT(ErrorOf(Edited("start 0 0 0", "start 0 0 1e6")), HasSubstr("between -1e5 and 1e5"));
  EXPECT_THAT(ErrorOf(Edited("goal\t5 1e0\r\n", "\n")),
              HasSubstr("x.courses:9: course corner has no \"goal\""));
  EXPECT_THAT(ErrorOf(Edited("goal\t5", "start 0 0 0\ngoal 5")),
              HasSubstr("a second \"start\" line"));
  EXPECT_THAT(ErrorOf(Edited("box 2 3 0.5 1", "box 2 3 0.5 0")), HasSubstr("x.courses:8:"));
  EXPECT_THAT(ErrorOf(Edited("box", "boxx")), HasSubstr("x.courses:8: unknown line \"boxx\""));
  EXPECT_THAT(ErrorOf(Edited("-1 -1 6 6", "6 6 -1 -1")), HasSubstr("smaller corner"));
  EXPECT_THAT(ErrorOf(Edited("corner ", "co/rner ")), HasSubstr("x.courses:4: expected one name"));
  EXPECT_THAT(ErrorOf(Edited("end\n", "")),
              HasSubstr("x.courses:9: course corner has no \"end\" line"));
  EXPECT_THAT(ErrorOf(Edited("checksum none", "checksum 0123456789abcdef")),
              HasSubstr("was damaged or edited"));
  EXPECT_THAT(ErrorOf(Edited("checksum none\n", "")), HasSubstr("cut short"));
  EXPECT_THAT(ErrorOf(Edited("checksum none\n", "circle 1 1 1")), HasSubstr("cut short"));
  EXPECT_EQ(ErrorOf(Edited("checksum none\n", " checksum none # by hand")), "");
  EXPECT_THAT(ErrorOf(Edited("end\n", "end\ncircle 1 1 1\n")),
              HasSubstr("x.courses:10: found \"circle\""));
}

constexpr char kMoving[] =
    "slalom-courses 2\n"
    "course crossing\n"
    "start 11 0 3.14159\n"
    "goal -9 0\n"
    "bounds -11 -11 12 11\n"
    "moving cylinder 0.5 ping-pong\n"
    "  key 0 -10 4 0\n"
    "\n"
    "  key 5.5 0 2.5 0 # half way\n"
    "  key 9 10 4 0\n"
    "moving box 0.2 0.3 loop\n"
    "key 0 1 2 3\n"
    "key 4 5 6 7\n"
    "path 0 1\n"
    "end\n"
    "checksum none\n";

std::string EditedMoving(const std::string& from, const std::string& to) {
  std::string text = kMoving;
  return text.replace(text.find(from), from.size(), to);
}

TEST(CourseFile, MovingObstaclesOfAnyKindAreRead) {
  const CourseSet set = Parse(kMoving);
  const Course& course = *set.courses.at(0);
  ASSERT_EQ(course.moving.size(), 2u);
  EXPECT_EQ(course.moving[0],
            (MovingObstacle{
                0.5,
                {},
                {{0.0, {{-10.0, 4.0}, 0.0}}, {5.5, {{0.0, 2.5}, 0.0}}, {9.0, {{10.0, 4.0}, 0.0}}},
                Playback::kPingPong}));
  EXPECT_EQ(
      course.moving[1],
      (MovingObstacle{
          0.0, {0.2, 0.3}, {{0.0, {{1.0, 2.0}, 3.0}}, {4.0, {{5.0, 6.0}, 7.0}}}, Playback::kLoop}));
  EXPECT_EQ(course.reference_path_W, (std::vector<base::Vec2>{{0.0, 1.0}}));
}

TEST(CourseFile, BadMotionsAreNamedWithTheirLine) {
  const auto refusal = [](const std::string& from, const std::string& to) {
    return ErrorOf(EditedMoving(from, to));
  };
  EXPECT_THAT(refusal("courses 2", "courses 1"),
              AllOf(HasSubstr("x.courses:6:"), HasSubstr("slalom-courses 2")));
  EXPECT_THAT(refusal("cylinder 0.5", "cylinder 0"), HasSubstr("x.courses:6: the radius"));
  EXPECT_THAT(refusal("cylinder 0.5", "cylinder -1"), HasSubstr("must be above 0"));
  EXPECT_THAT(refusal("cylinder 0.5", "cylinder nan"), HasSubstr("x.courses:6: \"nan\""));
  EXPECT_THAT(refusal("cylinder 0.5", "cylinder"), HasSubstr("takes 1 numbers (radius), found 0"));
  EXPECT_THAT(refusal("cylinder 0.5", "sphere 0.5"),
              HasSubstr("x.courses:6: \"moving\" is followed by \"cylinder\" or \"box\""));
  EXPECT_THAT(refusal("cylinder 0.5 ping-pong", ""), HasSubstr("x.courses:6:"));
  EXPECT_THAT(refusal("box 0.2 0.3", "box 0.2 0"), HasSubstr("x.courses:11: the half sizes"));
  EXPECT_THAT(refusal("box 0.2 0.3", "box 0.2"), HasSubstr("takes 2 numbers (half_x half_y)"));
  EXPECT_THAT(refusal("ping-pong", "once"),
              AllOf(HasSubstr("x.courses:6:"), HasSubstr("\"loop\" or \"ping-pong\""),
                    HasSubstr("found \"once\"")));
  EXPECT_THAT(refusal("0.3 loop", "0.3"), HasSubstr("found \"0.3\""));
  EXPECT_THAT(refusal("key 0 -10", "key 1 -10"),
              HasSubstr("x.courses:7: the first key frame is at 1 s, expected 0"));
  EXPECT_THAT(refusal("key 9", "key 5.5"),
              AllOf(HasSubstr("x.courses:10:"), HasSubstr("not after the one before it")));
  EXPECT_THAT(refusal("key 9", "key 2"), HasSubstr("key frame 2 is at 2 s"));
  EXPECT_THAT(refusal("key 9", "key 5.500001"), HasSubstr("m/s"));
  EXPECT_THAT(refusal("key 9 10 4 0", "key 9 10 4"),
              HasSubstr("\"key\" takes 4 numbers (time x y yaw), found 3"));
  EXPECT_THAT(refusal("key 9 10 4 0", "key 9 10 inf 0"), HasSubstr("x.courses:10: \"inf\""));
  EXPECT_THAT(
      refusal("key 4 5 6 7\n", ""),
      HasSubstr("x.courses:11: this moving obstacle has 1 \"key\" line, expected 2 or more"));
  EXPECT_THAT(refusal("key 4 5 6 7\npath 0 1\nend\n", "end\n"), HasSubstr("x.courses:11:"));
  EXPECT_THAT(refusal("moving box 0.2 0.3 loop\nkey 0 1 2 3", "moving box 0.2 0.3 loop"),
              HasSubstr("the first key frame is at 4 s"));
  EXPECT_THAT(refusal("path 0 1\n", "path 0 1\nkey 5 5 6 7\n"),
              HasSubstr("x.courses:15: a \"key\" line must follow"));
}

TEST(CourseFile, ExampleOfTheManualIsOne) {
  const std::string page =
      base::ReadFile(std::filesystem::path(SLALOM_SOURCE_DIR) / "docs" / "courses.md");
  const std::size_t begin = page.find("slalom-courses 2\nset corridors");
  ASSERT_NE(begin, std::string::npos);
  const CourseSet set = Parse(page.substr(begin, page.find("```", begin) - begin));
  EXPECT_EQ(set.name, "corridors");
  EXPECT_EQ(set.courses.at(0)->moving.size(), 2u);
}

// So that files of static courses, and their checksums, are what older programs read and wrote.
TEST(CourseFile, VersionIsTheOldestThatHoldsTheSet) {
  Course course = *Parse(kByHand).courses.at(0);
  const auto print = [&] {
    return PrintCourseSet({"s", {std::make_shared<const Course>(course)}});
  };
  EXPECT_TRUE(print().starts_with("slalom-courses 1\n"));
  course.moving = Parse(kMoving).courses.at(0)->moving;
  EXPECT_TRUE(print().starts_with("slalom-courses 2\n"));
}

TEST(CourseFile, MayBeginWithAByteOrderMark) {
  const test::ScratchDirectory scratch;
  const CourseSet set = GenerateFreshCourses(1, 1);
  const std::string mark = "\xef\xbb\xbf";
  base::WriteFileAtomically(scratch.path() / "one.courses", mark + PrintCourseSet(set));
  base::WriteFileAtomically(scratch.path() / "all.courses",
                            mark + "slalom-courses 1\r\nfile one.courses\r\nchecksum none");
  const CourseSet read = ReadCourseSet(scratch.path() / "all.courses");
  ASSERT_EQ(read.courses.size(), 1u);
  EXPECT_EQ(*read.courses[0], *set.courses[0]);
}

TEST(CourseFile, NamesAreUnique) {
  base::Random random(23);
  EXPECT_THAT(ErrorOf(PrintCourseSet({"set", {DrawCourse(0, random), DrawCourse(0, random)}})),
              HasSubstr("a second course is named course-0"));
}

TEST(CourseFile, SetsMayNameFiles) {
  const test::ScratchDirectory scratch;
  base::MakeDirectories(scratch.path() / "courses");
  const CourseSet courses = GenerateFreshCourses(1, 2);
  WriteCourseSet(scratch.path() / "courses" / "a.course", {"", {courses.courses[0]}});
  WriteCourseSet(scratch.path() / "courses" / "b.course", {"", {courses.courses[1]}});
  const std::filesystem::path path = scratch.path() / "both.courses";
  base::WriteFileAtomically(path,
                            "slalom-courses 1\nset both\nfile courses/a.course\n"
                            "file courses/b.course\nchecksum none\n");
  const CourseSet set = ReadCourseSet(path);
  EXPECT_EQ(set.name, "both");
  ASSERT_EQ(set.courses.size(), 2u);
  EXPECT_EQ(*set.courses[1], *courses.courses[1]);

  std::filesystem::remove(scratch.path() / "courses" / "b.course");
  EXPECT_THROW(ReadCourseSet(path), base::Error);
  // A file that names itself would be read for ever.
  base::WriteFileAtomically(scratch.path() / "loop.courses",
                            "slalom-courses 1\nfile loop.courses\nchecksum none\n");
  EXPECT_THROW(ReadCourseSet(scratch.path() / "loop.courses"), base::Error);
}

TEST(CourseFile, FileThatIsNotThereIsNamed) {
  try {
    ReadCourseSet("/no/such/file.courses");
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("/no/such/file.courses"));
  }
}

}  // namespace
}  // namespace slalom::sim
