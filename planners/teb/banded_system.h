#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace slalom::planners {

/// A symmetric positive definite system H x = g in which H couples only unknowns at most
/// `kBandwidth` places apart, as in a timed band (three poses and the two times between them are 11
/// unknowns).
///
/// It has its own Cholesky factorisation instead of Eigen's SimplicialLDLT: with the unknowns in
/// the band's order, the factor has no fill-in beyond the band, so there is nothing to order or
/// analyse, and a band of 20 poses is solved in 5 us. A value; allocates when the size grows.
class BandedSystem {
 public:
  static constexpr int kBandwidth = 10;

  /// Sets H and g to zero, with `size` unknowns.
  void Clear(int size);

  int size() const { return size_; }

  /// Adds weight * J^T J to H and -weight * error * J^T to g: the Gauss-Newton terms of
  /// weight * error^2. J is `gradient`, the derivatives with respect to unknowns first, first + 1,
  /// ... Requires: gradient.size() <= kBandwidth + 1, within the system.
  void AddError(int first, std::span<const double> gradient, double error, double weight);

  /// Holds unknown i at 0: its row and column become those of the identity.
  void Fix(int i);

  double MaxDiagonal() const;
  double gradient(int i) const { return g_[i]; }

  /// Solves (H + damping * I) x = g. Returns false if the matrix is not positive definite.
  [[nodiscard]] bool Solve(double damping, std::vector<double>& x);

 private:
  // Row i holds H(i, i - kBandwidth) to H(i, i), [size, kBandwidth + 1].
  using Row = std::array<double, kBandwidth + 1>;

  int size_ = 0;
  std::vector<Row> rows_;
  std::vector<Row> factor_;
  std::vector<double> g_;
};

}  // namespace slalom::planners
