#include "learner/constraint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "policy/nn/network_shape.h"

namespace slalom::learner {
namespace {

/// A constraint with critics that are of no matter.
struct Fixture {
  explicit Fixture(const ConstraintConfig& config)
      : random(1),
        minibatch(4, 1, 6, at::kCPU),
        totals(at::kCPU),
        constraint(config, Shape(), random, minibatch, totals) {}

  static nn::NetworkShape Shape() {
    nn::NetworkConfig network;
    network.encoder_layers = {};
    network.head_layers = {4};
    return nn::CriticShape(network, 6);
  }

  base::Random random;
  Minibatch minibatch;
  Totals totals;
  Constraint constraint;
};

TEST(Constraint, MultiplierAscendsByTheViolationOfEveryEpisode) {
  Fixture f({.kind = ConstraintKind::kLagrangian,
             .limit = 0.1,
             .multiplier = 1.0,
             .learning_rate = 0.01});
  f.constraint.Observe(0.5, 100);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 1.0 + 100 * 0.01 * 0.4);
  f.constraint.Observe(0.0, 50);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 1.4 - 50 * 0.01 * 0.1);
  // Nothing new, or nothing known: it stays.
  f.constraint.Observe(0.9, 0);
  f.constraint.Observe(std::numeric_limits<double>::quiet_NaN(), 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 1.35);
}

TEST(Constraint, MultiplierStaysWithinItsBounds) {
  Fixture f({.kind = ConstraintKind::kLagrangian,
             .limit = 0.5,
             .multiplier_max = 3.0,
             .learning_rate = 1.0});
  f.constraint.Observe(0.0, 1000);
  EXPECT_EQ(f.constraint.multiplier(), 0.0);
  // It did not go on falling below 0 unseen.
  f.constraint.Observe(1.0, 2);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 1.0);
  f.constraint.Observe(1.0, 7998);
  EXPECT_EQ(f.constraint.multiplier(), 3.0);
}

// Stooke, Achiam and Abbeel 2020, algorithm 2, written out.
TEST(Constraint, TheDerivativePartCountsRisesAlone) {
  Fixture f({.kind = ConstraintKind::kLagrangian,
             .limit = 0.0,
             .learning_rate = 0.01,
             .derivative_gain = 3.0});
  f.constraint.Observe(0.2, 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 0.02);  // The first look rises from nowhere.
  f.constraint.Observe(0.6, 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 0.02 + 0.06 + 3.0 * (0.6 - 0.2));
  f.constraint.Observe(0.6, 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 0.02 + 0.06 + 0.06);  // It was not kept.
  f.constraint.Observe(0.1, 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 0.02 + 0.06 + 0.06 + 0.01);
}

// The proportional part adds nothing to what the integral one keeps, and takes away below the
// limit.
TEST(Constraint, TheProportionalPartAnswersTheLastLookAlone) {
  Fixture f({.kind = ConstraintKind::kLagrangian,
             .limit = 0.1,
             .learning_rate = 0.01,
             .proportional_gain = 2.0});
  f.constraint.Observe(0.6, 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 2.0 * 0.5 + 0.05);
  f.constraint.Observe(0.2, 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 2.0 * (0.2 - 0.1) + 0.05 + 0.01);
  f.constraint.Observe(0.0, 1);
  EXPECT_EQ(f.constraint.multiplier(), 0.0);
  f.constraint.Observe(0.1, 1);
  EXPECT_NEAR(f.constraint.multiplier(), 0.05 + 0.01 - 0.001, 1e-15);
}

// Where the number of collisions answers lambda, the integral part finds the lambda that holds
// the limit, and the proportional one gets there with less overshoot.
TEST(Constraint, FindsTheMultiplierThatHoldsTheLimit) {
  const auto overshoot = [](double proportional) {
    Fixture f({.kind = ConstraintKind::kLagrangian,
               .limit = 0.1,
               .learning_rate = 0.05,
               .proportional_gain = proportional});
    double collisions = 0.6, largest = 0.0;
    for (int i = 1; i <= 2000; ++i) {
      f.constraint.Observe(collisions, 10);
      largest = std::max(largest, f.constraint.multiplier());
      // The policy follows slowly: with lambda it collides 0.6 / (1 + lambda) times in the end.
      collisions += 0.05 * (0.6 / (1.0 + f.constraint.multiplier()) - collisions);
    }
    EXPECT_NEAR(f.constraint.multiplier(), 5.0, 0.05);
    EXPECT_NEAR(collisions, 0.1, 1e-3);
    return largest - 5.0;
  };
  const double integral_alone = overshoot(0.0);
  EXPECT_GT(integral_alone, 0.5);
  EXPECT_LT(overshoot(5.0), 0.5 * integral_alone);
}

TEST(Constraint, AFixedMultiplierStays) {
  Fixture f({.kind = ConstraintKind::kFixed, .multiplier = 2.0});
  f.constraint.Observe(0.9, 100);
  EXPECT_EQ(f.constraint.multiplier(), 2.0);
  LearnerStats stats;
  f.constraint.Describe(stats);
  EXPECT_DOUBLE_EQ(stats.constraint_violation, 0.8);
}

TEST(Constraint, TheMultiplierWaitsForItsFirstEpisodes) {
  Fixture f({.kind = ConstraintKind::kLagrangian,
             .limit = 0.0,
             .learning_rate = 0.01,
             .learning_starts = 25});
  f.constraint.Observe(1.0, 10);
  f.constraint.Observe(1.0, 10);
  EXPECT_EQ(f.constraint.multiplier(), 0.0);
  f.constraint.Observe(1.0, 10);
  EXPECT_DOUBLE_EQ(f.constraint.multiplier(), 0.1);
}

}  // namespace
}  // namespace slalom::learner
