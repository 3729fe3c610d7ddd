#include "sim/courses/barn_importer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "sim/courses/barn_field.h"
#include "sim/courses/course_sets.h"
#include "tests/sim/courses/barn_data.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// What the error of `call` says; empty: there is none.
template <class Call>
std::string ErrorOf(const Call& call) {
  try {
    call();
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

std::vector<std::pair<double, double>> Centres(const std::vector<Circle>& circles) {
  std::vector<std::pair<double, double>> centres;
  for (const Circle& circle : circles) centres.push_back({circle.p_W.x, circle.p_W.y});
  std::sort(centres.begin(), centres.end());
  return centres;
}

/// The world files give the same fixed obstacles as the text files beside the motions.
void ExpectSameObstacles(const Course& a, const Course& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.moving, b.moving);
  EXPECT_EQ(Centres(a.circles), Centres(b.circles)) << a.name;
  ASSERT_EQ(a.boxes.size(), b.boxes.size());
  for (std::size_t i = 0; i < a.boxes.size(); ++i) {
    const auto same = [&](const Box& box) {
      return base::Norm(box.X_WB.p - a.boxes[i].X_WB.p) < 1e-9 &&
             std::abs(box.X_WB.yaw - a.boxes[i].X_WB.yaw) < 1e-4 &&
             base::Norm(box.half_size - a.boxes[i].half_size) < 1e-9;
    };
    EXPECT_TRUE(std::any_of(b.boxes.begin(), b.boxes.end(), same)) << a.name << " box " << i;
  }
}

TEST_F(PublishedWorlds, ImportAsTheTextGrids) {
  const test::ScratchDirectory scratch;
  const std::string command = "tar -xJf '" + (directory() / "barn_worlds.tar.xz").string() +
                              "' -C '" + scratch.path().string() + "'";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;

  const BarnImport import = ImportBarn(scratch.path(), directory());
  const std::vector<BarnWorld> worlds = ReadBarnWorlds(directory());
  ASSERT_EQ(import.courses.size(), 500u);
  ASSERT_EQ(worlds.size(), 300u);
  double shortest = 1e9, longest = 0.0;
  std::size_t fewest = 1000, most = 0;
  for (const BarnWorld& world : worlds) {
    const Course& course = *import.courses.at(world.number);
    ASSERT_EQ(Centres(course.circles), Centres(world.circles)) << course.name;
    for (const Circle& circle : course.circles) EXPECT_EQ(circle.radius, 0.075);
    ASSERT_EQ(course.reference_path_W.size(), world.path.size()) << course.name;
    for (std::size_t i = 0; i < world.path.size(); ++i) {
      EXPECT_EQ(course.reference_path_W[i], CellCentre(world.path[i]));
    }
    EXPECT_TRUE(course.difficulty.has_value());
    shortest = std::min(shortest, ReferenceLength(course));
    longest = std::max(longest, ReferenceLength(course));
    fewest = std::min(fewest, course.circles.size());
    most = std::max(most, course.circles.size());
  }
  // docs/original-system.md, section 1.5.
  EXPECT_NEAR(shortest, 10.03, 0.005);
  EXPECT_NEAR(longest, 13.73, 0.005);
  EXPECT_EQ(fewest, 181u);
  EXPECT_EQ(most, 365u);
  EXPECT_THAT(import.warnings, ElementsAre(HasSubstr("300 to 399 (100 in all)")));
  EXPECT_TRUE(import.skipped.empty());
  for (const auto& [number, course] : ImportBarn(directory(), std::nullopt).courses) {
    ExpectSameObstacles(*import.courses.at(number), *course);
  }

  const std::filesystem::path output = scratch.path() / "collection";
  const WrittenCollection written = WriteCollection(import, output);
  EXPECT_EQ(written.sets.size(), 17u);
  EXPECT_TRUE(written.incomplete.empty());
  const CourseSet set = ResolveCourses("static-train-10", output, 1);
  ASSERT_EQ(set.courses.size(), 10u);
  EXPECT_EQ(*set.courses[0], *import.courses.at(153));
}

TEST_F(PublishedWorlds, ImportWithPathsBesideThem) {
  const std::filesystem::path samples = directory() / "sample_worlds";
  const BarnImport import = ImportBarn(samples, std::nullopt);
  ASSERT_EQ(import.courses.size(), 2u);
  EXPECT_EQ(import.courses.at(0)->name, "barn-000");
  EXPECT_EQ(import.courses.at(299)->reference_path_W.size(), 31u);
  EXPECT_THAT(import.skipped,
              ElementsAre(AllOf(HasSubstr("300, 400 (2 in all)"), HasSubstr("compiled plugins"))));
  const test::ScratchDirectory scratch;
  const WrittenCollection written = WriteCollection(import, scratch.path());
  EXPECT_THAT(written.sets, ElementsAre("static"));
  EXPECT_EQ(written.incomplete.size(), 16u);
}

std::string Model(const std::string& pose, const std::string& geometry,
                  const std::string& rest = "<static>1</static>") {
  return "<model name='m'>" + rest + "<pose frame=''>" + pose +
         "</pose><link name='link'><collision name='c'><geometry>" + geometry +
         "</geometry></collision><visual><geometry>" + geometry +
         "</geometry></visual></link></model>\n";
}

std::string Sdf(const std::string& models) {
  return "<sdf version='1.6'>\n<world name='default'>\n" + models + "</world>\n</sdf>";
}

const std::string kCylinder = "<cylinder><radius>0.075</radius><length>1</length></cylinder>";
const std::string kBox = "<box><size>0.2 4 1</size></box>";

TEST(WorldFile, CylindersAndBoxesAreRead) {
  const World world = ParseWorld(
      Sdf(Model("0 0 0 0 0 0", "<plane><normal>0 0 1</normal></plane>") +
          Model("-1.5 2.25 0 0 -0 0", kCylinder) + Model("1 2 0.5 0 0 0.5", kBox) +
          Model("0 0 0 0 0 0", kBox, "<static>1</static><plugin name='p' filename='p.so'/>")),
      "x.world");
  ASSERT_EQ(world.circles.size(), 1u);
  EXPECT_EQ(world.circles[0], (Circle{{-1.5, 2.25}, 0.075}));
  ASSERT_EQ(world.boxes.size(), 1u);
  EXPECT_EQ(world.boxes[0], (Box{{{1.0, 2.0}, 0.5}, {0.1, 2.0}}));
  EXPECT_EQ(world.num_moving_models, 1);
  EXPECT_FALSE(world.has_damaged_end);
}

TEST(WorldFile, PosesOfModelLinkAndCollisionAddUp) {
  const std::string model =
      "<model><static>true</static><pose>1 0 0 0 0 1.5707963267948966</pose><link><pose>2 0 0 0 0 "
      "0.25</pose><collision><geometry>" +
      kBox + "</geometry></collision></link></model>";
  const World world = ParseWorld(Sdf(model), "x.world");
  ASSERT_EQ(world.boxes.size(), 1u);
  EXPECT_NEAR(world.boxes[0].X_WB.p.x, 1.0, 1e-12);
  EXPECT_NEAR(world.boxes[0].X_WB.p.y, 2.0, 1e-12);
  EXPECT_NEAR(world.boxes[0].X_WB.yaw, 1.5707963267948966 + 0.25, 1e-12);
}

TEST(WorldFile, DamagedEndsAreMendedAndNoOthers) {
  const std::string whole = Sdf(Model("1 2 0 0 0 0", kCylinder));
  for (const std::string& damaged : {whole.substr(0, whole.size() - 1), whole + "\"",
                                     whole.substr(0, whole.size() - 1) + "\n"}) {
    const World world = ParseWorld(damaged, "x.world");
    EXPECT_TRUE(world.has_damaged_end);
    EXPECT_EQ(world.circles.size(), 1u);
  }
  EXPECT_FALSE(ParseWorld(whole + "\r\n", "x.world").has_damaged_end);
  // Cut anywhere before that, or in the middle of the file.
  for (std::size_t size = 0; size + 1 < whole.size(); ++size) {
    EXPECT_THAT(ErrorOf([&] { ParseWorld(whole.substr(0, size), "x.world"); }),
                HasSubstr("x.world"))
        << "cut to " << size << " bytes";
  }
}

TEST(WorldFile, WhatACourseCannotHoldIsRefusedWithFileLineAndReason) {
  const auto refusal = [](const std::string& models) {
    return ErrorOf([&] { ParseWorld(Sdf(models), "x.world"); });
  };
  EXPECT_THAT(refusal(Model("0 0 0 0 0 0", "<sphere><radius>1</radius></sphere>")),
              AllOf(HasSubstr("x.world:3"), HasSubstr("<sphere>")));
  EXPECT_THAT(refusal(Model("0 0 0 0.5 0 0", kCylinder)), HasSubstr("tilted"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0", kCylinder)), HasSubstr("<pose> does not hold 6 numbers"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 x", kCylinder)),
              HasSubstr("<pose> does not hold 6 numbers"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 0", "<cylinder><radius>-1</radius></cylinder>")),
              HasSubstr("radius"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 0", "<cylinder/>")), HasSubstr("has no <radius>"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 0", kBox, "")), HasSubstr("neither static"));
  EXPECT_THAT(ErrorOf([] { ParseWorld("<html></html>", "x.world"); }), HasSubstr("no <sdf>"));
}

