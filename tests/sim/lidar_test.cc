#include "sim/lidar.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/sim/written_environment.h"
#include "tests/support/random_courses.h"

namespace slalom::sim {
namespace {

using base::Vec2;

void CheckAgainstOracle(const LidarConfig& config, double clip, const Course& course,
                        const base::Pose2& X_WR) {
  const Lidar lidar(config, clip);
  const CollisionMap map(course);
  std::vector<float> ranges(config.num_beams);
  lidar.Cast(map, X_WR, ranges);
  const Vec2 from = base::Transform(X_WR, {config.offset_x, config.offset_y});
  const double reach = std::min(clip, config.max_range);
  for (int beam = 0; beam < config.num_beams; ++beam) {
    const auto [s, c] = base::SinCos(X_WR.yaw + lidar.beam_angle(beam));
    const double low = std::min(reach, CastOne(course, from, {c, s}, kSideways));
    const double high = std::min(reach, CastOne(course, from, {c, s}, -kSideways));
    const double found = std::min<double>(reach, ranges[beam]);
    ASSERT_GE(found, low - kAlong)
        << "beam " << beam << " at " << X_WR.p.x << " " << X_WR.p.y << " " << X_WR.yaw;
    ASSERT_LE(found, high + kAlong)
        << "beam " << beam << " at " << X_WR.p.x << " " << X_WR.p.y << " " << X_WR.yaw;
  }
}

base::Pose2 RandomPose(base::Random& random) {
  return {{random.Uniform(-5.0, 5.0), random.Uniform(-5.0, 5.0)}, random.Uniform(-10.0, 10.0)};
}

TEST(LidarTest, AgreesWithBruteForceAmongCircles) {
  base::Random random(1);
  for (int round = 0; round < 30; ++round) {
    const auto course = test::RandomCourse(random);
    for (int k = 0; k < 4; ++k) CheckAgainstOracle({}, 5.0, *course, RandomPose(random));
  }
}

TEST(LidarTest, AgreesWithBruteForceAmongCirclesAndBoxes) {
  base::Random random(2);
  for (int round = 0; round < 15; ++round) {
    const auto course = test::RandomCourse(random, {.num_circles = 10, .num_boxes = 12});
    for (int k = 0; k < 4; ++k) CheckAgainstOracle({}, 5.0, *course, RandomPose(random));
  }
}

TEST(LidarTest, AgreesWithBruteForceForOtherSensors) {
  base::Random random(3);
  const LidarConfig sensors[] = {
      {.num_beams = 2, .field_of_view = 0.5},
      {.num_beams = 9, .field_of_view = 6.2831},
      {.num_beams = 1081, .field_of_view = 6.2831, .offset_x = -0.3, .offset_y = 0.2},
      {.num_beams = 4096, .field_of_view = 3.0, .max_range = 2.0}};
  for (const LidarConfig& sensor : sensors) {
    for (int round = 0; round < 5; ++round) {
      const auto course = test::RandomCourse(random, {.num_circles = 20, .num_boxes = 6});
      for (int k = 0; k < 3; ++k) CheckAgainstOracle(sensor, 12.0, *course, RandomPose(random));
    }
  }
}

TEST(LidarTest, SeesFewLargeCirclesFromInsideAndNear) {
  base::Random random(4);
  for (int round = 0; round < 60; ++round) {
    const auto course =
        test::RandomCourse(random, {.num_circles = 3, .max_radius = 3.0, .clear_start = 0.0});
    for (int k = 0; k < 4; ++k) CheckAgainstOracle({}, 5.0, *course, RandomPose(random));
  }
}

TEST(LidarTest, ReportsNearestWithinLimits) {
  Course course;
  course.circles = {{{1.12, 0.0}, 0.5}, {{-1.0, 0.0}, 0.2}};
  LidarConfig config{.num_beams = 3, .field_of_view = 3.14159265358979, .noise_std = 0.0};
  base::Random noise(5);
  std::vector<std::uint16_t> ranges(3);
  Lidar(config, 5.0).Scan(CollisionMap(course), {}, noise, ranges);
  EXPECT_EQ(ranges, (std::vector<std::uint16_t>{500, 50, 500}));

  config.resolution = 0.2;
  config.min_range = 0.7;
  Lidar(config, 5.0).Scan(CollisionMap(course), {}, noise, ranges);
  EXPECT_EQ(ranges, (std::vector<std::uint16_t>{500, 80, 500})) << "0.7 m is 3.5 steps of 0.2 m";

  config.max_range = 3.0;
  Lidar(config, 5.0).Scan(CollisionMap(course), {}, noise, ranges);
  EXPECT_EQ(ranges, (std::vector<std::uint16_t>{300, 80, 300}));
}

TEST(LidarTest, ConfiguredAgainItIsTheOtherLidar) {
  base::Random random(7);
  const LidarConfig first{.noise_per_metre = 0.01};
  std::vector<LidarConfig> others(6, first);
  others[1].field_of_view = 3.0;
  others[2].noise_std = 0.05;
  others[3].noise_per_metre = 0.0;
  others[4].num_beams = 361;
  others[5] = {.offset_x = 0.3, .min_range = 0.5, .max_range = 4.0, .dropout_probability = 0.1};
  Lidar lidar(first, 5.0);
  for (int round = 0; round < 60; ++round) {
    const LidarConfig& config = others[random.UniformInt(others.size())];
    const double clip = random.Uniform(2.0, 8.0);
    lidar.Configure(config, clip);
    const CollisionMap map(*test::RandomCourse(random));
    const base::Pose2 X_WR = RandomPose(random);
    std::vector<std::uint16_t> ranges(config.num_beams), expected(config.num_beams);
    base::Random noise(round), same_noise(round);
    lidar.Scan(map, X_WR, noise, ranges);
    Lidar(config, clip).Scan(map, X_WR, same_noise, expected);
    ASSERT_EQ(ranges, expected);
  }
}

TEST(LidarTest, WithoutNoiseDrawsNothing) {
  const CollisionMap map{Course{}};
  base::Random noise(6);
  const auto before = noise.state();
  std::vector<std::uint16_t> ranges(720);
  Lidar({.noise_std = 0.0}, 5.0).Scan(map, {}, noise, ranges);
  EXPECT_EQ(noise.state(), before);
  Lidar({}, 5.0).Scan(map, {}, noise, ranges);
  EXPECT_NE(noise.state(), before);
}

TEST(LidarTest, ABeamWithoutAnEchoReadsMoreThanTheLongestEcho) {
  LidarConfig config;
  config.max_range = 10.0;
  config.noise_std = 0.02;
  config.noise_per_metre = 0.002;
  config.dropout_probability = 0.01;
  const Lidar lidar(config, 30.0);
  const CollisionMap nothing{Course{}};
  base::Random noise(11);
  std::vector<std::uint16_t> ranges(config.num_beams);
  double shortest = config.max_range;
  for (int scan = 0; scan < 200; ++scan) {
    lidar.Scan(nothing, {}, noise, ranges);
    shortest = std::min(shortest, 0.01 * *std::ranges::min_element(ranges));
  }
  EXPECT_GE(shortest, LongestEcho(config));
  EXPECT_LT(shortest, LongestEcho(config) + 0.02) << "and no later than that";
}

TEST(LidarTest, SeesObstaclesThatOnlyNoiseBringsWithinTheClip) {
  // At 6 m the noise is 0.05 m + 0.1 x 6 m. Rounding to 0.01 m reports those below 4.995 m as
  // nearer than the clip at 5 m: beyond 1.546 standard deviations, 6.10 %.
  Course course;
  course.boxes = {{{{11.0, 0.0}, 0.0}, {5.0, 5.0}}};
  const LidarConfig config{.num_beams = 200,
                           .field_of_view = 0.01,
                           .offset_x = 0.0,
                           .noise_std = 0.05,
                           .noise_per_metre = 0.1};
  const Lidar lidar(config, 5.0);
  const CollisionMap map(course);
  base::Random noise(9);
  std::vector<std::uint16_t> ranges(config.num_beams);
  int nearer = 0;
  for (int scan = 0; scan < 500; ++scan) {
    lidar.Scan(map, {}, noise, ranges);
    nearer += static_cast<int>(std::count_if(ranges.begin(), ranges.end(),
                                             [](std::uint16_t range) { return range < 500; }));
  }
  const double n = 500.0 * config.num_beams, share = 0.0610;
  EXPECT_NEAR(nearer / n, share, 5.0 * std::sqrt(share * (1.0 - share) / n));
}

TEST(LidarTest, LosesBeamsIndependentlyAtTheGivenRate) {
  Course course;
  course.boxes = {{{{10.0, 0.0}, 0.0}, {9.0, 9.0}}};
  const LidarConfig config{.num_beams = 721,
                           .field_of_view = 0.5,
                           .max_range = 20.0,
                           .noise_std = 0.0,
                           .dropout_probability = 0.03};
  const Lidar lidar(config, 30.0);
  const CollisionMap map(course);
  base::Random noise(10);
  std::vector<std::uint16_t> ranges(config.num_beams);
  int lost = 0, pairs = 0;
  constexpr int kScans = 1000;
  for (int scan = 0; scan < kScans; ++scan) {
    lidar.Scan(map, {}, noise, ranges);
    for (int i = 0; i < config.num_beams; ++i) {
      ASSERT_TRUE(ranges[i] == 2000 || ranges[i] < 120);
      lost += ranges[i] == 2000;
      pairs += i > 0 && ranges[i] == 2000 && ranges[i - 1] == 2000;
    }
  }
  const double n = 721.0 * kScans, p = 0.03;
  EXPECT_NEAR(lost / n, p, 5.0 * std::sqrt(p * (1.0 - p) / n));
  EXPECT_NEAR(pairs / n, p * p * 720.0 / 721.0, 5.0 * std::sqrt(p * p / n));
}

// Whether samples could be of the standard normal distribution: mean, variance, kurtosis and the
// share beyond 2, each within 5 standard errors, so a right sampler fails for one seed in a
// million.
bool LooksStandardNormal(const std::vector<double>& samples) {
  const double n = static_cast<double>(samples.size());
  double sum = 0.0, squares = 0.0, fourths = 0.0, beyond = 0.0;
  for (const double z : samples) {
    sum += z;
    squares += z * z;
    fourths += z * z * z * z;
    beyond += std::abs(z) > 2.0;
  }
  const double share = 0.0455003;
  return std::abs(sum / n) < 5.0 / std::sqrt(n) &&
         std::abs(squares / n - 1.0) < 5.0 * std::sqrt(2.0 / n) &&
         std::abs(fourths / n - 3.0) < 5.0 * std::sqrt(96.0 / n) &&
         std::abs(beyond / n - share) < 5.0 * std::sqrt(share * (1.0 - share) / n);
}

TEST(LidarTest, NoiseIsNormalAndIndependent) {
  // A wall far ahead and noise much wider than the resolution: rounding to 1 cm adds (1 cm)^2 / 12
  // to a variance of (50 cm)^2, 3e-5 of it, far below the bounds for 2e5 samples (5 * sqrt(2 / n)
  // = 1.6e-2).
  Course course;
  course.boxes = {{{{30.0, 0.0}, 0.0}, {10.0, 10.0}}};
  const CollisionMap map(course);
  const LidarConfig config{.num_beams = 200,
                           .field_of_view = 0.2,
                           .offset_x = 0.0,
                           .max_range = 100.0,
                           .noise_std = 0.5};
  const Lidar lidar(config, 100.0);
  base::Random noise(7);
  std::vector<float> exact(config.num_beams);
  lidar.Cast(map, {}, exact);
  std::vector<std::uint16_t> ranges(config.num_beams);
  std::vector<double> samples;
  for (int scan = 0; scan < 1000; ++scan) {
    lidar.Scan(map, {}, noise, ranges);
    for (int i = 0; i < config.num_beams; ++i)
      samples.push_back((0.01 * ranges[i] - exact[i]) / 0.5);
  }
  EXPECT_TRUE(LooksStandardNormal(samples));
  // Sums of neighbours are normal of variance 2 only if neighbours are independent.
  std::vector<double> sums;
  for (std::size_t i = 0; i + 1 < samples.size(); i += 2) {
    sums.push_back((samples[i] + samples[i + 1]) / std::sqrt(2.0));
  }
  EXPECT_TRUE(LooksStandardNormal(sums));

  std::vector<double> too_wide = samples, uniform, repeated;
  for (double& z : too_wide) z *= 1.03;
  base::Random random(8);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    uniform.push_back(std::sqrt(3.0) * random.Uniform(-1.0, 1.0));
    repeated.push_back(std::sqrt(2.0) * samples[i & ~std::size_t{1}]);
  }
  EXPECT_FALSE(LooksStandardNormal(too_wide));
  EXPECT_FALSE(LooksStandardNormal(uniform));
  EXPECT_FALSE(LooksStandardNormal(repeated));
}

}  // namespace
}  // namespace slalom::sim
