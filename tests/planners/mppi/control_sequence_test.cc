#include "planners/mppi/control_sequence.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace slalom::planners {
namespace {

TEST(Softmax, IsTheOneByTheFormula) {
  base::Random random(1);
  std::vector<float> costs(1003), weights(costs.size());
  for (float& cost : costs) cost = static_cast<float>(random.Uniform(100.0, 106.0));
  SoftmaxOfCosts(costs, 0.3, weights);
  long double sum = 0.0L;
  for (const float cost : costs) sum += std::exp(-static_cast<long double>(cost) / 0.3L);
  for (std::size_t b = 0; b < costs.size(); ++b) {
    const long double exact = std::exp(-static_cast<long double>(costs[b]) / 0.3L) / sum;
    // Rounding of the float difference of costs, 4e-6 / 0.3, and of the weight.
    EXPECT_NEAR(weights[b], static_cast<double>(exact), 3e-5 * static_cast<double>(exact));
  }
}

TEST(Softmax, TakesTheBestAloneWhenTheOthersCollide) {
  const std::vector<float> costs = {1e5f, 2.0f, 1e5f};
  std::vector<float> weights(3);
  SoftmaxOfCosts(costs, 0.3, weights);
  EXPECT_EQ(weights, (std::vector<float>{0.0f, 1.0f, 0.0f}));
}

TEST(ControlSequence, BecomesTheWeightedMean) {
  base::Random random(2);
  Rollouts rollouts(101, 12);
  for (float& v : rollouts.control_linear) v = static_cast<float>(random.Uniform(-1.0, 2.0));
  for (float& w : rollouts.control_angular) w = static_cast<float>(random.Uniform(-3.0, 3.0));
  std::vector<float> weights(101);
  for (float& weight : weights) weight = static_cast<float>(random.Uniform(0.0, 0.02));
  ControlSequence sequence(12);
  TakeWeightedMean(rollouts, weights, sequence);
  for (int t = 0; t < 12; ++t) {
    double linear = 0.0, angular = 0.0;
    for (int b = 0; b < 101; ++b) {
      linear += static_cast<double>(weights[b]) * rollouts.control_linear[rollouts.Index(t, b)];
      angular += static_cast<double>(weights[b]) * rollouts.control_angular[rollouts.Index(t, b)];
    }
    // 101 terms of at most 0.06, each rounded to 6e-8 of the sum.
    EXPECT_NEAR(sequence.linear[t], linear, 1e-5);
    EXPECT_NEAR(sequence.angular[t], angular, 1e-5);
  }
}

TEST(ControlCosts, AreTheInformationTheoreticTerm) {
  Rollouts rollouts(2, 2);
  rollouts.control_linear = {1.2f, 0.9f, 0.4f, 0.6f};  // [T, B]
  rollouts.control_angular = {0.0f, 0.0f, 0.3f, -0.1f};
  ControlSequence sequence(2);
  sequence.linear = {1.0f, 0.5f};
  sequence.angular = {0.0f, 0.2f};
  std::vector<float> costs = {10.0f, 20.0f};
  AddControlCosts(rollouts, sequence, 0.015, 0.2, 0.4, costs);
  const double linear_factor = 0.015 / 0.04, angular_factor = 0.015 / 0.16;
  EXPECT_NEAR(costs[0], 10.0 + linear_factor * (0.2 - 0.05) + angular_factor * 0.02, 1e-5);
  EXPECT_NEAR(costs[1], 20.0 + linear_factor * (-0.1 + 0.05) + angular_factor * -0.06, 1e-5);
}

TEST(Smoothing, LeavesParabolasAndDampsZigzag) {
  // A parabola from four steps before the sequence on: the filter is exact for it, away from the
  // end.
  const auto parabola = [](int t) { return 0.3 + 0.05 * t - 0.002 * t * t; };
  ControlSequence sequence(20);
  for (int k = 0; k < 4; ++k) sequence.commanded[k] = {parabola(k - 4), -parabola(k - 4)};
  for (int t = 0; t < 20; ++t) {
    sequence.linear[t] = static_cast<float>(parabola(t));
    sequence.angular[t] = -sequence.linear[t];
  }
  Smooth(sequence);
  for (int t = 0; t < 16; ++t) {
    EXPECT_NEAR(sequence.linear[t], parabola(t), 1e-6);
    EXPECT_NEAR(sequence.angular[t], -parabola(t), 1e-6);
  }
  for (int t = 0; t < 20; ++t) sequence.linear[t] = t % 2 == 0 ? 1.0f : -1.0f;
  Smooth(sequence);
  // -21 - 14 + 39 - 54 + 59 - 54 + 39 - 14 - 21 = -41, of 231.
  for (int t = 4; t < 16; ++t) EXPECT_NEAR(std::abs(sequence.linear[t]), 41.0 / 231.0, 1e-6);
}

TEST(ControlSequence, ShiftsAndRemembersWhatWasCommanded) {
  ControlSequence sequence(3);
  sequence.linear = {1.0f, 2.0f, 3.0f};
  sequence.angular = {0.1f, 0.2f, 0.3f};
  sequence.Shift();
  EXPECT_EQ(sequence.linear, (std::vector<float>{2.0f, 3.0f, 3.0f}));
  EXPECT_EQ(sequence.angular, (std::vector<float>{0.2f, 0.3f, 0.3f}));
  EXPECT_EQ(sequence.commanded.back(), (Twist{1.0f, 0.1f}));
  sequence.Shift();
  EXPECT_EQ(sequence.commanded[2], (Twist{1.0f, 0.1f}));
  EXPECT_EQ(sequence.commanded[3], (Twist{2.0f, 0.2f}));
}

TEST(ControlSequence, KeepsLimitsOfSpeedAndItsChange) {
  base::Random random(3);
  ControlSequence sequence(50);
  for (float& v : sequence.linear) v = static_cast<float>(random.Uniform(-4.0, 6.0));
  for (float& w : sequence.angular) w = static_cast<float>(random.Uniform(-9.0, 9.0));
  LimitControls(-1.0, 2.0, 3.14, {0.25f, 0.5f, 0.05f}, {0.3, 1.0}, sequence);
  float v = 0.3f, w = 1.0f;
  for (int t = 0; t < 50; ++t) {
    EXPECT_GE(sequence.linear[t], -1.0f);
    EXPECT_LE(sequence.linear[t], 2.0f);
    EXPECT_LE(std::abs(sequence.angular[t]), 3.14f);
    EXPECT_LE(std::abs(sequence.linear[t] - v), 0.25f + 1e-6f);
    EXPECT_LE(std::abs(sequence.angular[t] - w), 0.5f + 1e-6f);
    v = sequence.linear[t];
    w = sequence.angular[t];
  }
}

}  // namespace
}  // namespace slalom::planners