/// The bytes of a .npy file, version 1 or 2.
std::string Npy(int version, const std::string& header, const std::vector<std::int64_t>& values) {
  std::string bytes = "\x93NUMPY";
  bytes += static_cast<char>(version);
  bytes += '\0';
  for (int i = 0; i < (version == 1 ? 2 : 4); ++i) {
    bytes += static_cast<char>(header.size() >> (8 * i) & 0xff);
  }
  bytes += header;
  for (const std::int64_t value : values) {
    for (int i = 0; i < 8; ++i) {
      bytes += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xff);
    }
  }
  return bytes;
}

constexpr char kRowOrder[] = "{'descr': '<i8', 'fortran_order': False, 'shape': (3, 2), }  \n";
constexpr char kColumnOrder[] = "{'descr': '<i8', 'fortran_order': True, 'shape': (3, 2), }  \n";

TEST(NpyFile, BothOrdersAndVersionsAreRead) {
  for (const int version : {1, 2}) {
    const IntegerTable rows =
        ParseNpy(Npy(version, kRowOrder, {1, -2, 3, 4, 5, 1L << 40}), "x.npy");
    EXPECT_EQ(rows.num_rows, 3u);
    EXPECT_EQ(rows.num_cols, 2u);
    EXPECT_THAT(rows.values, ElementsAre(1, -2, 3, 4, 5, 1L << 40));
    const IntegerTable columns =
        ParseNpy(Npy(version, kColumnOrder, {1, 3, 5, -2, 4, 1L << 40}), "x.npy");
    EXPECT_EQ(columns.values, rows.values);
  }
}

