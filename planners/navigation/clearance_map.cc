#include "planners/navigation/clearance_map.h"

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/check.h"
#include "base/vector_clones.h"

namespace slalom::planners {
namespace {

/// nearest[i] = min(nearest[i], row[i]), for each row of a stamp. Rows of the stamp are
/// `stamp_stride` apart, those of the map `stride`.
SLALOM_VECTOR_CLONES
void TakeNearer(const float* stamp, int stamp_stride, int width, int height, int stride,
                float* nearest) {
  for (int y = 0; y < height; ++y, stamp += stamp_stride, nearest += stride) {
    for (int x = 0; x < width; ++x) nearest[x] = stamp[x] < nearest[x] ? stamp[x] : nearest[x];
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
  origin_x_ = static_cast<float>(costmap.origin().x - p_OL.x);
  origin_y_ = static_cast<float>(costmap.origin().y - p_OL.y);
  cells_per_metre_ = static_cast<float>(1.0 / costmap.resolution());
  if (stamp_.empty() || resolution_ != static_cast<float>(costmap.resolution())) {
    resolution_ = static_cast<float>(costmap.resolution());
    MakeStamp();
  }
  distances_.assign(costmap.costs().size(), max_distance_);
  const std::uint8_t* const costs = costmap.costs().data();
  const std::uint8_t* const end = costs + costmap.costs().size();
  const std::uint8_t* next = costs;
  while (next < end && (next = static_cast<const std::uint8_t*>(std::memchr(
                            next, kLethalCost, static_cast<std::size_t>(end - next)))) != nullptr) {
    const int n = static_cast<int>(next - costs), y = n / size_x_;
    Stamp({n - y * size_x_, y});
    ++next;
  }
}

/// Computes the distances of the cells around a lethal one.
void ClearanceMap::MakeStamp() {
  reach_ = static_cast<int>(std::ceil(max_distance_ * cells_per_metre_));
  stamp_.clear();
  for (int dy = -reach_; dy <= reach_; ++dy) {
    for (int dx = -reach_; dx <= reach_; ++dx) {
      stamp_.push_back(
          std::min(std::sqrt(static_cast<float>(dx * dx + dy * dy)) * resolution_, max_distance_));
    }
  }
}

/// Takes in a lethal cell.
void ClearanceMap::Stamp(CellIndex lethal) {
  const int x0 = std::max(lethal.x - reach_, 0), x1 = std::min(lethal.x + reach_ + 1, size_x_);
  const int y0 = std::max(lethal.y - reach_, 0), y1 = std::min(lethal.y + reach_ + 1, size_y_);
  const int side = 2 * reach_ + 1;
  const std::ptrdiff_t first_of_stamp =
      static_cast<std::ptrdiff_t>(y0 - lethal.y + reach_) * side + (x0 - lethal.x + reach_);
  TakeNearer(stamp_.data() + first_of_stamp, side, x1 - x0, y1 - y0, size_x_,
             distances_.data() + static_cast<std::ptrdiff_t>(y0) * size_x_ + x0);
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
