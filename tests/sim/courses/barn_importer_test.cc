#include "sim/courses/barn_importer.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/file.h"
#include "sim/courses/barn_field.h"
#include "sim/courses/course_sets.h"
#include "tests/sim/courses/barn_data.h"
#include "tests/support/error_of.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using test::ErrorOf;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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
  const WrittenCollection written =
      WriteCollection(import, scratch.path(), IncompleteKinds::kWrite);
  EXPECT_THAT(written.sets, ElementsAre("static-2-of-300"));
  EXPECT_EQ(written.incomplete.size(), 17u);
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
  EXPECT_THAT(world.moving_model_lines, ElementsAre(6));
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
  EXPECT_THAT(refusal(Model("0 0 0 0 0", kCylinder)), HasSubstr("expected 6 numbers"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 x", kCylinder)), HasSubstr("expected 6 numbers"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 0", "<cylinder><radius>-1</radius></cylinder>")),
              HasSubstr("radius"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 0", "<cylinder/>")), HasSubstr("has no <radius>"));
  EXPECT_THAT(refusal(Model("0 0 0 0 0 0", kBox, "")), HasSubstr("neither static"));
  EXPECT_THAT(ErrorOf([] { ParseWorld("<html></html>", "x.world"); }), HasSubstr("no <sdf>"));
}

/// The obstacles of a world, as one string.
std::string Obstacles(const World& world) {
  std::string text;
  for (const Circle& c : world.circles) {
    text += fmt::format("circle {:.9f} {:.9f} {};", c.p_W.x, c.p_W.y, c.radius);
  }
  for (const Box& b : world.boxes) {
    text += fmt::format("box {:.9f} {:.9f} {:.9f};", b.X_WB.p.x, b.X_WB.p.y, b.X_WB.yaw);
  }
  return text;
}

TEST(WorldFile, WhatHasNoEffectOnObstaclesIsPassedOver) {
  const std::string plain =
      "<model name='m'><static>true</static><pose>1 2 0 0 0 0</pose><link name='l'>"
      "<collision name='c'><geometry>" +
      kBox + "</geometry></collision></link></model>";
  const std::string rich =
      "<include><uri>model://sun</uri></include>"
      "<include><uri>model://ground_plane</uri><name>ground</name><pose>0 0 0 0 0 0</pose>"
      "</include><light name='x'><pose>0 0 10 1 2 3</pose></light><gravity>0 0 -9.8</gravity>"
      "<atmosphere type='adiabatic'/><gui><plugin filename='x'/></gui><physics type='ode'/>"
      "<scene/><wind/><magnetic_field/><spherical_coordinates/><road name='r'/>"
      "<frame name='f'/><audio/><joint name='j'/><plugin filename='libgazebo_ros_state.so'/>"
      "<plugin filename='gz-sim-physics-system' name='p'/>"
      "<model name='sign'><pose>9 9 0 1 0 0</pose><link name='l'><visual name='v'/></link></model>"
      "<model name='m' canonical_link='l'><static>1</static><static>true</static>"
      "<pose relative_to='world' degrees='false' rotation_format='euler_rpy'>1 2 0 0 -0 0</pose>"
      "<self_collide>0</self_collide><allow_auto_disable>1</allow_auto_disable><joint name='j'/>"
      "<frame name='f'><pose>5 5 5 5 5 5</pose></frame><link name='l'>"
      "<pose relative_to='__model__'>0 0 0 0 0 0</pose><inertial><pose>3 3 3 3 3 3</pose>"
      "</inertial><sensor/><gravity>1</gravity><kinematic>0</kinematic><collision name='none'>"
      "<geometry><empty/></geometry></collision><collision name='c'>"
      "<max_contacts>10</max_contacts><laser_retro>0</laser_retro><surface><friction/><bounce/>"
      "<contact><collide_bitmask>0x01</collide_bitmask><collide_without_contact>0"
      "</collide_without_contact><ode/></contact></surface><geometry>" +
      kBox + "</geometry></collision></link></model>";
  EXPECT_EQ(Obstacles(ParseWorld(Sdf(rich), "x")), Obstacles(ParseWorld(Sdf(plain), "x")));
  EXPECT_EQ(ParseWorld(Sdf(plain), "x").boxes.size(), 1u);
}

