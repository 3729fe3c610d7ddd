#include "sim/scene_stream.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_overlap.h"
#include "sim/courses/course_sets.h"
#include "sim/environments.h"
#include "tests/support/every_value.h"

namespace slalom::sim {
namespace {

CourseSet FirstOfStream(const FreshMix& mix, std::uint64_t seed, int count) {
  CourseSet set{"stream", {}};
  for (int i = 0; i < count; ++i) {
    set.courses.push_back(std::make_shared<const Course>(GenerateStreamCourse(mix, seed, i)));
  }
  return set;
}

TEST(CourseStream, CoursesDependOnSeedAndNumberAloneAndCanBeDriven) {
  for (const FreshKind kind : test::EveryValue<FreshKind>()) {
    const CourseSet set = FirstOfStream({kind}, 5, 30);
    for (const int i : {29, 3, 11}) {
      EXPECT_EQ(GenerateStreamCourse({kind}, 5, i), *set.courses[i]);
      EXPECT_EQ(WhyUnsolvable(*set.courses[i]), std::nullopt);
    }
    EXPECT_EQ(CountSharedCourses(set, FirstOfStream({kind}, 6, 30)), 0);
    EXPECT_EQ(CountSharedCourses({"rest", {set.courses.begin() + 1, set.courses.end()}},
                                 {"first", {set.courses[0]}}),
              0);
  }
}

// The same seed, on purpose: what a run is scored on must not be what it was trained on.
TEST(CourseStream, SharesNoCourseWithAnySet) {
  const CourseSet set = FirstOfStream({FreshKind::kStatic}, 1, 60);
  for (const char* other : {"static", "static-validation", "generated:1:60"}) {
    EXPECT_EQ(CountSharedCourses(set, ResolveCourses(other, std::nullopt, 1)), 0) << other;
  }
  for (const FreshKind kind : test::EveryValue<FreshKind>()) {
    const std::string other = fmt::format("{}1:60", FreshCoursePrefix(kind));
    EXPECT_EQ(
        CountSharedCourses(FirstOfStream({kind}, 1, 60), ResolveCourses(other, std::nullopt, 1)), 0)
        << other;
  }
}

/// A course without its name, which tells its place in the stream.
Course Unnamed(Course course) {
  course.name.clear();
  return course;
}

TEST(CourseStream, AMixHasTheCoursesOfItsKindsInTurn) {
  const FreshMix mix = {FreshKind::kStatic, FreshKind::kCrowds, FreshKind::kStatic};
  std::map<FreshKind, int> next;
  for (int i = 0; i < 15; ++i) {
    const FreshKind kind = mix[static_cast<std::size_t>(i % 3)];
    const Course course = GenerateStreamCourse(mix, 5, i);
    EXPECT_EQ(course.name, fmt::format("stream-5-{}", i));
    EXPECT_EQ(Unnamed(course), Unnamed(GenerateStreamCourse({kind}, 5, next[kind]++))) << i;
  }
}

// Runs name their courses by the seed alone.
TEST(CourseStream, CoursesNeverChange) {
  const std::map<FreshKind, std::uint64_t> checksums = {
      {FreshKind::kStatic, 6013932312602908916u},   {FreshKind::kBox, 7647655440957750380u},
      {FreshKind::kWall, 1111732065307178125u},     {FreshKind::kCrowds, 3641813071409139520u},
      {FreshKind::kHalls, 2994435337359094707u},    {FreshKind::kRooms, 695205393682938293u},
      {FreshKind::kCylinders, 2327055012631872561u}};
  for (const FreshKind kind : test::EveryValue<FreshKind>()) {
    const std::uint64_t found = base::Checksum(PrintCourseSet(FirstOfStream({kind}, 1, 24)));
    EXPECT_TRUE(checksums.contains(kind) && checksums.at(kind) == found)
        << base::EnumName(kind) << ": " << found;
  }
}

TEST(FreshMix, IsReadFromNamesJoinedByPlus) {
  EXPECT_EQ(ParseFreshMix("none"), FreshMix());
  EXPECT_EQ(ParseFreshMix("box"), FreshMix({FreshKind::kBox}));
  EXPECT_EQ(ParseFreshMix("static+crowds+static"),
            FreshMix({FreshKind::kStatic, FreshKind::kCrowds, FreshKind::kStatic}));
  for (const char* wrong : {"", "static+", "+box", "none+box", "crowd", "static, box"}) {
    try {
      (void)ParseFreshMix(wrong);
      ADD_FAILURE() << wrong;
    } catch (const base::Error& error) {
      EXPECT_EQ(error.what(),
                fmt::format("\"{}\": expected \"none\", or one or more of static, "
                            "box, wall, crowds, halls, rooms, cylinders joined by \"+\"",
                            wrong));
    }
  }
}

TEST(SceneStream, AForgottenSceneIsMadeAgain) {
  SceneStream stream({FreshKind::kStatic}, 5, 2);
  const auto first = stream.Get(0);
  EXPECT_EQ(stream.Get(0), first) << "it is kept";
  (void)stream.Get(1);
  (void)stream.Get(0);
  (void)stream.Get(2);  // Drops 1, which was asked for longest ago.
  EXPECT_EQ(stream.Get(0), first);
  (void)stream.Get(3);
  (void)stream.Get(4);
  const auto again = stream.Get(0);
  EXPECT_NE(again, first);
  EXPECT_EQ(again->course(), first->course());
}

/// The frames of an episode on course `course`, driven straight ahead.
std::vector<std::uint16_t> Drive(CourseEnvironments& environments, int course) {
  std::vector<std::uint16_t> frames;
  std::vector<env::StepResult> results(1);
  const std::vector<env::Action> ahead(1, env::Action{0.5f, 0.1f});
  environments.Reset(0, {course, 9});
  for (int step = 0; step < 40; ++step) {
    const auto ranges = environments.observations().frame(0).ranges_cm;
    frames.insert(frames.end(), ranges.begin(), ranges.end());
    environments.Step(env::NumbersOf(ahead), results);
    if (results[0].ended()) break;
  }
  return frames;
}

TEST(EnvironmentsTest, AFreshCourseIsDrivenLikeANamedOne) {
  for (const FreshKind kind : test::EveryValue<FreshKind>()) {
    const CourseSet set = FirstOfStream({kind}, 7, 4);
    CourseEnvironments named({}, MakeScenes(set), 1, nullptr);
    CourseEnvironments fresh({}, MakeScenes({"one", {set.courses[2]}}), 1, nullptr, MakeRobots(),
                             std::make_unique<SceneStream>(FreshMix{kind}, 7, 1));
    CourseEnvironments only_fresh({}, {}, 1, nullptr, MakeRobots(),
                                  std::make_unique<SceneStream>(FreshMix{kind}, 7, 1));
    ASSERT_FALSE(named.has_fresh_courses());
    ASSERT_TRUE(fresh.has_fresh_courses());
    for (int course = 0; course < 4; ++course) {
      const auto expected = Drive(named, course);
      EXPECT_EQ(Drive(fresh, 1 + course), expected);
      EXPECT_EQ(Drive(only_fresh, course), expected);
    }
    EXPECT_EQ(Drive(fresh, 0), Drive(named, 2));
  }
}

}  // namespace
}  // namespace slalom::sim