TEST(NpyFile, AnythingElseIsRefused) {
  const std::string whole = Npy(1, kRowOrder, {1, 2, 3, 4, 5, 6});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THAT(ErrorOf([&] { ParseNpy(whole.substr(0, size), "x.npy"); }), HasSubstr("x.npy"))
        << size;
  }
  const auto refusal = [](const std::string& header) {
    return ErrorOf([&] { ParseNpy(Npy(1, header, {1, 2, 3, 4, 5, 6}), "x.npy"); });
  };
  EXPECT_THAT(refusal("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }"),
              HasSubstr("'<i8'"));
  EXPECT_THAT(refusal("{'descr': '<i8', 'fortran_order': False, 'shape': (6,), }"),
              HasSubstr("shape"));
  EXPECT_THAT(refusal("{'descr': '<i8', 'fortran_order': False, 'shape': (3, 3), }"),
              HasSubstr("48 bytes"));
  EXPECT_THAT(refusal("{'descr': '<i8', 'shape': (3, 2), }"), HasSubstr("fortran_order"));
  EXPECT_THAT(ErrorOf([&] {
                ParseNpy(Npy(3, kRowOrder, {1, 2, 3, 4, 5, 6}), "x.npy");
              }),
              HasSubstr("version is 3"));
}

TEST(BarnImporter, WorldsOfOnesOwnNeedNotLieOnTheLattice) {
  const World world =
      ParseWorld(Sdf(Model("-1.03 6.2 0 0 0 0", kCylinder) + Model("0.5 8 0 0 0 0", kBox)), "x");
  const Course course = MakeImportedCourse("mine", world, nullptr, "x");
  EXPECT_EQ(course.circles.size(), 1u);
  EXPECT_EQ(course.boxes.size(), 1u);
  EXPECT_FALSE(course.difficulty.has_value());
  EXPECT_GT(course.bounds.max_W.x, 0.59);
}

