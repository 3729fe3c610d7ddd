#include <benchmark/benchmark.h>

#include <Eigen/Dense>
#include <Eigen/Sparse>

#include "base/check.h"
#include "base/random.h"
#include "planners/teb/banded_system.h"

/// Time to solve the linear system of a timed band, by `BandedSystem` and by Eigen's solvers, which
/// get their matrix assembled. Argument: poses of the band.

namespace slalom::planners {
namespace {

constexpr double kDamping = 0.3;

/// The same system in two ways.
struct Problem {
  BandedSystem banded;
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
};

/// Four errors for each three neighbouring poses; the first and the last pose are held.
Problem MakeProblem(int num_poses) {
  const int size = 4 * num_poses - 1;
  Problem problem{{}, Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  problem.banded.Clear(size);
  base::Random random(1);
  for (int i = 0; i < 4 * (num_poses - 2); ++i) {
    const int first = i / 4 * 4;
    Eigen::Matrix<double, 11, 1> J;
    for (double& slope : J) slope = random.Normal();
    const double error = random.Normal();
    problem.banded.AddError<11>(first, J, error, 1.0);
    problem.H.block<11, 11>(first, first) += J * J.transpose();
    problem.g.segment<11>(first) -= error * J;
  }
  for (const int i : {0, 1, 2, size - 3, size - 2, size - 1}) {
    problem.banded.Fix(i);
    problem.H.row(i).setZero();
    problem.H.col(i).setZero();
    problem.H(i, i) = 1.0;
    problem.g[i] = 0.0;
  }
  return problem;
}

void BM_BandedSystem(benchmark::State& state) {
  Problem problem = MakeProblem(static_cast<int>(state.range(0)));
  Eigen::VectorXd x;
  for (auto _ : state) {
    SLALOM_CHECK(problem.banded.Solve(kDamping, x));
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(BM_BandedSystem)->Arg(10)->Arg(20)->Arg(40);

template <class Ordering>
void BM_SimplicialLdlt(benchmark::State& state) {
  const Problem problem = MakeProblem(static_cast<int>(state.range(0)));
  const Eigen::SparseMatrix<double> H = problem.H.sparseView();
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Ordering> solver;
  solver.setShift(kDamping);
  solver.analyzePattern(H);
  Eigen::VectorXd x;
  for (auto _ : state) {
    solver.factorize(H);
    x = solver.solve(problem.g);
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(BM_SimplicialLdlt<Eigen::NaturalOrdering<int>>)->Arg(10)->Arg(20)->Arg(40);
BENCHMARK(BM_SimplicialLdlt<Eigen::AMDOrdering<int>>)->Arg(10)->Arg(20)->Arg(40);

void BM_DenseLdlt(benchmark::State& state) {
  const Problem problem = MakeProblem(static_cast<int>(state.range(0)));
  Eigen::LDLT<Eigen::MatrixXd> solver(problem.H.rows());
  Eigen::MatrixXd damped;
  Eigen::VectorXd x;
  for (auto _ : state) {
    damped = problem.H;
    damped.diagonal().array() += kDamping;
    solver.compute(damped);
    x = solver.solve(problem.g);
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(BM_DenseLdlt)->Arg(10)->Arg(20)->Arg(40);

}  // namespace
}  // namespace slalom::planners