/// A world whose third line begins a model, with `what` at one place of it.
std::string WorldWith(std::string_view place, const std::string& what) {
  const auto at = [&](std::string_view name) { return place == name ? what : std::string(); };
  return "<sdf version='1.6'>" + at("sdf") + "<world name='w'>\n" + at("world") +
         "\n<model name='m'" + at("model attribute") + "><static>1</static>" + at("model") +
         "<link name='l'>" + at("link") + "<collision name='c'>" + at("collision") + "<geometry>" +
         (place == "geometry" ? what : kBox) +
         "</geometry></collision></link></model></world></sdf>";
}

TEST(WorldFile, WhatIsNeitherUnderstoodNorPassedOverIsRefusedByNameAndLine) {
  struct Case {
    const char* place;
    std::string what;
    const char* expected;
  };
  const std::string state = "<state world_name='w'>";
  const Case cases[] = {
      {"sdf", "<model name='x'/>", "x.world:1: <sdf> holds <model>"},
      {"world", "<actor name='a'/>", "x.world:2: <world> holds <actor>"},
      {"world", "<population name='p'/>", "x.world:2: <world> holds <population>"},
      {"world", "<gz:thing/>", "x.world:2: <world> holds <gz:thing>"},
      {"world", "<include><uri>model://wall</uri></include>",
       "x.world:2: the model \"model://wall\""},
      {"world", "<include><uri>model://sun</uri><plugin/></include>", "holds <plugin>"},
      {"world", "<include><uri>model://ground_plane</uri><pose>0 0 -1 0 0 0</pose></include>",
       "the ground is at height -1"},
      {"world", "<plugin name='p' filename='libcrowd.so'/>", "\"libcrowd.so\""},
      {"world", state + "</state>" + state + "</state>", "a second <state>"},
      {"world", state + "<deletions><name>m</name></deletions></state>", "<deletions>"},
      {"world", state + "<insertions/></state>", "<insertions>"},
      {"world", state + "<model name='n'/></state>", "a model that the world lacks"},
      {"world", state + "<model name='m'><scale>1 2 1</scale></model></state>", "scales a model"},
      {"world", state + "<model name='m'><model name='n'/></model></state>", "holds <model>"},
      {"world", state + "<model name='m'><link name='k'/></model></state>",
       "a link that the model"},
      {"model attribute", " placement_frame='l'", "placement_frame=\"l\""},
      {"model attribute", " scale='2'", "scale=\"2\""},
      {"model", "<model name='n'/>", "x.world:3: <model> holds <model>"},
      {"model", "<include><uri>model://sun</uri></include>", "<model> holds <include>"},
      {"model", "<origin pose='1 2 0 0 0 0'/>", "<model> holds <origin>"},
      {"model", "<pose frame='map'>1 2 0 0 0 0</pose>", "frame=\"map\""},
      {"model", "<pose relative_to='other'>1 2 0 0 0 0</pose>", "relative_to=\"other\""},
      {"model", "<pose degrees='often'>1 2 0 0 0 0</pose>", "\"often\""},
      {"model", "<pose rotation_format='quat_xyzw'>1 2 0 0 0 0 1</pose>", "quat_xyzw"},
      {"model", "<pose unit='cm'>1 2 0 0 0 0</pose>", "unit=\"cm\""},
      {"model", "<pose>0 0 0 0 0 0</pose><pose>1 0 0 0 0 0</pose>", "a second <pose>"},
      {"model", "<static>0</static>", "neither static"},
      {"link", "<pose relative_to='world'>1 2 0 0 0 0</pose>", "relative_to=\"world\""},
      {"link", "<pose>0 0 0 0 0.3 0</pose>", "tilted"},
      {"link", "<collisions/>", "<link> holds <collisions>"},
      {"collision", "<pose relative_to='l'>0 0 0 0 0 0</pose>", "relative_to=\"l\""},
      {"collision", "<scale>2</scale>", "<collision> holds <scale>"},
      {"collision", "<geometry/>", "a second <geometry>"},
      {"collision",
       "<surface><contact><collide_without_contact>1</collide_without_contact></contact></surface>",
       "without contact"},
      {"collision", "<surface><contact><collide_bitmask>0x00</collide_bitmask></contact></surface>",
       "with nothing"},
      {"geometry", kBox + kCylinder, "a second shape"},
      {"geometry", "<box><size>1 1 1</size><scale>2 2 2</scale></box>", "<box> holds <scale>"},
      {"geometry", "<plane><normal>1 0 0</normal></plane>", "not level"},
      {"geometry", "<sphere/>", "<geometry> holds <sphere>"},
      {"geometry", "<capsule/>", "<geometry> holds <capsule>"},
      {"geometry", "<ellipsoid/>", "<geometry> holds <ellipsoid>"},
      {"geometry", "<cone/>", "<geometry> holds <cone>"},
      {"geometry", "<polyline/>", "<geometry> holds <polyline>"},
      {"geometry", "<heightmap/>", "<geometry> holds <heightmap>"},
      {"geometry", "<image/>", "<geometry> holds <image>"},
      {"geometry", "<mesh/>", "x.world:3: <geometry> holds <mesh>"}};
  EXPECT_EQ(ParseWorld(WorldWith("", ""), "x.world").boxes.size(), 1u);
  for (const Case& c : cases) {
    EXPECT_THAT(ErrorOf([&] { ParseWorld(WorldWith(c.place, c.what), "x.world"); }),
                AllOf(HasSubstr("x.world:"), HasSubstr(c.expected)))
        << c.place << ": " << c.what;
  }
  EXPECT_THAT(ErrorOf([] { ParseWorld("<sdf version='2.0'><world/></sdf>", "x.world"); }),
              HasSubstr("\"2.0\", expected 1.x"));
}

