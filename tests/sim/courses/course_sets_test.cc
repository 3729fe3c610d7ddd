#include "sim/courses/course_sets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_generator.h"
#include "sim/courses/course_splits.h"
#include "sim/courses/course_stream.h"
#include "sim/courses/crowd_generator.h"
#include "sim/pictures/course_render.h"
#include "sim/pictures/course_text.h"
#include "tests/sim/courses/barn_data.h"
#include "tests/support/every_value.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::set<int> Indices(std::string_view name) {
  const std::vector<int> list = FindSplit(name).value().indices;
  const std::set<int> set(list.begin(), list.end());
  EXPECT_EQ(set.size(), list.size()) << name << " lists a course twice";
  return set;
}

bool Contains(const std::set<int>& outer, const std::set<int>& inner) {
  return std::includes(outer.begin(), outer.end(), inner.begin(), inner.end());
}

bool AreDisjoint(const std::set<int>& a, const std::set<int>& b) {
  return std::none_of(a.begin(), a.end(), [&b](int i) { return b.contains(i); });
}

std::set<std::string> Names(const CourseSet& set) {
  std::set<std::string> names;
  for (const auto& course : set.courses) names.insert(course->name);
  return names;
}

std::string ErrorOf(const std::string& spec,
                    const std::optional<std::filesystem::path>& collection = std::nullopt) {
  try {
    ResolveCourses(spec, collection, 1);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

TEST_F(PublishedWorlds, AreSplitAsInThePaper) {
  const auto json = nlohmann::json::parse(base::ReadFile(directory() / "splits.json"));
  for (const auto& [name, worlds] : json.items()) {
    const CourseSplit split = FindSplit(name).value();
    std::vector<int> numbers;
    for (const int index : split.indices) numbers.push_back(FirstWorld(split.kind) + index);
    EXPECT_EQ(numbers, worlds.get<std::vector<int>>()) << name;
  }
  EXPECT_EQ(json.size(), 10u);
}

TEST(CourseSplits, AreNestedAndKeepTestAndValidationApart) {
  const char* nested[] = {"static-train-5", "static-train-10", "static-train-50",
                          "static-train-100", "static-train-250"};
  const std::size_t sizes[] = {5, 10, 50, 100, 250};
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(Indices(nested[i]).size(), sizes[i]);
    EXPECT_TRUE(AreDisjoint(Indices(nested[i]), Indices("static-test")));
    if (i > 0) EXPECT_TRUE(Contains(Indices(nested[i]), Indices(nested[i - 1])));
  }
  EXPECT_EQ(Indices("static").size(), 300u);
  const std::set<int> validation = Indices("static-validation");
  EXPECT_EQ(validation.size(), 40u);
  EXPECT_TRUE(Contains(Indices("static-train-250"), validation));
  EXPECT_TRUE(AreDisjoint(validation, Indices("static-train-100")));
  EXPECT_EQ(Indices("static-challenge").size(), 50u);
  EXPECT_TRUE(Contains(Indices("static-challenge"), {0, 6, 12, 294}));
  EXPECT_EQ(Indices("static-train-210").size(), 210u);
  EXPECT_TRUE(Contains(Indices("static-train-250"), Indices("static-train-210")));
  EXPECT_TRUE(AreDisjoint(validation, Indices("static-train-210")));
  // All of static-train-250 that is not the Challenge's: 40 of its 50 are, the others are tests.
  EXPECT_EQ(Indices("static-train-no-challenge").size(), 210u);
  EXPECT_TRUE(Contains(Indices("static-train-250"), Indices("static-train-no-challenge")));
  EXPECT_TRUE(AreDisjoint(Indices("static-challenge"), Indices("static-train-no-challenge")));
}

TEST(CourseSets, BuiltInSetsAreSlicesOfTheGeneratedCollection) {
  const CourseSet set = ResolveCourses("static-train-10", std::nullopt, 4);
  const std::vector<int> indices = FindSplit("static-train-10").value().indices;
  ASSERT_EQ(set.courses.size(), indices.size());
  EXPECT_EQ(set.name, "static-train-10");
  for (std::size_t i = 0; i < indices.size(); ++i) {
    EXPECT_EQ(*set.courses[i], *GenerateStaticCourses(4, indices[i], 1).courses.front());
  }
}

TEST(CourseSets, BuiltInValidationIsInNoOtherSet) {
  const CourseSet validation = ResolveCourses("static-validation", std::nullopt, 1);
  EXPECT_EQ(validation.courses.size(), 40u);
  EXPECT_EQ(Names(validation).size(), 40u);
  // The thinner half of the collection, which takes little time to make; streams of the rest differ
  // alike.
  for (const auto& other : GenerateStaticCourses(1, 0, 150).courses) {
    for (const auto& course : validation.courses) EXPECT_NE(course->circles, other->circles);
  }
}

TEST(CourseSplits, DynamicSetsAreHalves) {
  for (const std::string kind : {"dynamic-box", "dynamic-wall"}) {
    EXPECT_EQ(Indices(kind).size(), 100u);
    EXPECT_EQ(Indices(kind + "-train").size(), 50u);
    EXPECT_EQ(Indices(kind + "-test").size(), 50u);
    EXPECT_TRUE(AreDisjoint(Indices(kind + "-train"), Indices(kind + "-test")));
    EXPECT_TRUE(Contains(Indices(kind), Indices(kind + "-test")));
  }
  EXPECT_EQ(FindSplit("dynamic-box-tset"), std::nullopt);
  EXPECT_EQ(FindSplit("dynamic"), std::nullopt);
}

TEST(CourseSets, EverySetOfThePaperIsThereAndCanBeDriven) {
  const std::map<std::string, std::size_t> sizes = {
      {"static", 300},       {"static-test", 50},        {"static-train-250", 250},
      {"dynamic-box", 100},  {"dynamic-box-train", 50},  {"dynamic-box-test", 50},
      {"dynamic-wall", 100}, {"dynamic-wall-train", 50}, {"dynamic-wall-test", 50},
      {"real-world-1", 1},   {"real-world-2", 1},        {"real-world-3", 1}};
  const std::vector<std::string> listed = ListCourseSets(std::nullopt);
  for (const auto& [name, size] : sizes) {
    EXPECT_THAT(listed, ::testing::Contains(name));
    const CourseSet set = ResolveCourses(name, std::nullopt, 1);
    EXPECT_EQ(set.name, name);
    EXPECT_EQ(set.courses.size(), size) << name;
    EXPECT_EQ(Names(set).size(), size) << name;
    for (const auto& course : set.courses) {
      EXPECT_EQ(course->moving.empty(), !name.starts_with("dynamic")) << course->name;
    }
    // All of the dynamic courses are looked at in dynamic_generator_test.
    EXPECT_EQ(WhyUnsolvable(*set.courses.back()), std::nullopt) << name;
  }
  EXPECT_THAT(ErrorOf("real-world-4"), HasSubstr("real-world-3"));
  EXPECT_THAT(ErrorOf("real-world-"), HasSubstr("real-world-3"));
}

// Test courses of one kind must not be among the train courses of another seed or stream either.
TEST(CourseSets, DynamicTrainAndTestCoursesAreApart) {
  for (const std::string kind : {"dynamic-box", "dynamic-wall"}) {
    const CourseSet train = ResolveCourses(kind + "-train", std::nullopt, 1);
    const CourseSet test = ResolveCourses(kind + "-test", std::nullopt, 1);
    for (const auto& a : train.courses) {
      for (const auto& b : test.courses) EXPECT_NE(a->moving, b->moving);
    }
  }
}

// A set in another frame, of another size and with other obstacles than those of the paper is data.
TEST(CourseSets, ShippedExampleOfAnotherSetIsReadCheckedAndDrawn) {
  const auto file =
      std::filesystem::path(SLALOM_SOURCE_DIR) / "configs/courses/dynabarn-like.courses";
  const CourseSet set = ResolveCourses(file, std::nullopt, 1);
  EXPECT_EQ(set.name, "dynabarn-like");
  ASSERT_EQ(set.courses.size(), 2u);
  std::vector<CourseScene> scenes;
  for (const auto& course : set.courses) {
    EXPECT_EQ(course->start.p, (base::Vec2{11.0, 0.0}));
    EXPECT_EQ(base::InverseTransform(course->start, course->goal_W).x, 20.0);
    EXPECT_EQ(ReferenceLength(*course), 20.0);
    EXPECT_EQ(CourseWarnings(*course), std::vector<std::string>());
    for (const MovingObstacle& obstacle : course->moving) {
      EXPECT_EQ(obstacle.radius, 0.5);
      EXPECT_GE(obstacle.key_frames.size(), 3u);
      EXPECT_LE(obstacle.key_frames.size(), 16u);
    }
    EXPECT_THAT(DrawText(*course), AllOf(HasSubstr("m"), HasSubstr("S"), HasSubstr("G")));
    scenes.push_back({course.get(), {}});
  }
  EXPECT_EQ(set.courses[0]->moving.size(), 7u);
  EXPECT_THAT(RenderContactSheet(scenes, 2, PictureFormat::kSvg), HasSubstr("</svg>"));
  // What is read is what would be written.
  EXPECT_EQ(*ParseCourseSet(PrintCourseSet(set), "x", ".").courses[1], *set.courses[1]);
}

TEST(CourseSets, GeneratedHasAsManyAsAsked) {
  const CourseSet set = ResolveCourses("generated:9:30", std::nullopt, 1);
  EXPECT_EQ(set.courses.size(), 30u);
  EXPECT_EQ(Names(set).size(), 30u);
  EXPECT_EQ(*set.courses[7], *GenerateFreshCourses(9, 8).courses[7]);
  for (const std::string spec : {"generated:", "generated:1", "generated:1:0", "generated:-1:5",
                                 "generated:1:5x", "generated:1:999999999"}) {
    EXPECT_THAT(ErrorOf(spec), AllOf(HasSubstr(spec), HasSubstr("generated:SEED:COUNT"))) << spec;
  }
  for (const FreshKind fresh_kind : test::EveryValue<FreshKind>()) {
    if (fresh_kind == FreshKind::kStatic) continue;
    const std::string kind(base::EnumName(fresh_kind));
    const CourseSet fresh = ResolveCourses("generated-" + kind + ":9:120", std::nullopt, 1);
    EXPECT_EQ(Names(fresh).size(), 120u);
    EXPECT_EQ(fresh.courses[119]->name, "fresh-" + kind + "-9-119");
    EXPECT_EQ(fresh.courses[0]->moving.empty(), kind == "halls" || kind == "rooms");
    EXPECT_THAT(ErrorOf("generated-" + kind + ":9"),
                HasSubstr("generated-" + kind + ":SEED:COUNT"));
  }
}

TEST(CourseSets, SeveralSetsAreJoined) {
  const test::ScratchDirectory scratch;
  const std::string file = (scratch.path() / "a+b.courses").string();
  WriteCourseSet(file, {"mine", GenerateFreshCourses(2, 3).courses});
  EXPECT_EQ(Names(ResolveCourses(file, std::nullopt, 1)).size(), 3u) << "a file's name may have it";
  const CourseSet set =
      ResolveCourses("static-train-5+generated-crowds:4:2+real-world-1", std::nullopt, 1);
  ASSERT_EQ(set.courses.size(), 8u);
  EXPECT_EQ(*set.courses[0], *ResolveCourses("static-train-5", std::nullopt, 1).courses[0]);
  EXPECT_EQ(*set.courses[6], *GenerateFreshCrowdCourses(4, 2).courses[1]);
  EXPECT_EQ(set.courses[7]->name, "real-world-1");
  EXPECT_THAT(ErrorOf("static-train-5+static-tset"), HasSubstr("\"static-tset\" is neither"));
  EXPECT_THAT(ErrorOf("static-train-5+"), HasSubstr("\"\" is neither"));
  EXPECT_THAT(
      ErrorOf("static-train-10+static-train-5"),
      AllOf(HasSubstr("\"static-train-10+static-train-5\": two of these sets hold a course"),
            HasSubstr("expected sets whose courses have different names")));
}

TEST(CourseSets, UnknownNameListsWhatThereIs) {
  EXPECT_THAT(ErrorOf("static-tset"), AllOf(HasSubstr("static-tset"), HasSubstr("static-test"),
                                            HasSubstr("generated:SEED:COUNT")));
  EXPECT_THAT(ErrorOf("static-tset"), HasSubstr("; did you mean 'static-test'? There are: "));
  EXPECT_THAT(ErrorOf("nowhere"),
              AllOf(HasSubstr("a file; there are: "), Not(HasSubstr("did you mean"))));
  EXPECT_THAT(ErrorOf(""), AllOf(HasSubstr("static-test"), Not(HasSubstr("did you mean"))));
}

TEST(CourseSets, CollectionFilesAndDirectoriesAreRead) {
  const test::ScratchDirectory scratch;
  const CourseSet made = GenerateFreshCourses(2, 3);
  WriteCourseSet(scratch.path() / "static-test.courses", {"static-test", made.courses});
  WriteCourseSet(scratch.path() / "mine.courses", {"mine", {made.courses[0]}});
  EXPECT_EQ(Names(ResolveCourses("static-test", scratch.path(), 1)), Names(made));
  EXPECT_EQ(Names(ResolveCourses("mine", scratch.path(), 1)).size(), 1u);
  EXPECT_EQ(ListCourseSets(scratch.path()),
            (std::vector<std::string>{"static-test", "mine", "real-world-1", "real-world-2",
                                      "real-world-3"}));
  EXPECT_THAT(ErrorOf("static-train-5", scratch.path()),
              AllOf(HasSubstr(scratch.path().string()), HasSubstr("static-test, mine")));
  EXPECT_THAT(ErrorOf("static", "/no/such/place"), HasSubstr("/no/such/place"));
  // A path to the same file, without the collection; an empty collection is none.
  EXPECT_EQ(Names(ResolveCourses(scratch.path() / "static-test.courses", "", 1)), Names(made));

  const std::filesystem::path directory = scratch.path() / "single";
  base::MakeDirectories(directory);
  EXPECT_THAT(ErrorOf(directory), HasSubstr("empty"));
  WriteCourseSet(directory / "b.course", {"", {made.courses[1]}});
  WriteCourseSet(directory / "a.course", {"", {made.courses[2]}});
  const CourseSet set = ResolveCourses(directory, std::nullopt, 1);
  EXPECT_EQ(set.name, "single");
  ASSERT_EQ(set.courses.size(), 2u);
  EXPECT_EQ(*set.courses[0], *made.courses[2]);
  WriteCourseSet(directory / "bb.courses", {"", {made.courses[0]}});
  base::WriteFileAtomically(directory / "notes.txt", "no course");
  const CourseSet both = ResolveCourses(directory, std::nullopt, 1);
  ASSERT_EQ(both.courses.size(), 3u);
  EXPECT_EQ(*both.courses[2], *made.courses[0]);
  WriteCourseSet(directory / "c.course", {"", {made.courses[1]}});
  EXPECT_THAT(ErrorOf(directory), AllOf(HasSubstr("c.course"), HasSubstr(made.courses[1]->name)));
}

/// A corridor along y, `gap` [m] wide, from start (0, 0) to goal (0, 6).
Course Corridor(double gap) {
  Course course;
  course.name = "corridor";
  course.start = {{0.0, 0.0}, 1.5708};
  course.goal_W = {0.0, 6.0};
  course.bounds = {{-2.0, -1.0}, {2.0, 7.0}};
  for (const double side : {-1.0, 1.0}) {
    course.boxes.push_back({{{side * (0.5 * gap + 1.0), 3.0}, 0.0}, {1.0, 0.5}});
  }
  return course;
}

TEST(CourseSets, ACourseThatCannotBeDrivenIsRefusedWithTheReason) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path file = scratch.path() / "x.course";
  const auto refusal = [&](const Course& course) {
    WriteCourseSet(file, {"x", {std::make_shared<const Course>(course)}});
    return ErrorOf(file);
  };
  EXPECT_EQ(refusal(Corridor(0.5)), "");
  EXPECT_THAT(refusal(Corridor(0.38)),
              AllOf(HasSubstr("x.course: course corridor"), HasSubstr("no corridor")));
  // A corridor that is wide enough, but turned by cylinders into one that is not.
  Course course = Corridor(0.6);
  course.circles.push_back({{0.0, 3.0}, 0.1});
  EXPECT_THAT(refusal(course), HasSubstr("no corridor"));
  course = Corridor(1.0);
  course.circles.push_back({{0.15, 0.2}, 0.05});
  EXPECT_THAT(refusal(course), HasSubstr("at the start"));
  // Beside the robot's outline, though within its length.
  course.circles.back().p_W = {0.27, 0.0};
  EXPECT_EQ(refusal(course), "");
  // Aslant past a corner of the outline: only the axes of the slanted box keep them apart.
  course.boxes.push_back({{{0.4, 0.4}, -0.785}, {0.3, 0.05}});
  EXPECT_EQ(refusal(course), "");
  course.boxes.back().X_WB.p = {0.2, 0.25};
  EXPECT_THAT(refusal(course), HasSubstr("at the start"));
  course = Corridor(1.0);
  course.circles.push_back({{0.1, 6.1}, 0.1});
  EXPECT_THAT(refusal(course), HasSubstr("at the goal"));
  course = Corridor(1.0);
  course.goal_W = {0.0, 60.0};
  EXPECT_THAT(refusal(course), HasSubstr("outside the bounds"));
  course.bounds = {{-1e5, -1e5}, {1e5, 1e5}};
  EXPECT_THAT(refusal(course), HasSubstr("bounds cover more than"));
  WriteCourseSet(file, {"x", {}});
  EXPECT_THAT(ErrorOf(file), HasSubstr("x.course: the course set is empty"));
}