TEST(BarnImporter, BadDirectoriesPathsAndWorldsAreNamed) {
  const test::ScratchDirectory scratch;
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), std::nullopt); }),
              HasSubstr("holds no world_N.world"));
  EXPECT_THAT(ErrorOf([] { ImportBarn("/no/such/place", std::nullopt); }),
              HasSubstr("/no/such/place"));
  const std::filesystem::path world = scratch.path() / "world_7.world";
  base::WriteFileAtomically(world, Sdf(Model("-2 13 0 0 0 0", kCylinder)));
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), std::nullopt); }),
              AllOf(HasSubstr("world_7.world"), HasSubstr("at the goal")));
  base::WriteFileAtomically(world, Sdf(Model("-1 7 0 0 0 0", kCylinder)));
  EXPECT_THAT(ImportBarn(scratch.path(), std::nullopt).warnings,
              ElementsAre(HasSubstr("path_N.npy")));
  base::MakeDirectories(scratch.path() / "path_files");
  const std::filesystem::path path = scratch.path() / "path_files" / "path_7.npy";
  base::WriteFileAtomically(path, Npy(1, kRowOrder, {3, 0, 3, 1, 99, 2}));
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), std::nullopt); }),
              HasSubstr("leaves the field at cell 2 (99, 2)"));
  base::WriteFileAtomically(path, "nothing");
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), std::nullopt); }), HasSubstr("path_7.npy"));
}

TEST(BarnImporter, WorldsMayLieInWorldFilesBesidePathFiles) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path worlds = scratch.path() / "world_files";
  base::MakeDirectories(worlds);
  base::MakeDirectories(scratch.path() / "path_files");
  base::WriteFileAtomically(worlds / "world_7.world", Sdf(Model("-1 7 0 0 0 0", kCylinder)));
  base::WriteFileAtomically(scratch.path() / "path_files" / "path_7.npy",
                            Npy(1, kRowOrder, {3, 0, 3, 1, 3, 2}));
  for (const std::filesystem::path& given : {scratch.path(), worlds}) {
    const BarnImport import = ImportBarn(given, std::nullopt);
    ASSERT_EQ(import.courses.size(), 1u) << given;
    EXPECT_EQ(import.courses.at(7)->reference_path_W.size(), 3u) << given;
    EXPECT_TRUE(import.warnings.empty());
  }
}

TEST(BarnImporter, WhereTheDataAreIsSaid) {
  const test::ScratchDirectory scratch;
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), std::nullopt); }),
              AllOf(HasSubstr("https://www.cs.utexas.edu/~xiao/BARN/BARN.html"),
                    HasSubstr("https://github.com/Daffan/ros_jackal")));
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), scratch.path()); }),
              HasSubstr("docs/courses.md"));
}

}  // namespace
}  // namespace slalom::sim
