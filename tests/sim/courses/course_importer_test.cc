#include "sim/courses/course_importer.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "base/random.h"
#include "tests/support/error_of.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using test::ErrorOf;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kDescription[] =
    "image: map.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
    "free_thresh: 0.196\n";

/// A P5 image: '#' occupied, '.' free, '?' unknown, line by line from the top.
std::string Pgm(const std::vector<std::string>& lines) {
  std::string bytes =
      fmt::format("P5\n# made for a test\n{} {}\n255\n", lines.front().size(), lines.size());
  for (const std::string& line : lines) {
    for (const char c : line) bytes += c == '#' ? '\0' : c == '.' ? '\xfe' : '\xcd';
  }
  return bytes;
}

/// The map as text, in the letters of `Pgm`.
std::vector<std::string> Draw(const OccupancyMap& map) {
  std::vector<std::string> lines;
  for (int y = map.num_y; y-- > 0;) {
    lines.emplace_back();
    for (int x = 0; x < map.num_x; ++x) {
      lines.back() += "._#?"[map.at(x, y) == Occupancy::kFree       ? 0
                             : map.at(x, y) == Occupancy::kOccupied ? 2
                                                                    : 3];
    }
  }
  return lines;
}

std::string Changed(std::string_view from, std::string_view to) {
  std::string text = kDescription;
  return text.replace(text.find(from), from.size(), to);
}

class MapImport : public ::testing::Test {
 protected:
  MapImport() : path_(scratch_.path() / "map.yaml") {}

  void Write(std::string_view description, std::string_view image) {
    base::WriteFileAtomically(path_, description);
    base::WriteFileAtomically(scratch_.path() / "map.pgm", image);
  }

  Course Import(const base::Pose2& start, base::Vec2 goal_W,
                UnknownCells unknown = UnknownCells::kOccupied) {
    return ImportMap("mine", path_, start, goal_W, unknown).course;
  }

  const test::ScratchDirectory scratch_;
  const std::filesystem::path path_;
};

TEST_F(MapImport, CellsBecomeFewBoxesWhereTheyAre) {
  Write(Changed("[0, 0, 0]", "[10, -2, 0]"),
        Pgm({"........", "..####..", "..#.....", "..#.....", "........"}));
  const Course course = Import({{10.5, -0.5}, 0.5}, {13.25, -1.25}, UnknownCells::kFree);
  EXPECT_EQ(course.start, (base::Pose2{{10.5, -0.5}, 0.5}));
  EXPECT_EQ(course.goal_W, (base::Vec2{13.25, -1.25}));
  EXPECT_EQ(course.bounds, (Bounds{{10.0, -2.0}, {14.0, 0.5}}));
  // The column of three from below, then what is left of the row.
  EXPECT_THAT(course.boxes, ElementsAre(Box{{{11.25, -0.75}, 0.0}, {0.25, 0.75}},
                                        Box{{{12.25, -0.25}, 0.0}, {0.75, 0.25}}));
}

// The oracle is each cell by itself.
TEST_F(MapImport, BoxesCoverTheOccupiedCellsOfATurnedMapAndNoOthers) {
  base::Random random(5);
  std::vector<std::string> lines(20, std::string(30, '.'));
  for (auto& line : lines) {
    for (char& c : line) c = random.Uniform() < 0.3 ? '#' : '.';
  }
  for (int y = 14; y < 20; ++y) lines[static_cast<std::size_t>(y)].replace(0, 12, 12, '.');
  Write(Changed("[0, 0, 0]", "[1, 2, 0.7]"), Pgm(lines));
  const base::Pose2 X_WM{{1.0, 2.0}, 0.7};
  const auto in_map = [&](double x, double y) { return base::Transform(X_WM, {x, y}); };
  const Course course = Import({in_map(1.0, 1.0), 0.7}, in_map(5.0, 1.0), UnknownCells::kFree);
  std::size_t num_occupied = 0;
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) {
      const bool is_occupied =
          lines[static_cast<std::size_t>(19 - y)][static_cast<std::size_t>(x)] == '#';
      num_occupied += is_occupied ? 1 : 0;
      int num_covering = 0;
      for (const Box& box : course.boxes) {
        num_covering += DistanceTo(box, in_map(0.5 * x + 0.25, 0.5 * y + 0.25)) <= 0.0 ? 1 : 0;
      }
      EXPECT_EQ(num_covering, is_occupied ? 1 : 0) << x << ", " << y;
    }
  }
  EXPECT_LT(course.boxes.size(), num_occupied * 3 / 4);
}

