#include "sim/courses/course_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <queue>

#include "base/check.h"

namespace slalom::sim {
namespace {

// In angular order, so that a turn of 45 degrees is a step of one.
constexpr std::array<Cell, 8> kMoves = {
    {{0, 1}, {1, 1}, {1, 0}, {1, -1}, {0, -1}, {-1, -1}, {-1, 0}, {-1, 1}}};
constexpr int kNumMoves = static_cast<int>(kMoves.size());
constexpr double kNearness = 2.0;      // [cells]
constexpr double kNearnessCost = 5.0;  // [cells^2]

/// A cell and the move that led there.
struct State {
  Cell cell;
  int move = 0;
};

struct Candidate {
  double cost = 0.0;  // So far, plus the straight line to the exit.
  int state = 0;

  // For a queue with the smallest on top; equal costs in the order of the states.
  friend bool operator<(const Candidate& a, const Candidate& b) {
    return a.cost != b.cost ? a.cost > b.cost : a.state > b.state;
  }
};

double Length(int rows, int cols) {
  return std::sqrt(static_cast<double>(rows * rows + cols * cols));
}

double NearnessCost(const PathGrid& blocked, Cell cell) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int rows = -2; rows <= 2; ++rows) {
    for (int cols = -2; cols <= 2; ++cols) {
      const Cell other{cell.row + rows, cell.col + cols};
      if (blocked.Holds(other) && blocked.blocked(other))
        nearest = std::min(nearest, Length(rows, cols));
    }
  }
  return nearest <= kNearness ? kNearnessCost / nearest : 0.0;
}

bool MayMove(const PathGrid& blocked, Cell from, int move) {
  const Cell step = kMoves[static_cast<std::size_t>(move)];
  const Cell to{from.row + step.row, from.col + step.col};
  if (!blocked.Holds(to) || blocked.blocked(to)) return false;
  const bool is_diagonal = step.row != 0 && step.col != 0;
  return !(is_diagonal && blocked.blocked({to.row, from.col}) &&
           blocked.blocked({from.row, to.col}));
}

/// A* over states; `FindPath` describes the path.
class PathSearch {
 public:
  PathSearch(const PathGrid& blocked, Cell exit)
      : blocked_(blocked),
        exit_(exit),
        costs_(NumStates(blocked), std::numeric_limits<double>::infinity()),
        parents_(NumStates(blocked), -1) {}

  std::optional<std::vector<Cell>> Run(Cell entry) {
    if (entry == exit_) return std::vector<Cell>{entry};
    for (int move = 0; move < kNumMoves; ++move) Reach(entry, move, 0.0, -1);
    while (!queue_.empty()) {
      const Candidate candidate = queue_.top();
      queue_.pop();
      const State state = StateOf(candidate.state);
      const double cost = costs_[static_cast<std::size_t>(candidate.state)];
      if (candidate.cost > cost + DistanceToExit(state.cell)) continue;
      if (state.cell == exit_) return Trace(entry, candidate.state);
      for (int turn = -1; turn <= 1; ++turn) {
        Reach(state.cell, (state.move + turn + kNumMoves) % kNumMoves, cost, candidate.state);
      }
    }
    return std::nullopt;
  }

 private:
  static std::size_t NumStates(const PathGrid& grid) {
    return static_cast<std::size_t>(grid.num_rows()) * static_cast<std::size_t>(grid.num_cols()) *
           kNumMoves;
  }

  int IndexOf(const State& state) const {
    return (state.cell.row * blocked_.num_cols() + state.cell.col) * kNumMoves + state.move;
  }

  State StateOf(int index) const {
    const int cell = index / kNumMoves;
    return {{cell / blocked_.num_cols(), cell % blocked_.num_cols()}, index % kNumMoves};
  }

  double DistanceToExit(Cell cell) const {
    return Length(cell.row - exit_.row, cell.col - exit_.col);
  }

  void Reach(Cell from, int move, double cost, int parent) {
    if (!MayMove(blocked_, from, move)) return;
    const Cell step = kMoves[static_cast<std::size_t>(move)];
    const State to{{from.row + step.row, from.col + step.col}, move};
    cost += Length(step.row, step.col) + NearnessCost(blocked_, to.cell);
    const auto index = static_cast<std::size_t>(IndexOf(to));
    if (cost >= costs_[index]) return;
    costs_[index] = cost;
    parents_[index] = parent;
    queue_.push({cost + DistanceToExit(to.cell), IndexOf(to)});
  }

  std::vector<Cell> Trace(Cell entry, int state) const {
    std::vector<Cell> path;
    for (; state >= 0; state = parents_[static_cast<std::size_t>(state)]) {
      path.push_back(StateOf(state).cell);
    }
    path.push_back(entry);
    std::reverse(path.begin(), path.end());
    return path;
  }

  const PathGrid& blocked_;
  const Cell exit_;
  std::vector<double> costs_;  // [number of states] of the cheapest way known.
  std::vector<int> parents_;   // [number of states] state before; -1: the entry.
  std::priority_queue<Candidate> queue_;
};

}  // namespace

PathGrid::PathGrid(int num_rows, int num_cols)
    : num_rows_(num_rows),
      num_cols_(num_cols),
      blocked_(static_cast<std::size_t>(num_rows) * static_cast<std::size_t>(num_cols), 0) {
  SLALOM_CHECK(num_rows > 0 && num_cols > 0);
}

PathGrid::PathGrid(const FieldGrid& blocked) : PathGrid(kFieldSize, kFieldSize) {
  for (int row = 0; row < kFieldSize; ++row) {
    for (int col = 0; col < kFieldSize; ++col) {
      if (blocked.filled({row, col})) Block({row, col});
    }
  }
}

std::optional<std::vector<Cell>> FindPath(const PathGrid& blocked, Cell entry, Cell exit) {
  SLALOM_CHECK(blocked.Holds(entry) && !blocked.blocked(entry));
  SLALOM_CHECK(blocked.Holds(exit) && !blocked.blocked(exit));
  return PathSearch(blocked, exit).Run(entry);
}

std::optional<std::vector<Cell>> FindPath(const FieldGrid& blocked, Cell entry, Cell exit) {
  return FindPath(PathGrid(blocked), entry, exit);
}

}  // namespace slalom::sim
