#include "sim/pictures/course_render.h"

#include <cairo.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "sim/courses/course_generator.h"
#include "sim/courses/motion.h"
#include "sim/pictures/course_painter.h"
#include "sim/pictures/course_text.h"
#include "sim/pictures/guard_marks.h"

namespace slalom::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A PNG read back.
class Picture {
 public:
  explicit Picture(const std::string& png)
      : rest_(png), surface_(cairo_image_surface_create_from_png_stream(Read, this)) {
    EXPECT_EQ(cairo_surface_status(surface_), CAIRO_STATUS_SUCCESS);
  }
  ~Picture() { cairo_surface_destroy(surface_); }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;

  int width() const { return cairo_image_surface_get_width(surface_); }
  int height() const { return cairo_image_surface_get_height(surface_); }

  /// Number of pixels within 1/50 of `colour`.
  int Count(Colour colour) const {
    int count = 0;
    for (int y = 0; y < height(); ++y) {
      const auto* row = reinterpret_cast<const std::uint32_t*>(
          cairo_image_surface_get_data(surface_) + y * cairo_image_surface_get_stride(surface_));
      for (int x = 0; x < width(); ++x) {
        const auto part = [&](int shift) {
          return static_cast<double>(row[x] >> shift & 0xff) / 255.0;
        };
        count += std::abs(part(16) - colour.red) < 0.02 &&
                 std::abs(part(8) - colour.green) < 0.02 && std::abs(part(0) - colour.blue) < 0.02;
      }
    }
    return count;
  }

 private:
  static cairo_status_t Read(void* self, unsigned char* data, unsigned int size) {
    auto& rest = static_cast<Picture*>(self)->rest_;
    if (rest.size() < size) return CAIRO_STATUS_READ_ERROR;
    std::copy_n(rest.begin(), size, data);
    rest.erase(0, size);
    return CAIRO_STATUS_SUCCESS;
  }

  std::string rest_;
  cairo_surface_t* surface_;
};

EpisodeTrack StraightTrack(env::Outcome outcome, double x, double length) {
  EpisodeTrack track{"open", outcome, {}};
  for (int i = 0; i <= 20; ++i) track.poses.push_back({{x, 3.0 + i * length / 20}, 1.57});
  return track;
}

Course OpenCourse() { return MakeBarnCourse("open", FieldGrid(), {}); }

TEST(CourseRender, PngHoldsTheOutcomesThatWereDrivenAndNoOthers) {
  const Course course = OpenCourse();
  const std::vector<EpisodeTrack> tracks = {StraightTrack(env::Outcome::kSuccess, -2.0, 9.8),
                                            StraightTrack(env::Outcome::kCollision, -1.0, 3.0)};
  const Picture with(RenderCourse({&course, tracks}, PictureFormat::kPng));
  const Picture without(RenderCourse({&course, {}}, PictureFormat::kPng));
  for (const env::Outcome outcome : {env::Outcome::kSuccess, env::Outcome::kCollision}) {
    EXPECT_GT(with.Count(OutcomeColour(outcome)), 30) << ToString(outcome);
    EXPECT_EQ(without.Count(OutcomeColour(outcome)), 0) << ToString(outcome);
  }
  EXPECT_EQ(with.Count(OutcomeColour(env::Outcome::kTimeout)), 0);
  // 4.5 x 13.5 m at 64 pixels a metre, and room for title and legend.
  EXPECT_GT(with.width(), 288);
  EXPECT_LT(with.width(), 288 + 400);
  EXPECT_GT(with.height(), 864);
  EXPECT_LT(with.height(), 864 + 100);
}

TEST(CourseRender, MarksWhereAGuardChangedTheAction) {
  const Course course = OpenCourse();
  std::vector<EpisodeTrack> tracks = {StraightTrack(env::Outcome::kSuccess, -2.0, 9.8)};
  const auto white = [&](std::vector<int> interventions) {
    tracks[0].interventions = std::move(interventions);
    return Picture(RenderCourse({&course, tracks}, PictureFormat::kPng)).Count({1.0, 1.0, 1.0});
  };
  const int one = white({3});
  EXPECT_LT(one, white({}) - 50) << "the legend has a word for it";
  // Each ring has a radius of 0.05 m at 64 pixels a metre, and its line takes a fifth of that.
  EXPECT_NEAR((white({3, 8, 13}) - one) / 2.0, base::kPi * 2.56 * 2.56, 10.0);
  // Poses are 0.49 m apart. Marks that would hide each other are left out.
  tracks[0].interventions = {3, 4, 5};
  EXPECT_THAT(GuardMarks(tracks[0], 0.48), ElementsAre(3, 4, 5));
  EXPECT_THAT(GuardMarks(tracks[0], 0.5), ElementsAre(3, 5));
}