TEST(CourseSets, CoursesOfOnesOwnGetAReferencePathIfTheyHaveNone) {
  const test::ScratchDirectory scratch;
  const auto file = scratch.path() / "x.courses";
  Course wall = Corridor(0.6);
  wall.name = "wall";
  wall.boxes[0].half_size.x += 0.5;  // Across the straight line, which leaves 1.3 m on the left.
  wall.bounds.min_W.x = -5.0;
  Course drawn = wall;
  drawn.name = "drawn";
  drawn.reference_path_W = {{-3.0, 3.0}};
  WriteCourseSet(
      file, {"x",
             {std::make_shared<const Course>(Corridor(0.6)), std::make_shared<const Course>(wall),
              std::make_shared<const Course>(drawn)}});
  const CourseSet of_file = ResolveCourses(file, std::nullopt, 1);
  ASSERT_EQ(of_file.courses.size(), 3u);
  EXPECT_EQ(*of_file.courses[0], Corridor(0.6));
  EXPECT_GT(ReferenceLength(*of_file.courses[1]), 6.5);
  EXPECT_EQ(*of_file.courses[2], drawn);
  const CourseSet of_directory = ResolveCourses(scratch.path(), std::nullopt, 1);
  EXPECT_EQ(*of_directory.courses[1], *of_file.courses[1]);
  // Collections and evaluations are as they were imported and driven.
  EXPECT_EQ(*ResolveCourses("x", scratch.path(), 1).courses[1], wall);
  EXPECT_EQ(*ReadCourseSet(file).courses[1], wall);
}

