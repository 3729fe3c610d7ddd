#include "planners/teb/banded_system.h"

#include <algorithm>
#include <cmath>

namespace slalom::planners {

void BandedSystem::Clear(int size) {
  band_.setZero(kBandwidth + 1, size + kBandwidth);
  g_.setZero(size);
}

void BandedSystem::Fix(int i) {
  band_.col(i).setZero();
  band_(0, i) = 1.0;
  for (int j = std::max(0, i - kBandwidth); j < i; ++j) band_(i - j, j) = 0.0;
  g_[i] = 0.0;
}

bool BandedSystem::Solve(double damping, Eigen::VectorXd& x) {
  // Cholesky, L L^T = H + damping * I, column by column, and L y = g along with it.
  factor_ = band_;
  factor_.row(0).head(size()).array() += damping;
  solution_.setZero(size() + kBandwidth);
  solution_.head(size()) = g_;
  for (int i = 0; i < size(); ++i) {
    double& diagonal = factor_(0, i);
    if (!(diagonal > 0.0)) return false;
    diagonal = std::sqrt(diagonal);
    const Eigen::Matrix<double, kBandwidth, 1> below = factor_.col(i).tail<kBandwidth>() /=
        diagonal;
    Block<kBandwidth>(factor_, i + 1).triangularView<Eigen::Lower>() -=
        below.lazyProduct(below.transpose());
    solution_[i] /= diagonal;
    solution_.segment<kBandwidth>(i + 1) -= solution_[i] * below;
  }
  // L^T x = y.
  for (int i = size() - 1; i >= 0; --i) {
    solution_[i] /= factor_(0, i);
    for (int j = std::max(0, i - kBandwidth); j < i; ++j) {
      solution_[j] -= factor_(i - j, j) * solution_[i];
    }
  }
  x = solution_.head(size());
  return true;
}

}  // namespace slalom::planners