TEST(CourseRender, AreaOfObstaclesIsToScale) {
  Course course = OpenCourse();
  course.circles.clear();
  const Colour obstacle{0.26, 0.30, 0.36};
  const int before = Picture(RenderCourse({&course, {}}, PictureFormat::kPng)).Count(obstacle);
  course.boxes.push_back({{{-1.0, 7.0}, 0.3}, {0.5, 0.25}});
  const int after = Picture(RenderCourse({&course, {}}, PictureFormat::kPng)).Count(obstacle);
  // 1 m x 0.5 m at 64 pixels a metre, less the pixels of the edge (3 m) that are blended.
  EXPECT_NEAR(after - before, 0.5 * 64 * 64, 3.0 * 64);
}

/// A box of 1 m x 0.5 m that is driven from `from` to `to` in 4 s.
MovingObstacle MovingBox(const base::Pose2& from, const base::Pose2& to) {
  return {.radius = 0.0,
          .half_size = {0.5, 0.25},
          .key_frames = {{0.0, from}, {4.0, to}},
          .playback = Playback::kLoop};
}

TEST(CourseRender, MovingObstaclesAreFilledWhereTheyBegin) {
  Course course = OpenCourse();
  const Picture without(RenderCourse({&course, {}}, PictureFormat::kPng));
  EXPECT_EQ(without.Count(kMoving), 0);
  course.moving.push_back(MovingBox({{-1.0, 7.0}, 0.3}, {{-3.0, 7.0}, 0.3}));
  const Picture with(RenderCourse({&course, {}}, PictureFormat::kPng));
  // 1 m x 0.5 m at 64 pixels a metre, less blended pixels of the edge (3 m), and the symbol of the
  // legend, at most 18 x 18 pixels.
  EXPECT_NEAR(with.Count(kMoving), 0.5 * 64 * 64, 3.0 * 64 + 18 * 18);
  course.moving[0].radius = 0.4;
  const Picture circle(RenderCourse({&course, {}}, PictureFormat::kPng));
  EXPECT_NEAR(circle.Count(kMoving), base::kPi * 0.16 * 64 * 64, 2.6 * 64 + 18 * 18);
}

TEST(CourseRender, ViewHoldsWhatDrivesBeyondTheBounds) {
  Course course = OpenCourse();  // To x = 0.
  const Picture without(RenderCourse({&course, {}}, PictureFormat::kPng));
  course.moving.push_back(MovingBox({{-2.0, 7.0}, 0.0}, {{2.0, 7.0}, 0.0}));
  const Picture with(RenderCourse({&course, {}}, PictureFormat::kPng));
  EXPECT_NEAR(with.width() - without.width(), 2.5 * 64, 1.0);
}

TEST(CourseRender, SweepHoldsEveryPlaceOnTheWay) {
  base::Random random(5);
  for (int i = 0; i < 20; ++i) {
    MovingObstacle obstacle;
    obstacle.playback = i % 2 == 0 ? Playback::kLoop : Playback::kPingPong;
    obstacle.radius = i % 3 == 0 ? 0.3 : 0.0;
    obstacle.half_size = {random.Uniform(0.1, 1.0), random.Uniform(0.1, 1.0)};
    for (int k = 0; k < 5; ++k) {
      obstacle.key_frames.push_back(
          {1.5 * k,
           {{random.Uniform(-5.0, 5.0), random.Uniform(-5.0, 5.0)}, random.Uniform(-3.0, 3.0)}});
    }
    const Bounds sweep = IncludingSweep({{0.0, 0.0}, {0.0, 0.0}}, obstacle);
    const Motion motion(obstacle);
    Bounds dense{{0.0, 0.0}, {0.0, 0.0}};
    for (int n = 0; n < 5000; ++n) {
      const base::Pose2 X_WB = motion.At(6.0 * n / 5000).X_WB;
      dense = obstacle.radius > 0.0 ? Including(dense, Circle{X_WB.p, obstacle.radius})
                                    : Including(dense, Box{X_WB, obstacle.half_size});
    }
    // Between two looks it drives less than 0.2 m, most of which is not at the outermost place.
    EXPECT_NEAR(sweep.min_W.x, dense.min_W.x, 0.02) << i;
    EXPECT_NEAR(sweep.min_W.y, dense.min_W.y, 0.02) << i;
    EXPECT_NEAR(sweep.max_W.x, dense.max_W.x, 0.02) << i;
    EXPECT_NEAR(sweep.max_W.y, dense.max_W.y, 0.02) << i;
  }
}

