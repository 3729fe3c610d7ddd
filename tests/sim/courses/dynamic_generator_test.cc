#include "sim/courses/dynamic_generator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <vector>

#include "base/file.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "sim/courses/motion.h"
#include "tests/sim/courses/barn_data.h"

namespace slalom::sim {
namespace {

/// What is compared of moving boxes, one number each. Of box courses: of each way once; the sizes:
/// of each box.
struct Sample {
  std::map<std::string, std::vector<double>> values;
  std::map<std::size_t, int> counts;  ///< Courses by number of boxes.

  void AddWay(const base::Pose2& from, const base::Pose2& to, double period) {
    values["from x"].push_back(from.p.x);
    values["to x"].push_back(to.p.x);
    values["yaw"].push_back(from.yaw);
    values["speed"].push_back(base::Norm(to.p - from.p) / period);
    values["period"].push_back(period);
  }
};

/// The wall that goes right to left, and the other, apart.
Sample WallSample(const std::vector<std::vector<MovingObstacle>>& worlds) {
  Sample sample;
  for (const auto& world : worlds) {
    for (const MovingObstacle& wall : world) {
      const KeyFrame& to = wall.key_frames.back();
      sample.values["length"].push_back(2.0 * wall.half_size.y);
      sample.values["yaw"].push_back(to.X_WB.yaw);
      sample.values["speed"].push_back(4.5 / to.time);
      sample.values["period"].push_back(to.time);
    }
    const double difference = world[0].key_frames.back().time - world[1].key_frames.back().time;
    sample.values["difference of the periods"].push_back(difference);
  }
  return sample;
}

Sample BoxSample(const std::vector<std::vector<MovingObstacle>>& worlds) {
  Sample sample;
  std::set<std::tuple<double, double, double, double>> seen;
  for (const auto& world : worlds) {
    ++sample.counts[world.size()];
    for (const MovingObstacle& box : world) {
      sample.values["size x"].push_back(2.0 * box.half_size.x);
      sample.values["size y"].push_back(2.0 * box.half_size.y);
      const KeyFrame& from = box.key_frames.front();
      const KeyFrame& to = box.key_frames.back();
      if (seen.insert({from.X_WB.p.x, to.X_WB.p.x, from.X_WB.yaw, to.time}).second) {
        sample.AddWay(from.X_WB, to.X_WB, to.time);
      }
    }
  }
  return sample;
}

std::vector<std::vector<MovingObstacle>> Motions(const CourseSet& set) {
  std::vector<std::vector<MovingObstacle>> motions;
  for (const auto& course : set.courses) motions.push_back(course->moving);
  return motions;
}

/// Two samples of one distribution come further apart in 1 of 1000 cases (Smirnov).
double Bound(std::size_t n, std::size_t m) {
  return 1.95 * std::sqrt(1.0 / static_cast<double>(n) + 1.0 / static_cast<double>(m));
}

/// The names of what differs more than chance allows.
std::set<std::string> Differences(const Sample& a, const Sample& b) {
  std::set<std::string> names;
  for (const auto& [name, values] : a.values) {
    const std::vector<double>& others = b.values.at(name);
    if (DistributionDistance(values, others) > Bound(values.size(), others.size()))
      names.insert(name);
  }
  return names;
}

/// Whether these counts of 10 to 14 are as a uniform draw gives them: chi squared with 4 degrees of
/// freedom exceeds 18.47 in 1 of 1000 cases.
bool AreUniform(const std::map<std::size_t, int>& counts, int total) {
  double chi_squared = 0.0;
  int counted = 0;
  for (std::size_t n = 10; n <= 14; ++n) {
    const int observed = counts.contains(n) ? counts.at(n) : 0;
    counted += observed;
    const double expected = total / 5.0;
    chi_squared += (observed - expected) * (observed - expected) / expected;
  }
  return counted == total && chi_squared < 18.47;
}

constexpr int kNumCompared = 2000;  // Courses, so 20 pools of 100 ways.

using Names = std::set<std::string>;

TEST_F(PublishedWorlds, ResembleGeneratedBoxes) {
  const Sample original = BoxSample(ReadBarnMotions(directory() / "dynamic_box.csv"));
  ASSERT_EQ(original.values.at("speed").size(), 100u);  // The pool.
  ASSERT_EQ(original.values.at("size x").size(), 1207u);
  const Sample generated = BoxSample(Motions(GenerateBoxCourses(1, 0, kNumCompared)));
  EXPECT_EQ(generated.values.at("speed").size(), 2000u);
  EXPECT_EQ(Differences(original, generated), Names());
  EXPECT_TRUE(AreUniform(original.counts, 100));
  EXPECT_TRUE(AreUniform(generated.counts, kNumCompared));
}

// The recipe of the published script, which did not make the published worlds, and others that are
// not far off must be told apart.
TEST_F(PublishedWorlds, DifferFromWrongBoxes) {
  const Sample original = BoxSample(ReadBarnMotions(directory() / "dynamic_box.csv"));
  const auto sample_of = [](const DynamicBoxRecipe& recipe) {
    std::vector<std::vector<MovingObstacle>> worlds;
    for (std::uint64_t pool = 0; pool < 20; ++pool) {
      base::Random random(pool);
      const auto ways = DrawBoxTrajectories(recipe, random);
      for (std::uint64_t i = 0; i < 100; ++i) {
        worlds.push_back(GenerateBoxCourse("wrong", recipe, ways, 1000 * pool + i).moving);
      }
    }
    return BoxSample(worlds);
  };
  EXPECT_EQ(Differences(original, sample_of({})), Names());
  EXPECT_EQ(Differences(original, sample_of({.min_speed = 0.1, .max_speed = 1.0})),
            (Names{"speed", "period"}));
  EXPECT_TRUE(Differences(original, sample_of({.min_size = 0.15})).contains("size x"));
  EXPECT_EQ(Differences(original, sample_of({.max_yaw = base::kPi})), Names{"yaw"});
  EXPECT_FALSE(AreUniform(sample_of({.min_boxes = 11, .max_boxes = 14}).counts, 2000));
  EXPECT_FALSE(AreUniform(sample_of({.min_boxes = 10, .max_boxes = 15}).counts, 2000));
}

TEST_F(PublishedWorlds, ResembleGeneratedWalls) {
  const Sample original = WallSample(ReadBarnMotions(directory() / "dynamic_wall.csv"));
  ASSERT_EQ(original.values.at("length").size(), 200u);
  const Sample generated = WallSample(Motions(GenerateWallCourses(1, 0, kNumCompared)));
  EXPECT_EQ(Differences(original, generated), Names());

  const auto sample_of = [](const DynamicWallRecipe& recipe) {
    std::vector<std::vector<MovingObstacle>> worlds;
    for (std::uint64_t i = 0; i < kNumCompared; ++i) {
      worlds.push_back(GenerateWallCourse("wrong", recipe, i).moving);
    }
    return WallSample(worlds);
  };
  EXPECT_EQ(Differences(original, sample_of({})), Names());
  EXPECT_EQ(Differences(original, sample_of({.min_length = 3.0})), Names{"length"});
  EXPECT_EQ(Differences(original, sample_of({.max_yaw = 0.25})), Names{"yaw"});
  EXPECT_TRUE(Differences(original, sample_of({.max_speed = 1.8})).contains("speed"));
}

/// How often a world holds a way that it already has.
std::size_t NumRepeats(const std::vector<std::vector<MovingObstacle>>& worlds) {
  std::size_t total = 0;
  for (const auto& world : worlds) {
    std::set<std::pair<double, double>> ways;
    for (const MovingObstacle& box : world) {
      ways.insert({box.key_frames.front().X_WB.p.x, box.key_frames.back().time});
    }
    total += world.size() - ways.size();
  }
  return total;
}

TEST(DynamicGenerator, NoCourseHasAWayTwice) {
  EXPECT_EQ(NumRepeats(Motions(GenerateBoxCourses(3, 0, 300))), 0u);
}

TEST_F(PublishedWorlds, HaveNoWayTwice) {
  // Draws with repetition, 100 worlds of 12 ways out of 100, would have 66 repeats on average.
  EXPECT_EQ(NumRepeats(ReadBarnMotions(directory() / "dynamic_box.csv")), 0u);
}

TEST(DynamicGenerator, BoxesDriveTowardsTheRobotThroughTheWholeSquare) {
  for (const auto& course : GenerateBoxCourses(2, 0, 100).courses) {
    EXPECT_EQ(WhyUnsolvable(*course), std::nullopt) << course->name;
    EXPECT_EQ(course->start, (base::Pose2{{-2.0, 3.0}, 1.57}));
    EXPECT_EQ(course->goal_W, (base::Vec2{-2.0, 13.0}));
    for (const MovingObstacle& box : course->moving) {
      EXPECT_EQ(box.playback, Playback::kLoop);
      ASSERT_EQ(box.key_frames.size(), 2u);
      const auto& [from, to] = std::tie(box.key_frames[0].X_WB, box.key_frames[1].X_WB);
      EXPECT_EQ(from.p.y, 14.0);
      EXPECT_EQ(to.p.y, 0.5);
      EXPECT_EQ(from.yaw, to.yaw);
      for (const KeyFrame& frame : box.key_frames) {
        const Bounds with_box = Including(course->bounds, Box{frame.X_WB, box.half_size});
        EXPECT_EQ(with_box, course->bounds);
      }
    }
  }
}

TEST(DynamicGenerator, WallsSweepTheCorridorFromBothSides) {
  for (const auto& course : GenerateWallCourses(2, 0, 100).courses) {
    EXPECT_EQ(WhyUnsolvable(*course), std::nullopt) << course->name;
    EXPECT_EQ(CourseWarnings(*course), std::vector<std::string>());
    ASSERT_EQ(course->moving.size(), 2u);
    for (int i = 0; i < 2; ++i) {
      const MovingObstacle& wall = course->moving[i];
      const base::Vec2 right{0.0, 7.25}, left{-4.5, 7.25};
      EXPECT_EQ(wall.key_frames[0].X_WB.p, i == 0 ? right : left);
      EXPECT_EQ(wall.key_frames[1].X_WB.p, i == 0 ? left : right);
      EXPECT_EQ(wall.half_size.x, 0.05);
      for (const KeyFrame& frame : wall.key_frames) {
        EXPECT_EQ(Including(course->bounds, Box{frame.X_WB, wall.half_size}), course->bounds);
      }
    }
    EXPECT_NE(course->moving[0].key_frames[1].time, course->moving[1].key_frames[1].time);
  }
}

/// Whether a disc can get from the start to y = 10.5 past the moving walls when these are at
/// `motion_time` [s] at first: reachable places on a grid of 0.1 m, spread by one cell along x or
/// y, that is at 2 m/s, or not at all, every 0.05 s for 20 s.
bool CanBePassed(const Course& course, double radius, double motion_time) {
  constexpr int kNumX = 39, kNumY = 76;
  const auto place = [](int x, int y) { return base::Vec2{-4.2 + 0.1 * x, 3.0 + 0.1 * y}; };
  using Places = std::vector<char>;  // [kNumX, kNumY]
  Places reached(kNumX * kNumY, 0);
  reached[22 * kNumY] = 1;
  for (int step = 1; step <= 400; ++step) {
    Places next(kNumX * kNumY, 0);
    std::vector<Box> walls;
    for (const MovingObstacle& wall : course.moving) {
      walls.push_back({Motion(wall).At(motion_time + 0.05 * step).X_WB, wall.half_size});
    }
    const auto is_free = [&](base::Vec2 p_W) {
      return std::none_of(walls.begin(), walls.end(), [&](const Box& wall) {
        const base::Vec2 p = base::InverseTransform(wall.X_WB, p_W);
        return base::Norm({std::max(0.0, std::abs(p.x) - wall.half_size.x),
                           std::max(0.0, std::abs(p.y) - wall.half_size.y)}) < radius;
      });
    };
    for (int x = 0; x < kNumX; ++x) {
      for (int y = 0; y < kNumY; ++y) {
        const auto was = [&](int i, int j) {
          return i >= 0 && i < kNumX && j >= 0 && j < kNumY && reached[i * kNumY + j];
        };
        const bool is_near =
            was(x, y) || was(x - 1, y) || was(x + 1, y) || was(x, y - 1) || was(x, y + 1);
        if (!is_near || !is_free(place(x, y))) continue;
        if (y == kNumY - 1) return true;
        next[x * kNumY + y] = 1;
      }
    }
    reached = next;
  }
  return false;
}

TEST(DynamicGenerator, WallsCanBePassedWhateverTheirPhase) {
  for (const auto& course : GenerateWallCourses(7, 0, 12).courses) {
    for (const double time : {100.0, 101.3, 102.6, 103.9}) {
      EXPECT_TRUE(CanBePassed(*course, 0.32, time)) << course->name << " from " << time << " s";
    }
  }
  // As long as the corridor is wide they could not be.
  DynamicWallRecipe closed;
  closed.thickness = 4.0;
  EXPECT_FALSE(CanBePassed(GenerateWallCourse("closed", closed, 1), 0.32, 100.0));
}

TEST(DynamicGenerator, CourseDependsOnSeedAndIndexAlone) {
  for (const auto generate : {GenerateBoxCourses, GenerateWallCourses}) {
    const CourseSet all = generate(5, 0, 210);
    for (const int i : {0, 7, 99, 100, 209}) {
      EXPECT_EQ(*all.courses[static_cast<std::size_t>(i)], *generate(5, i, 1).courses.front());
    }
    EXPECT_NE(all.courses[0]->moving, generate(6, 0, 1).courses.front()->moving);
    EXPECT_NE(all.courses[0]->moving, all.courses[1]->moving);
    EXPECT_NE(all.courses[0]->moving, all.courses[100]->moving);
  }
  EXPECT_NE(GenerateBoxCourses(5, 0, 1).courses[0]->moving,
            GenerateFreshBoxCourses(5, 1).courses[0]->moving);
  EXPECT_NE(GenerateWallCourses(5, 0, 1).courses[0]->moving,
            GenerateFreshWallCourses(5, 1).courses[0]->moving);
  EXPECT_EQ(GenerateFreshBoxCourses(5, 3).courses[2]->name, "fresh-box-5-002");
}

// The same bits in every build, on every machine, for good: results name courses by seed and index.
TEST(DynamicGenerator, CoursesNeverChange) {
  EXPECT_EQ(base::Checksum(PrintCourseSet(GenerateBoxCourses(1, 95, 10))), 2659877039849474134ull);
  EXPECT_EQ(base::Checksum(PrintCourseSet(GenerateWallCourses(1, 95, 10))), 5084334049357209514ull);
}

}  // namespace
}  // namespace slalom::sim
