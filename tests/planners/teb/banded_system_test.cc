#include "planners/teb/banded_system.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "base/random.h"

namespace slalom::planners {
namespace {

/// Adds an error with any number of derivatives.
template <int N = 1>
void AddError(int first, const Eigen::VectorXd& gradient, double error, double weight,
              BandedSystem& system) {
  if (gradient.size() == N) {
    system.AddError<N>(first, gradient, error, weight);
  } else if constexpr (N < BandedSystem::kBandwidth + 1) {
    AddError<N + 1>(first, gradient, error, weight, system);
  }
}

TEST(BandedSystem, SolvesAsADenseSolverDoes) {
  base::Random random(1);
  for (const int size : {1, 4, 11, 12, 43, 99}) {
    BandedSystem system;
    system.Clear(size);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(size);
    for (int e = 0; e < 4 * size; ++e) {
      const int count = 1 + static_cast<int>(random.UniformInt(std::min(size, 11)));
      const int first = static_cast<int>(random.UniformInt(size - count + 1));
      Eigen::VectorXd J = Eigen::VectorXd::Zero(size);
      for (double& slope : J.segment(first, count)) slope = random.Normal();
      const double error = random.Normal(), weight = random.Uniform(0.1, 50.0);
      AddError(first, J.segment(first, count), error, weight, system);
      H += weight * J * J.transpose();
      g -= weight * error * J;
    }
    if (size > 12) {
      for (const int fixed : {0, 7, size - 1}) {
        system.Fix(fixed);
        H.row(fixed).setZero();
        H.col(fixed).setZero();
        H(fixed, fixed) = 1.0;
        g[fixed] = 0.0;
      }
    }
    EXPECT_NEAR(system.MaxDiagonal(), H.diagonal().maxCoeff(), 1e-9);
    Eigen::VectorXd x;
    ASSERT_TRUE(system.Solve(0.3, x));
    const Eigen::VectorXd exact = (H + 0.3 * Eigen::MatrixXd::Identity(size, size)).ldlt().solve(g);
    for (int i = 0; i < size; ++i) EXPECT_NEAR(x[i], exact[i], 1e-8) << size << " " << i;
  }
}

TEST(BandedSystem, SaysWhereThereIsNoSolution) {
  BandedSystem system;
  system.Clear(3);
  system.AddError<2>(0, {1.0, 1.0}, 1.0, 1.0);  // Unknown 2 is free.
  Eigen::VectorXd x;
  EXPECT_FALSE(system.Solve(0.0, x));
  EXPECT_TRUE(system.Solve(1e-3, x));
}

}  // namespace
}  // namespace slalom::planners
