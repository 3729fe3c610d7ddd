#include "sim/courses/foresight.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "sim/courses/motion.h"

namespace slalom::sim {
namespace {

constexpr double kForesightCell = 0.2;  // [m]
constexpr int kWordBits = 64;

/// A set of cells, one bit each. Rows run along x.
class CellSet {
 public:
  CellSet(int num_rows, int num_cols)
      : num_rows_(num_rows),
        num_cols_(num_cols),
        num_words_((num_cols + kWordBits - 1) / kWordBits),
        words_(static_cast<std::size_t>(num_rows) * static_cast<std::size_t>(num_words_), 0) {}

  int num_rows() const { return num_rows_; }
  int num_cols() const { return num_cols_; }
  bool Holds(int row, int col) const {
    return (Word(row, col / kWordBits) >> (col % kWordBits) & 1u) != 0;
  }
  void Add(int row, int col) {
    Word(row, col / kWordBits) |= std::uint64_t{1} << (col % kWordBits);
  }

  /// Adds cells [first, last] of a row as far as there are such cells.
  void AddRun(int row, int first, int last) {
    if (row < 0 || row >= num_rows_) return;
    first = std::max(first, 0);
    last = std::min(last, num_cols_ - 1);
    for (int word = first / kWordBits; word <= last / kWordBits && first <= last; ++word) {
      const int low = std::max(first - word * kWordBits, 0);
      const int high = std::min(last - word * kWordBits, kWordBits - 1);
      Word(row, word) |= (~std::uint64_t{0} >> (kWordBits - 1 - (high - low))) << low;
    }
  }

  /// Sets this to the cells of `from` and their four neighbours each, without those of `blocked`.
  /// Returns whether any is left.
  bool SpreadFrom(const CellSet& from, const CellSet& blocked) {
    std::uint64_t any = 0;
    for (int row = 0; row < num_rows_; ++row) {
      for (int word = 0; word < num_words_; ++word) {
        const std::uint64_t here = from.Word(row, word);
        std::uint64_t next = here | here << 1 | here >> 1;
        if (word > 0) next |= from.Word(row, word - 1) >> (kWordBits - 1);
        if (word + 1 < num_words_) next |= from.Word(row, word + 1) << (kWordBits - 1);
        if (row > 0) next |= from.Word(row - 1, word);
        if (row + 1 < num_rows_) next |= from.Word(row + 1, word);
        if (word + 1 == num_words_)
          next &= ~std::uint64_t{0} >> (kWordBits * num_words_ - num_cols_);
        Word(row, word) = next & ~blocked.Word(row, word);
        any |= Word(row, word);
      }
    }
    return any != 0;
  }

 private:
  std::uint64_t& Word(int row, int word) { return words_[Index(row, word)]; }
  const std::uint64_t& Word(int row, int word) const { return words_[Index(row, word)]; }
  std::size_t Index(int row, int word) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(num_words_) +
           static_cast<std::size_t>(word);
  }

  int num_rows_;
  int num_cols_;
  int num_words_;
  std::vector<std::uint64_t> words_;  // [num_rows, num_words]
};

}  // namespace

/// The cells of a course, and the ones that are nearer to an obstacle than the disc's radius.
class Foresight::DiscField {
 public:
  DiscField(const Course& course, double radius)
      : radius_(radius),
        start_col_(CellsFrom(course.bounds.min_W.x, course.start.p.x)),
        start_row_(CellsFrom(course.bounds.min_W.y, course.start.p.y)),
        origin_W_(course.start.p -
                  kForesightCell * base::Vec2{double(start_col_), double(start_row_)}),
        fixed_(start_row_ + CellsFrom(course.start.p.y, course.bounds.max_W.y) + 1,
               start_col_ + CellsFrom(course.start.p.x, course.bounds.max_W.x) + 1) {
    for (const Circle& circle : course.circles) Block(circle, fixed_);
    for (const Box& box : course.boxes) Block(box, fixed_);
    const base::Vec2 goal = CellCoordinates(course.goal_W);
    goal_col_ = std::min(static_cast<int>(std::lround(goal.x)), fixed_.num_cols() - 1);
    goal_row_ = std::min(static_cast<int>(std::lround(goal.y)), fixed_.num_rows() - 1);
    for (const MovingObstacle& obstacle : course.moving) {
      moving_.push_back({Motion(obstacle), obstacle.radius, obstacle.half_size});
    }
  }

