#pragma once

#include "base/random.h"
#include "planners/navigation/costmap.h"

namespace slalom::planners {

/// A map of `size` x `size` cells of 0.05 m with the corner of cell (0, 0) at the origin of O; each
/// cell is with these shares lethal, inscribed, or of some other cost, and else free.
inline Costmap DrawMap(int size, double lethal, double inscribed, double other,
                       base::Random& random) {
  Costmap map(size, size, 0.05, {});
  for (std::uint8_t& cost : map.mutable_costs()) {
    const double u = random.Uniform();
    if (u < lethal) {
      cost = kLethalCost;
    } else if (u < lethal + inscribed) {
      cost = kInscribedCost;
    } else if (u < lethal + inscribed + other) {
      cost = static_cast<std::uint8_t>(random.UniformInt(kInscribedCost));
    }
  }
  return map;
}

/// Fills the cells [x0, x1) x [y0, y1).
inline void Fill(Costmap& map, const CellWindow& window, std::uint8_t cost) {
  for (int y = window.y0; y < window.y1; ++y) {
    for (int x = window.x0; x < window.x1; ++x) map.set_cost({x, y}, cost);
  }
}

}  // namespace slalom::planners
