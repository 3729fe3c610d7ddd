#include "sim/course_file.h"

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
#include "sim/course_generator.h"
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
  for (std::size_t size = 0; size < text.size(); ++size) {
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
  EXPECT_THAT(ErrorOf(Edited("courses 1", "courses 2")), HasSubstr("x.courses:1: unknown version"));
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
  EXPECT_THAT(ErrorOf(Edited("end\n", "end\ncircle 1 1 1\n")),
              HasSubstr("x.courses:10: found \"circle\""));
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