  CellSet Start() const {
    CellSet start(fixed_.num_rows(), fixed_.num_cols());
    start.Add(start_row_, start_col_);
    return start;
  }

  bool HasStart(const CellSet& cells) const { return cells.Holds(start_row_, start_col_); }
  /// Whether `cells` has the cell nearest to the goal.
  bool HasGoal(const CellSet& cells) const { return cells.Holds(goal_row_, goal_col_); }

  CellSet BlockedAt(double motion_time) const {
    CellSet blocked = fixed_;
    for (const Mover& mover : moving_) {
      const base::Pose2 X_WB = mover.motion.At(motion_time).X_WB;
      if (mover.radius > 0.0) {
        Block(Circle{X_WB.p, mover.radius}, blocked);
      } else {
        Block(Box{X_WB, mover.half_size}, blocked);
      }
    }
    return blocked;
  }

 private:
  struct Mover {
    Motion motion;
    double radius;
    base::Vec2 half_size;
  };

  static int CellsFrom(double low, double high) {
    return static_cast<int>((high - low) / kForesightCell);
  }

  base::Vec2 CellCoordinates(base::Vec2 p_W) const {
    return (1.0 / kForesightCell) * (p_W - origin_W_);
  }

  void Block(const Circle& circle, CellSet& cells) const {
    const base::Vec2 at = CellCoordinates(circle.p_W);
    const double reach = (circle.radius + radius_) / kForesightCell;
    const int last = static_cast<int>(std::floor(at.y + reach));
    for (int row = static_cast<int>(std::ceil(at.y - reach)); row <= last; ++row) {
      const double dy = row - at.y;
      const double half = std::sqrt(std::max(0.0, reach * reach - dy * dy));
      cells.AddRun(row, static_cast<int>(std::ceil(at.x - half)),
                   static_cast<int>(std::floor(at.x + half)));
    }
  }

  void Block(const Box& box, CellSet& cells) const {
    const Bounds extent = Including({box.X_WB.p, box.X_WB.p}, box);
    const base::Vec2 reach{radius_, radius_};
    const base::Vec2 low = CellCoordinates(extent.min_W - reach);
    const base::Vec2 high = CellCoordinates(extent.max_W + reach);
    const int last_row = std::min(static_cast<int>(high.y), cells.num_rows() - 1);
    const int last_col = std::min(static_cast<int>(high.x), cells.num_cols() - 1);
    const auto [s, c] = base::SinCos(box.X_WB.yaw);
    for (int row = std::max(0, static_cast<int>(std::ceil(low.y))); row <= last_row; ++row) {
      for (int col = std::max(0, static_cast<int>(std::ceil(low.x))); col <= last_col; ++col) {
        const base::Vec2 d =
            origin_W_ + kForesightCell * base::Vec2{double(col), double(row)} - box.X_WB.p;
        const double x = std::max(0.0, std::abs(c * d.x + s * d.y) - box.half_size.x);
        const double y = std::max(0.0, std::abs(c * d.y - s * d.x) - box.half_size.y);
        if (x * x + y * y <= radius_ * radius_) cells.Add(row, col);
      }
    }
  }

  double radius_;
  int start_col_;
  int start_row_;
  int goal_col_ = 0;
  int goal_row_ = 0;
  base::Vec2 origin_W_;  // Centre of the first cell.
  CellSet fixed_;
  std::vector<Mover> moving_;
};

Foresight::Foresight(const Course& course, const ForesightConfig& config)
    : config_(config), field_(std::make_unique<const DiscField>(course, config.radius)) {}

Foresight::~Foresight() = default;

bool Foresight::IsStartClear(double motion_time) const {
  return !field_->HasStart(field_->BlockedAt(motion_time));
}

std::optional<double> Foresight::EarliestArrival(double motion_time) const {
  const double step = kForesightCell / config_.speed;
  const int num_steps = static_cast<int>(config_.limit / step);
  CellSet reached = field_->Start();
  CellSet next = reached;
  for (int i = 0; i <= num_steps; ++i) {
    if (field_->HasGoal(reached)) return i * step;
    if (!next.SpreadFrom(reached, field_->BlockedAt(motion_time + (i + 1) * step))) break;
    std::swap(reached, next);
  }
  return std::nullopt;
}

}  // namespace slalom::sim