TEST_F(MapImport, UnknownCellsAndAllBeyondTheEdgeCountAsAskedFor) {
  Write(kDescription, Pgm({"?????????", "?????????", "??.....??", "??.....??", "???....??"}));
  const base::Pose2 start{{1.75, 0.75}, 0.0};
  const Course occupied = Import(start, {3.0, 0.75});
  // The known cells and one around them, also below the map.
  EXPECT_EQ(occupied.bounds, (Bounds{{0.5, -0.5}, {4.0, 2.0}}));
  double area = 0.0;
  for (const Box& box : occupied.boxes) area += 4.0 * box.half_size.x * box.half_size.y;
  EXPECT_NEAR(area, 0.25 * (7 * 5 - 14), 1e-12);
  EXPECT_EQ(Import(start, {3.0, 0.75}, UnknownCells::kFree).boxes.size(), 0u);
  EXPECT_THAT(ImportMap("mine", path_, start, {3.0, 0.75}, UnknownCells::kOccupied).remarks,
              ElementsAre(AllOf(HasSubstr("31 of 45"), HasSubstr("count as occupied"))));
  EXPECT_THAT(ErrorOf([&] {
                Import({{0.25, 2.25}, 0.0}, {3.0, 0.75});
              }),
              HasSubstr("unknown cell, which counts as occupied"));
}

TEST_F(MapImport, AStartOrGoalThatIsOccupiedOrOutsideIsRefused) {
  Write(kDescription, Pgm({"....#.....", "....#.....", "....#.....", "....#....."}));
  const base::Pose2 start{{1.0, 1.0}, 0.0};
  EXPECT_THAT(ErrorOf([&] {
                Import(start, {2.25, 1.25}, UnknownCells::kFree);
              }),
              AllOf(HasSubstr("map.yaml: the goal (2.25, 1.25) is in an occupied cell"),
                    HasSubstr("column 5 and line 2")));
  EXPECT_THAT(
      ErrorOf([&] {
        Import({{-0.1, 1.0}, 0.0}, {1.0, 1.0});
      }),
      AllOf(HasSubstr("the start (-0.1, 1) is outside the map"), HasSubstr("x from 0 to 5")));
  EXPECT_THAT(ErrorOf([&] { Import(start, {1.0, 2.0}); }), HasSubstr("the goal (1, 2) is outside"));
  EXPECT_THAT(ErrorOf([&] {
                Import({{1.9, 1.0}, 0.0}, {1.0, 1.0});
              }),
              HasSubstr("at the start (1.9, 1) the robot stands in an obstacle"));
  EXPECT_THAT(ErrorOf([&] { Import(start, {4.0, 1.0}); }), HasSubstr("no corridor"));
}

TEST(MapFile, ThresholdsNegateAndModesAreThoseOfMapServer) {
  // 89 is the darkest that is not above 0.65, 205 the brightest that is not below 0.196.
  const std::string image = "P2\n7 1 # size\n255\n0 88 90 205 206 254 255\n";
  const auto drawn = [&](const std::string& description, const std::string& pgm) {
    return Draw(ParseMapImage(ParseMapDescription(description, "m"), pgm, "i")).front();
  };
  EXPECT_EQ(drawn(kDescription, image), "##??...");
  EXPECT_EQ(drawn(std::string(kDescription) + "mode: scale\n", image), "##??...");
  EXPECT_EQ(drawn(Changed("negate: 0", "negate: 1"), image), ".??####");
  EXPECT_EQ(drawn(std::string(kDescription) + "mode: raw\n", "P2 6 1 255 0 19 20 66 100 101"),
            "..?##?");
  // 16 bits, the high byte first; 1000 of 4000 is bright, 3999 is not dark.
  EXPECT_EQ(drawn(kDescription, std::string("P5 2 1 4000\n\x03\xe8\x0f\x9f", 16)), "#.");
}

TEST(MapFile, DescriptionsAreReadAsTheyAreWritten) {
  const MapDescription description = ParseMapDescription(
      "# a map\r\n---\r\nimage: \"maps/a #1.pgm\"  # quoted\r\nmode: trinary\r\n"
      "resolution: 5e-2\r\norigin:\r\n- -10.5\r\n- 3\r\n- 0.25\r\nnegate: false\r\n"
      "occupied_thresh: 0.65\r\nfree_thresh: 0.25\r\n",
      "m");
  EXPECT_EQ(description.image, "maps/a #1.pgm");
  EXPECT_EQ(description.resolution, 0.05);
  EXPECT_EQ(description.X_WM, (base::Pose2{{-10.5, 3.0}, 0.25}));
  EXPECT_FALSE(description.negate);
  EXPECT_EQ(description.free_threshold, 0.25);
}

