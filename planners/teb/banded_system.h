#pragma once

#include <Eigen/Core>

namespace slalom::planners {

/// A symmetric positive definite system H x = g in which H couples only unknowns at most
/// `kBandwidth` places apart, as in a timed band (three poses and the two times between them are 11
/// unknowns). A value; allocates when the size grows.
///
/// H is a band of columns, and its factor has no entry outside the band. So there is nothing to
/// order or analyse, and sizes are known to the compiler: a band of 20 poses is solved in 2.5 us.
/// Eigen's own solvers take longer on the same system: SimplicialLDLT 5.6 us with the unknowns in
/// this order and 6.8 us in its own, without the analysis of the pattern and the assembly of a
/// sparse matrix, and dense LDLT 18 us (benchmarks/banded_system_bench.cc).
class BandedSystem {
 public:
  static constexpr int kBandwidth = 10;

  /// Sets H and g to zero, with `size` unknowns.
  void Clear(int size);

  int size() const { return static_cast<int>(g_.size()); }

  /// Adds weight * J J^T to H and -weight * error * J to g: the Gauss-Newton terms of
  /// weight * error^2. J is `gradient`, the derivatives with respect to unknowns first, first + 1,
  /// ... Requires: within the system.
  template <int N>
  void AddError(int first, const Eigen::Matrix<double, N, 1>& gradient, double error,
                double weight) {
    static_assert(N <= kBandwidth + 1);
    const Eigen::Matrix<double, N, 1> weighted = weight * gradient;
    Block<N>(band_, first).template triangularView<Eigen::Lower>() +=
        weighted.lazyProduct(gradient.transpose());
    g_.template segment<N>(first) -= error * weighted;
  }

  /// Holds unknown i at 0: its row and column become the identity's.
  void Fix(int i);

  double MaxDiagonal() const { return band_.row(0).maxCoeff(); }
  double gradient(int i) const { return g_[i]; }

  /// Solves (H + damping * I) x = g. Returns false if the matrix is not positive definite.
  [[nodiscard]] bool Solve(double damping, Eigen::VectorXd& x);

 private:
  // Column j holds H(j, j) to H(j + kBandwidth, j). Zeros follow the last unknown.
  using Band = Eigen::Matrix<double, kBandwidth + 1, Eigen::Dynamic>;

  // The square of `band` that begins at (first, first), of which the lower triangle exists: a step
  // to the right is a step of one column less one row.
  template <int N>
  static auto Block(Band& band, int first) {
    return Eigen::Map<Eigen::Matrix<double, N, N>, Eigen::Unaligned,
                      Eigen::OuterStride<kBandwidth>>(band.col(first).data());
  }

  Band band_;
  Band factor_;
  Eigen::VectorXd g_;
  Eigen::VectorXd solution_;  // With zeros behind.
};

}  // namespace slalom::planners
