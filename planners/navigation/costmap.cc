#include "planners/navigation/costmap.h"

#include "base/check.h"

namespace slalom::planners {

Costmap::Costmap(int size_x, int size_y, double resolution, base::Vec2 origin_O)
    : size_x_(size_x), size_y_(size_y), resolution_(resolution), origin_O_(origin_O) {
  SLALOM_CHECK_GE(size_x, 1);
  SLALOM_CHECK_GE(size_y, 1);
  SLALOM_CHECK(resolution > 0.0);
  costs_.assign(static_cast<std::size_t>(size_x) * static_cast<std::size_t>(size_y), kFreeCost);
}

base::Vec2 Costmap::CentreOf(CellIndex c) const {
  return {origin_O_.x + (c.x + 0.5) * resolution_, origin_O_.y + (c.y + 0.5) * resolution_};
}

}  // namespace slalom::planners
