#include "planners/navigation/clearance_map.h"

#include "base/check.h"
#include "base/vector_clones.h"

namespace slalom::planners {
namespace {

/// nearest[i] = min(nearest[i], row[i] + dy_squared).
SLALOM_VECTOR_CLONES
void TakeNearer(const float* row, float dy_squared, int size, float* nearest) {
  for (int i = 0; i < size; ++i) {
    const float candidate = row[i] + dy_squared;
    nearest[i] = candidate < nearest[i] ? candidate : nearest[i];
  }
}

/// Takes square roots, in metres, and limits them to `max_distance`.
SLALOM_VECTOR_CLONES
void ToMetres(float* squared_cells, int size, float resolution, float max_distance) {
  for (int i = 0; i < size; ++i) {
    const float distance = std::sqrt(squared_cells[i]) * resolution;
    squared_cells[i] = distance < max_distance ? distance : max_distance;
  }
}

}  // namespace

ClearanceMap::ClearanceMap(double max_distance) : max_distance_(static_cast<float>(max_distance)) {
  SLALOM_CHECK(max_distance > 0.0);
}

void ClearanceMap::Update(const Costmap& costmap, base::Vec2 p_OL) {
  size_x_ = costmap.size_x();
  size_y_ = costmap.size_y();
  width_ = static_cast<float>(size_x_);
  height_ = static_cast<float>(size_y_);
  resolution_ = static_cast<float>(costmap.resolution());
  cells_per_metre_ = static_cast<float>(1.0 / costmap.resolution());
  origin_x_ = static_cast<float>(costmap.origin().x - p_OL.x);
  origin_y_ = static_cast<float>(costmap.origin().y - p_OL.y);
  reach_ = static_cast<int>(std::ceil(max_distance_ * cells_per_metre_));
  MeasureRows(costmap);
  CombineColumns();
}

void ClearanceMap::MeasureRows(const Costmap& costmap) {
  row_distances_.resize(costmap.costs().size());
  const int far = reach_ + 1;
  for (int y = 0; y < size_y_; ++y) {
    const std::uint8_t* const costs = &costmap.costs()[costmap.Index({0, y})];
    float* const row = &row_distances_[costmap.Index({0, y})];
    int since = far;
    for (int x = 0; x < size_x_; ++x) {
      since = costs[x] == kLethalCost ? 0 : std::min(since + 1, far);
      row[x] = static_cast<float>(since);
    }
    since = far;
    for (int x = size_x_ - 1; x >= 0; --x) {
      since = costs[x] == kLethalCost ? 0 : std::min(since + 1, far);
      const float nearer = std::min(row[x], static_cast<float>(since));
      row[x] = nearer * nearer;
    }
  }
}

void ClearanceMap::CombineColumns() {
  distances_ = row_distances_;
  const auto row_of = [this](std::vector<float>& rows, int y) {
    return rows.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(size_x_);
  };
  for (int y = 0; y < size_y_; ++y) {
    float* const nearest = row_of(distances_, y);
    const int last = std::min(y + reach_, size_y_ - 1);
    for (int other = std::max(y - reach_, 0); other <= last; ++other) {
      const auto dy = static_cast<float>(other - y);
      TakeNearer(row_of(row_distances_, other), dy * dy, size_x_, nearest);
    }
    ToMetres(nearest, size_x_, resolution_, max_distance_);
  }
}

DiscOutline::DiscOutline(double length, double width) {
  SLALOM_CHECK(length > 0.0 && width > 0.0);
  const double cell_x = length / 3.0, cell_y = width / 3.0;
  const double radius = 0.5 * std::sqrt(cell_x * cell_x + cell_y * cell_y);
  disc_radius_ = static_cast<float>(radius);
  inscribed_radius_ = static_cast<float>(0.5 * std::min(length, width));
  circumscribed_radius_ = static_cast<float>(std::sqrt(cell_x * cell_x + cell_y * cell_y) + radius);
  int next = 0;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      if (i == 0 && j == 0) continue;
      discs_[next++] = {static_cast<float>(i * cell_x), static_cast<float>(j * cell_y)};
    }
  }
}

}  // namespace slalom::planners