TEST(MapFile, BadDescriptionsAreRefusedWithKeyAndLine) {
  const auto refusal = [](std::string_view from, std::string_view to) {
    return ErrorOf([&] { ParseMapDescription(Changed(from, to), "m.yaml"); });
  };
  EXPECT_EQ(refusal("0.5", "0.5"), "");
  EXPECT_THAT(refusal("resolution: 0.5\n", ""), HasSubstr("m.yaml: the key resolution is missing"));
  EXPECT_THAT(refusal("resolution: 0.5", "resolution: 0,05"),
              HasSubstr("m.yaml:2: resolution is \"0,05\", expected a number"));
  EXPECT_THAT(refusal("resolution: 0.5", "resolution: -1"), HasSubstr("m.yaml:2: resolution"));
  EXPECT_THAT(refusal("resolution: 0.5", "resolution:0.5"), HasSubstr("m.yaml:2: found"));
  EXPECT_THAT(refusal("resolution: 0.5", "image: b.pgm"), HasSubstr("m.yaml:2: the key image"));
  EXPECT_THAT(refusal("resolution: 0.5", "scale: 0.5"),
              HasSubstr("m.yaml:2: found the key \"scale\""));
  EXPECT_THAT(refusal("map.pgm", ""), HasSubstr("m.yaml:1: image is \"\""));
  EXPECT_THAT(refusal("[0, 0, 0]", "[0, 0]"), HasSubstr("m.yaml:3: origin is \"[0, 0]\""));
  EXPECT_THAT(refusal("[0, 0, 0]", "[0, 0, nan]"), HasSubstr("m.yaml:3: origin"));
  EXPECT_THAT(refusal("negate: 0", "negate: 2"), HasSubstr("m.yaml:4: negate is \"2\""));
  EXPECT_THAT(refusal("0.65", "65"), HasSubstr("m.yaml:5: occupied_thresh is \"65\""));
  EXPECT_THAT(refusal("0.196", "0.7"), HasSubstr("m.yaml:6: free_thresh is \"0.7\""));
  EXPECT_THAT(refusal("negate: 0", "negate: 0\nmode: rgb"), HasSubstr("m.yaml:5: mode is \"rgb\""));
  EXPECT_THAT(refusal("negate: 0", "negate: 1\nmode: raw"), HasSubstr("m.yaml:4: negate is \"1\""));
}

TEST(MapFile, BadImagesAreRefused) {
  const MapDescription description = ParseMapDescription(kDescription, "m.yaml");
  const auto refusal = [&](const std::string& bytes) {
    return ErrorOf([&] { ParseMapImage(description, bytes, "m.pgm"); });
  };
  const std::string whole = Pgm({"..#", "#.."});
  EXPECT_EQ(refusal(whole), "");
  EXPECT_EQ(refusal(whole + "\n"), "");
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THAT(refusal(whole.substr(0, size)), HasSubstr("m.pgm")) << size;
  }
  EXPECT_THAT(refusal(whole + "x"), HasSubstr("1 bytes after its 3 x 2 pixels"));
  EXPECT_THAT(refusal("\x89PNG"), HasSubstr("no PGM image (P2 or P5)"));
  EXPECT_THAT(refusal("P2\n3 2\n255\n0 0 0\n0 0 300\n"), HasSubstr("m.pgm:5: the pixel"));
  EXPECT_THAT(refusal("P2\n3 2\n255\n0 0 0\n0 0\n"), HasSubstr("m.pgm"));
  EXPECT_THAT(refusal("P2\n3 0\n255\n"), HasSubstr("m.pgm:2: the height"));
  EXPECT_THAT(refusal("P5\n3 2\n70000\n"), HasSubstr("m.pgm:3: the largest value"));
  EXPECT_THAT(refusal("P5\n999999 999999\n255\n"), HasSubstr("expected at most 50000000"));
  EXPECT_THAT(refusal("P5 1 1 100\nz"), HasSubstr("a pixel is 122, expected at most 100"));
}

TEST(WorldImport, AWorldOfOnesOwnBecomesACourse) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path path = scratch.path() / "hall.world";
  const auto write = [&](const std::string& rest) {
    base::WriteFileAtomically(
        path,
        "<sdf version='1.6'><world name='w'>\n<model name='m'><static>1</static><pose>3 1 0 0 0 "
        "0</pose><link name='l'><collision name='c'><geometry><cylinder><radius>0.5</radius>"
        "<length>2</length></cylinder></geometry></collision></link></model>\n" +
            rest + "</world></sdf>");
  };
  write("");
  const auto import = [&](const base::Pose2& start) {
    return ImportWorld("hall", path, start, {6.0, 0.0});
  };
  const Course course = import({{0.0, 0.5}, 0.1}).course;
  EXPECT_EQ(course.name, "hall");
  EXPECT_THAT(course.circles, ElementsAre(Circle{{3.0, 1.0}, 0.5}));
  EXPECT_EQ(course.bounds, (Bounds{{-1.0, -1.0}, {7.0, 2.5}}));
  EXPECT_EQ(course.start, (base::Pose2{{0.0, 0.5}, 0.1}));
  EXPECT_THAT(ErrorOf([&] {
                import({{3.0, 1.2}, 0.0});
              }),
              AllOf(HasSubstr("hall.world"), HasSubstr("at the start")));
  EXPECT_THAT(ErrorOf([&] { import({{1e5, 0.0}, 0.0}); }), HasSubstr("hall.world"));
  write("<model name='n'><plugin name='p' filename='p.so'/></model>");
  EXPECT_THAT(ErrorOf([&] { import({}); }), HasSubstr("hall.world:3: a plugin drives"));
}

}  // namespace
}  // namespace slalom::sim