TEST(CourseRender, LargeCoursesAreDrawnSmaller) {
  Course course = OpenCourse();
  course.bounds = {{-50.0, -20.0}, {50.0, 20.0}};
  const Picture page(RenderCourse({&course, {}}, PictureFormat::kPng));
  EXPECT_GT(page.width(), 2000);
  EXPECT_LT(page.width(), 2000 + 300);
  EXPECT_LT(page.height(), 800 + 100);
  const CourseScene scene{&course, {}};
  const Picture sheet(RenderContactSheet(std::vector(2, scene), 2, PictureFormat::kPng));
  EXPECT_LT(sheet.width(), 2 * 500 + 50);
}

TEST(CourseRender, SvgIsOne) {
  const Course course = OpenCourse();
  const std::string svg = RenderCourse({&course, {}}, PictureFormat::kSvg);
  EXPECT_THAT(svg, HasSubstr("<svg"));
  EXPECT_THAT(svg, HasSubstr("</svg>"));
}

TEST(CourseRender, ContactSheetGrowsByRows) {
  const CourseSet set = GenerateFreshCourses(1, 5);
  std::vector<CourseScene> scenes;
  for (const auto& course : set.courses) scenes.push_back({course.get(), {}});
  const Picture row(RenderContactSheet(scenes, 5, PictureFormat::kPng));
  const Picture block(RenderContactSheet(scenes, 3, PictureFormat::kPng));
  EXPECT_GT(row.width(), block.width());
  EXPECT_GT(block.height(), row.height() + 13.5 * 22.0);
}

TEST(CourseRender, PictureGrowsWithTracksThatLeaveTheCourse) {
  const Course course = OpenCourse();
  const std::vector<EpisodeTrack> tracks = {StraightTrack(env::Outcome::kTimeout, 2.0, 5.0)};
  const Picture with(RenderCourse({&course, tracks}, PictureFormat::kPng));
  const Picture without(RenderCourse({&course, {}}, PictureFormat::kPng));
  EXPECT_NEAR(with.width() - without.width(), 2.35 * 64, 1.0);
}

TEST(CourseRender, AnEndlessPictureIsAnError) {
  Course course = OpenCourse();
  course.bounds.max_W.y = 1e5;
  EXPECT_THROW(RenderCourse({&course, {}}, PictureFormat::kPng), base::Error);
}

TEST(CourseText, DrawsWhatIsThere) {
  Course course;
  course.name = "small";
  course.start = {{0.1, 0.1}, 0.0};
  course.goal_W = {0.8, 1.0};
  course.bounds = {{0.0, 0.0}, {0.9, 1.2}};
  course.circles.push_back({{0.375, 0.75}, 0.07});
  course.boxes.push_back({{{0.45, 0.45}, 0.0}, {0.4, 0.1}});
  course.reference_path_W.push_back({0.075, 0.75});
  EXPECT_EQ(DrawText(course),
            ".....G\n"
            "o.#...\n"
            "######\n"
            "S.....\n");
  EXPECT_THAT(DescribeText(course), ::testing::AllOf(HasSubstr("1 cylinder, 1 box\n"),
                                                     HasSubstr("# obstacle, o reference path\n")));
}

TEST(CourseText, DrawsWhatMovesAndItsWay) {
  Course course;
  course.name = "moving";
  course.start = {{0.1, 0.1}, 0.0};
  course.goal_W = {0.8, 1.0};
  course.bounds = {{0.0, 0.0}, {0.9, 1.2}};
  course.boxes.push_back({{{0.075, 0.75}, 0.0}, {0.05, 0.1}});
  course.moving = {{.radius = 0.07,
                    .half_size = {},
                    .key_frames = {{0.0, {{0.825, 0.75}, 0.0}}, {2.0, {{0.075, 0.75}, 0.0}}},
                    .playback = Playback::kPingPong},
                   {.radius = 0.0,
                    .half_size = {0.07, 0.1},
                    .key_frames = {{0.0, {{0.375, 0.15}, 0.0}}, {1.0, {{0.375, 0.45}, 0.0}}},
                    .playback = Playback::kLoop}};
  EXPECT_EQ(DrawText(course),
            ".....G\n"
            "#::::m\n"
            "..:...\n"
            "S.m...\n");
  // Rounds of 4 s there and back, and 1 s; 0.75 m in 2 s is at most 1.25 times as fast midway.
  // The mean is of 0.75 / 2 and 0.3 m/s.
  EXPECT_THAT(
      DescribeText(course),
      HasSubstr("2 moving: rounds of 1.0 to 4.0 s, 0.34 m/s in the mean, at most 0.47 m/s"));
}

}  // namespace
}  // namespace slalom::sim
