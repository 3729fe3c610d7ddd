#include "planners/teb/banded_system.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::planners {

void BandedSystem::Clear(int size) {
  size_ = size;
  rows_.assign(static_cast<std::size_t>(size), Row{});
  factor_.resize(static_cast<std::size_t>(size));
  g_.assign(static_cast<std::size_t>(size), 0.0);
}

void BandedSystem::AddError(int first, std::span<const double> gradient, double error,
                            double weight) {
  const int count = static_cast<int>(gradient.size());
  SLALOM_CHECK(count <= kBandwidth + 1 && first >= 0 && first + count <= size_);
  for (int i = 0; i < count; ++i) {
    const double weighted = weight * gradient[i];
    Row& row = rows_[first + i];
    for (int j = 0; j <= i; ++j) row[kBandwidth - i + j] += weighted * gradient[j];
    g_[first + i] -= weighted * error;
  }
}

void BandedSystem::Fix(int i) {
  rows_[i].fill(0.0);
  rows_[i][kBandwidth] = 1.0;
  for (int j = i + 1; j < std::min(i + kBandwidth + 1, size_); ++j) {
    rows_[j][kBandwidth - (j - i)] = 0.0;
  }
  g_[i] = 0.0;
}

double BandedSystem::MaxDiagonal() const {
  double largest = 0.0;
  for (const Row& row : rows_) largest = std::max(largest, row[kBandwidth]);
  return largest;
}

bool BandedSystem::Solve(double damping, std::vector<double>& x) {
  // Cholesky: L L^T = H + damping * I, row by row, within the band.
  for (int i = 0; i < size_; ++i) {
    const int left = std::max(0, i - kBandwidth);
    Row& row = factor_[i];
    for (int j = left; j <= i; ++j) {
      double sum = rows_[i][kBandwidth - i + j] + (i == j ? damping : 0.0);
      const Row& other = factor_[j];
      for (int k = std::max(left, j - kBandwidth); k < j; ++k) {
        sum -= row[kBandwidth - i + k] * other[kBandwidth - j + k];
      }
      if (i != j) {
        row[kBandwidth - i + j] = sum / other[kBandwidth];
      } else {
        if (!(sum > 0.0)) return false;
        row[kBandwidth] = std::sqrt(sum);
      }
    }
  }
  x = g_;
  for (int i = 0; i < size_; ++i) {
    for (int j = std::max(0, i - kBandwidth); j < i; ++j) {
      x[i] -= factor_[i][kBandwidth - i + j] * x[j];
    }
    x[i] /= factor_[i][kBandwidth];
  }
  for (int i = size_ - 1; i >= 0; --i) {
    x[i] /= factor_[i][kBandwidth];
    for (int j = std::max(0, i - kBandwidth); j < i; ++j) {
      x[j] -= factor_[i][kBandwidth - i + j] * x[i];
    }
  }
  return true;
}

}  // namespace slalom::planners