TEST(WorldFile, PosesOfASavedStateTakeThePlaceOfTheModelsOwn) {
  const auto model = [](const std::string& name) {
    return "<model name='" + name + "'><static>1</static><pose>1 2 0 0 0 0</pose><link name='l'>" +
           "<pose>0.5 0 0 0 0 0</pose><collision name='c'><geometry>" + kCylinder +
           "</geometry></collision></link></model>";
  };
  const std::string saved =
      "<include><uri>model://ground_plane</uri></include>" + model("moved") + model("link_moved") +
      model("same") +
      "<state world_name='w'><sim_time>1 0</sim_time><light name='sun'/>"
      "<model name='ground_plane'><pose>0 0 0 0 0 0</pose></model>"
      "<model name='moved'><pose>3 4 0 0 -0 0</pose><scale>1 1 1</scale></model>"
      "<model name='link_moved'><pose>3 4 0 0 0 0</pose><link name='l'><pose>7 8 0 0 0 0</pose>"
      "<velocity>0 0 0 0 0 0</velocity></link></model></state>";
  EXPECT_EQ(Obstacles(ParseWorld(Sdf(saved), "x.world")),
            "circle 3.500000000 4.000000000 0.075;circle 7.000000000 8.000000000 0.075;"
            "circle 1.500000000 2.000000000 0.075;");
}

