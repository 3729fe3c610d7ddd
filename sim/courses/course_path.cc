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
constexpr int kNumStates = kFieldSize * kFieldSize * kNumMoves;
constexpr double kNearness = 2.0;      // [cells]
constexpr double kNearnessCost = 5.0;  // [cells^2]

/// A cell and the move that led there.
struct State {
  Cell cell;
  int move = 0;

  int index() const { return (cell.row * kFieldSize + cell.col) * kNumMoves + move; }
};

State StateOf(int index) {
  const int cell = index / kNumMoves;
  return {{cell / kFieldSize, cell % kFieldSize}, index % kNumMoves};
}

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

double NearnessCost(const FieldGrid& blocked, Cell cell) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int rows = -2; rows <= 2; ++rows) {
    for (int cols = -2; cols <= 2; ++cols) {
      const Cell other{cell.row + rows, cell.col + cols};
      if (IsInField(other) && blocked.filled(other))
        nearest = std::min(nearest, Length(rows, cols));
    }
  }
  return nearest <= kNearness ? kNearnessCost / nearest : 0.0;
}

bool MayMove(const FieldGrid& blocked, Cell from, int move) {
  const Cell step = kMoves[static_cast<std::size_t>(move)];
  const Cell to{from.row + step.row, from.col + step.col};
  if (!IsInField(to) || blocked.filled(to)) return false;
  const bool is_diagonal = step.row != 0 && step.col != 0;
  return !(is_diagonal && blocked.filled({to.row, from.col}) && blocked.filled({from.row, to.col}));
}

/// A* over states; `FindPath` describes the path.
class PathSearch {
 public:
  PathSearch(const FieldGrid& blocked, Cell exit)
      : blocked_(blocked),
        exit_(exit),
        costs_(kNumStates, std::numeric_limits<double>::infinity()),
        parents_(kNumStates, -1) {}

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
  double DistanceToExit(Cell cell) const {
    return Length(cell.row - exit_.row, cell.col - exit_.col);
  }

  void Reach(Cell from, int move, double cost, int parent) {
    if (!MayMove(blocked_, from, move)) return;
    const Cell step = kMoves[static_cast<std::size_t>(move)];
    const State to{{from.row + step.row, from.col + step.col}, move};
    cost += Length(step.row, step.col) + NearnessCost(blocked_, to.cell);
    const auto index = static_cast<std::size_t>(to.index());
    if (cost >= costs_[index]) return;
    costs_[index] = cost;
    parents_[index] = parent;
    queue_.push({cost + DistanceToExit(to.cell), to.index()});
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

  const FieldGrid& blocked_;
  const Cell exit_;
  std::vector<double> costs_;  // [kNumStates] of the cheapest way known.
  std::vector<int> parents_;   // [kNumStates] state before; -1: the entry.
  std::priority_queue<Candidate> queue_;
};

}  // namespace

std::optional<std::vector<Cell>> FindPath(const FieldGrid& blocked, Cell entry, Cell exit) {
  SLALOM_CHECK(IsInField(entry) && !blocked.filled(entry));
  SLALOM_CHECK(IsInField(exit) && !blocked.filled(exit));
  return PathSearch(blocked, exit).Run(entry);
}

}  // namespace slalom::sim