TEST(CourseSets, AnObstacleOutsideTheBoundsIsRefusedWithItsLine) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path file = scratch.path() / "x.course";
  const auto refusal = [&](const std::string& obstacle) {
    base::WriteFileAtomically(file, "slalom-courses 1\ncourse x\n" + obstacle +
                                        "\nstart 0 0 0\ngoal 0 6\nbounds -2 -1 2 7\nend\n"
                                        "checksum none\n");
    return ErrorOf(file);
  };
  EXPECT_THAT(refusal("circle 0 40 0.5"),
              HasSubstr("x.course:3: \"circle 0 40 0.5\" is wholly outside the bounds of course x, "
                        "expected it inside x = -2 to 2 and y = -1 to 7, at least in part"));
  EXPECT_THAT(refusal("circle -2.6 3 0.5"), HasSubstr("x.course:3: "));
  EXPECT_EQ(refusal("circle -2.4 3 0.5"), "");
  EXPECT_THAT(refusal("box 4 3 0 1 0.1"), HasSubstr("x.course:3: \"box 4 3 0 1 0.1\" is wholly"));
  EXPECT_EQ(refusal("box 4 3 0 2.5 0.1"), "");
  EXPECT_THAT(refusal("box 4 3 1.5708 2.5 0.1"), HasSubstr("x.course:3: "));
  EXPECT_EQ(ReadCourseSet(file).courses.size(), 1u);  // As an evaluation may have driven it.
}

TEST(CourseSets, EveryGeneratedCourseCanBeDriven) {
  for (const auto& course : GenerateFreshCourses(17, 48).courses) {
    EXPECT_EQ(WhyUnsolvable(*course), std::nullopt) << course->name;
  }
}

TEST(CourseSets, AreBuiltInOrReadFromFiles) {
  for (const char* spec : {"static-train-50", "static-validation", "real-world-1", "generated:1:2",
                           "generated-rooms:3:4", "static-test+generated:1:2"}) {
    EXPECT_FALSE(ReadsFiles(spec, std::nullopt)) << spec;
    EXPECT_FALSE(ReadsFiles(spec, "")) << spec;
  }
  for (const char* spec : {"own.courses", "static-test+own.courses", "real-world-9", ""}) {
    EXPECT_TRUE(ReadsFiles(spec, std::nullopt)) << spec;
  }
  EXPECT_TRUE(ReadsFiles("static-train-50", "barn"));
  EXPECT_FALSE(ReadsFiles("generated:1:2+real-world-2", "barn"));
}

}  // namespace
}  // namespace slalom::sim
