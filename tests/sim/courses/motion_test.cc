#include "sim/courses/motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "base/random.h"

namespace slalom::sim {
namespace {

MovingObstacle Through(std::vector<KeyFrame> key_frames, Playback playback = Playback::kLoop) {
  MovingObstacle obstacle;
  obstacle.radius = 0.1;
  obstacle.key_frames = std::move(key_frames);
  obstacle.playback = playback;
  return obstacle;
}

MovingObstacle RandomObstacle(base::Random& random, int num_frames, Playback playback) {
  std::vector<KeyFrame> frames;
  double time = 0.0;
  for (int i = 0; i < num_frames; ++i) {
    frames.push_back({time,
                      {{random.Uniform(-5.0, 5.0), random.Uniform(-5.0, 5.0)},
                       random.Uniform(-base::kPi, base::kPi)}});
    time += random.Uniform(0.1, 4.0);
  }
  return Through(std::move(frames), playback);
}

/// Cubic Hermite in the form of the four basis functions.
double Hermite(double p0, double m0, double p1, double m1, double u) {
  return (2 * u * u * u - 3 * u * u + 1) * p0 + (u * u * u - 2 * u * u + u) * m0 +
         (3 * u * u - 2 * u * u * u) * p1 + (u * u * u - u * u) * m1;
}

TEST(MotionTest, TwoKeyFramesGoByTheMeasuredFraction) {
  const Motion motion(Through({{0.0, {{1.0, 14.0}, 0.2}}, {10.0, {{-3.0, 0.5}, 1.2}}}));
  for (double u = 0.0; u < 1.0; u += 0.0625) {
    const double fraction = 0.5 * u + 1.5 * u * u - u * u * u;
    const MotionState state = motion.At(10.0 * u);
    EXPECT_NEAR(state.X_WB.p.x, 1.0 - 4.0 * fraction, 1e-12);
    EXPECT_NEAR(state.X_WB.p.y, 14.0 - 13.5 * fraction, 1e-12);
    EXPECT_NEAR(state.X_WB.yaw, 0.2 + u, 1e-12);
    const double speed = 0.5 + 3.0 * u - 3.0 * u * u;  // Of the mean: 0.5 at the ends, 1.25 amid.
    EXPECT_NEAR(state.v_B.y, -1.35 * speed, 1e-12);
    EXPECT_NEAR(state.yaw_rate, 0.1, 1e-12);
  }
  EXPECT_NEAR(motion.max_speed(), 1.25 * std::hypot(4.0, 13.5) / 10.0, 1e-12);
  EXPECT_NEAR(motion.max_yaw_rate(), 0.1, 1e-12);
  EXPECT_EQ(motion.period(), 10.0);
}

TEST(MotionTest, ManyKeyFramesFollowTheHermiteBasis) {
  base::Random random(1);
  for (int round = 0; round < 50; ++round) {
    const int n = 3 + static_cast<int>(random.UniformInt(6));
    const MovingObstacle obstacle = RandomObstacle(random, n, Playback::kLoop);
    const auto& frames = obstacle.key_frames;
    const Motion motion(obstacle);
    for (int i = 0; i + 1 < n; ++i) {
      // The rule at the ends in another form: the missing neighbour is the end itself.
      const base::Vec2 before = frames[std::max(i - 1, 0)].X_WB.p, from = frames[i].X_WB.p;
      const base::Vec2 to = frames[i + 1].X_WB.p, after = frames[std::min(i + 2, n - 1)].X_WB.p;
      const double turn = base::WrapAngle(frames[i + 1].X_WB.yaw - frames[i].X_WB.yaw);
      for (const double u : {0.0, 0.2, 0.5, 0.9}) {
        const double duration = frames[i + 1].time - frames[i].time;
        const MotionState state = motion.At(frames[i].time + u * duration);
        EXPECT_NEAR(state.X_WB.p.x,
                    Hermite(from.x, 0.5 * (to.x - before.x), to.x, 0.5 * (after.x - from.x), u),
                    1e-11);
        EXPECT_NEAR(state.X_WB.p.y,
                    Hermite(from.y, 0.5 * (to.y - before.y), to.y, 0.5 * (after.y - from.y), u),
                    1e-11);
        EXPECT_NEAR(base::WrapAngle(state.X_WB.yaw - frames[i].X_WB.yaw - u * turn), 0.0, 1e-11);
      }
    }
  }
}

TEST(MotionTest, VelocityIsTheSlopeAndWithinItsBounds) {
  base::Random random(2);
  for (int round = 0; round < 200; ++round) {
    const Playback playback = round % 2 == 0 ? Playback::kLoop : Playback::kPingPong;
    const Motion motion(
        RandomObstacle(random, 2 + static_cast<int>(random.UniformInt(5)), playback));
    for (int i = 0; i < 50; ++i) {
      const double h = 1e-6;
      const double time = random.Uniform(h, 3.0 * motion.period());
      const MotionState state = motion.At(time);
      EXPECT_LE(base::Norm(state.v_B), motion.max_speed() * (1.0 + 1e-12));
      EXPECT_LE(std::abs(state.yaw_rate), motion.max_yaw_rate() * (1.0 + 1e-12));
      if (motion.BeginsRound(time - h, 2.0 * h)) continue;
      const MotionState a = motion.At(time - h), b = motion.At(time + h);
      // The slope of the cubic may itself jump at a key frame within h: 1e-6 s x 1e4 m/s^2.
      const double bend = 0.01 * (1.0 + motion.max_speed() + motion.max_yaw_rate());
      EXPECT_NEAR(state.v_B.x, (b.X_WB.p.x - a.X_WB.p.x) / (2.0 * h), bend);
      EXPECT_NEAR(state.v_B.y, (b.X_WB.p.y - a.X_WB.p.y) / (2.0 * h), bend);
      EXPECT_NEAR(state.yaw_rate, (b.X_WB.yaw - a.X_WB.yaw) / (2.0 * h), bend);
    }
  }
}

TEST(MotionTest, ALoopJumpsBackToTheFirstKeyFrame) {
  const Motion motion(Through({{0.0, {{0.0, 0.0}, 0.0}}, {4.0, {{8.0, 0.0}, 0.0}}}));
  EXPECT_NEAR(motion.At(4.0 - 1e-9).X_WB.p.x, 8.0, 1e-8);
  EXPECT_EQ(motion.At(4.0).X_WB.p.x, 0.0);
  EXPECT_EQ(motion.At(401.0).X_WB.p.x, motion.At(1.0).X_WB.p.x);
  EXPECT_TRUE(motion.BeginsRound(3.9, 0.2));
  EXPECT_TRUE(motion.BeginsRound(7.75, 0.25));
  EXPECT_FALSE(motion.BeginsRound(4.0, 0.2));
  EXPECT_FALSE(motion.BeginsRound(3.5, 0.2));
}

TEST(MotionTest, PingPongGoesTheSameWayBack) {
  base::Random random(3);
  for (int round = 0; round < 20; ++round) {
    const MovingObstacle obstacle = RandomObstacle(random, 4, Playback::kPingPong);
    const Motion motion(obstacle);
    const double turn = obstacle.key_frames.back().time;
    EXPECT_EQ(motion.period(), 2.0 * turn);
    EXPECT_FALSE(motion.BeginsRound(0.0, 10.0 * turn));
    for (int i = 0; i < 20; ++i) {
      const double t = random.Uniform(0.0, turn);
      const MotionState there = motion.At(t), back = motion.At(2.0 * turn - t);
      EXPECT_NEAR(there.X_WB.p.x, back.X_WB.p.x, 1e-10);
      EXPECT_NEAR(there.X_WB.p.y, back.X_WB.p.y, 1e-10);
      EXPECT_NEAR(there.X_WB.yaw, back.X_WB.yaw, 1e-10);
      EXPECT_NEAR(there.v_B.x, -back.v_B.x, 1e-9);
      EXPECT_NEAR(there.yaw_rate, -back.yaw_rate, 1e-9);
    }
  }
}

TEST(MotionTest, AClosedRoundIsSmoothOverItsSeam) {
  // Round a square and, with the heading, once round itself.
  const Motion motion(Through({{0.0, {{0.0, 0.0}, 0.0}},
                               {1.0, {{2.0, 0.0}, 0.5 * base::kPi}},
                               {2.0, {{2.0, 2.0}, -base::kPi}},
                               {3.0, {{0.0, 2.0}, -0.5 * base::kPi}},
                               {4.0, {{0.0, 0.0}, 0.0}}}));
  const MotionState before = motion.At(4.0 - 1e-9), after = motion.At(0.0);
  EXPECT_NEAR(after.v_B.x, 1.0, 1e-12) << "half the way from (0, 2) to (2, 0)";
  EXPECT_NEAR(after.v_B.y, -1.0, 1e-12);
  EXPECT_NEAR(after.yaw_rate, 0.5 * base::kPi, 1e-12);
  EXPECT_NEAR(before.v_B.x, after.v_B.x, 1e-7);
  EXPECT_NEAR(before.v_B.y, after.v_B.y, 1e-7);
  EXPECT_NEAR(before.yaw_rate, after.yaw_rate, 1e-7);
}

TEST(MotionTest, HeadingsTurnTheShorterWay) {
  const Motion motion(Through({{0.0, {{0.0, 0.0}, 3.0}}, {2.0, {{1.0, 0.0}, -3.0}}}));
  EXPECT_NEAR(motion.At(1.0).X_WB.yaw, base::kPi, 1e-12);
}

}  // namespace
}  // namespace slalom::sim