TEST(WorldFile, DegreesAreUnderstood) {
  const std::string model =
      "<model name='m'><static>1</static><pose degrees='true'>1 2 0 0 0 90</pose><link name='l'>"
      "<pose>1 0 0 0 0 0</pose><collision name='c'><geometry>" +
      kBox + "</geometry></collision></link></model>";
  EXPECT_EQ(Obstacles(ParseWorld(Sdf(model), "x.world")),
            "box 1.000000000 3.000000000 1.570796327;");
}

TEST(WorldFile, ShapesCountIfTheyAreAtTheHeightOfTheLidar) {
  const auto world = [](double z, double height) {
    return ParseWorld(Sdf(Model(fmt::format("0 0 {} 0 0 0", z),
                                fmt::format("<box><size>1 1 {}</size></box>", height))),
                      "x.world");
  };
  EXPECT_EQ(world(0.5, 1.0).boxes.size(), 1u);
  EXPECT_EQ(world(0.2, 0.01).boxes.size(), 1u);
  for (const auto& [z, height] : {std::pair{-0.05, 0.1}, {0.005, 0.03}, {2.0, 0.2}, {0.6, 0.2}}) {
    EXPECT_EQ(world(z, height).boxes.size(), 0u) << z;
    EXPECT_EQ(world(z, height).num_out_of_reach, 1) << z;
  }
  for (const auto& [z, height] : {std::pair{0.05, 0.1}, {0.4, 0.2}}) {
    // clang before 16 does not capture structured bindings by reference.
    EXPECT_THAT(ErrorOf([&, z = z, height = height] { world(z, height); }),
                AllOf(HasSubstr("x.world:3"), HasSubstr("LiDAR")))
        << z;
  }
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

TEST(BarnImporter, IncompleteKindsAreRefusedUnlessAskedFor) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path output = scratch.path() / "out";
  const std::string world = Sdf(Model("-1 7 0 0 0 0", kCylinder));
  for (const int number : {3, 4, 9}) {
    base::WriteFileAtomically(scratch.path() / fmt::format("world_{}.world", number), world);
  }
  const BarnImport import = ImportBarn(scratch.path(), std::nullopt);
  EXPECT_THAT(ErrorOf([&] { WriteCollection(import, output); }),
              AllOf(HasSubstr(scratch.path().string() + ": 297 of the 300 worlds of static"),
                    HasSubstr("0 to 2, 5 to 8, 10 to 299"), HasSubstr("--incomplete")));
  EXPECT_FALSE(std::filesystem::exists(output));
  const WrittenCollection written = WriteCollection(import, output, IncompleteKinds::kWrite);
  EXPECT_THAT(written.sets, ElementsAre("static-3-of-300"));
  EXPECT_THAT(base::ReadFile(output / "static-3-of-300.courses"),
              HasSubstr("\n# 297 of the 300 worlds of static are missing: 0 to 2, 5 to 8"));
  EXPECT_EQ(ResolveCourses("static-3-of-300", output, 1).courses.size(), 3u);
  EXPECT_THAT(ErrorOf([&] { ResolveCourses("static", output, 1); }), HasSubstr("static-3-of-300"));

  base::WriteFileAtomically(scratch.path() / "hall.world", world);
  EXPECT_THAT(ImportBarn(scratch.path(), std::nullopt).skipped,
              ElementsAre(HasSubstr("hall.world")));
  base::WriteFileAtomically(scratch.path() / "world_03.world", world);
  EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), std::nullopt); }),
              HasSubstr("world 3 a second time"));
  std::filesystem::remove(scratch.path() / "world_03.world");

  for (const auto& [number, expected] :
       {std::pair{777, "the data set has worlds 0 to 499"}, {350, "dynamic-box"}}) {
    const auto path = scratch.path() / fmt::format("world_{}.world", number);
    base::WriteFileAtomically(path, world);
    EXPECT_THAT(ErrorOf([&] { ImportBarn(scratch.path(), std::nullopt); }),
                AllOf(HasSubstr(path.string()), HasSubstr(expected)));
    std::filesystem::remove(path);
  }
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
