#include "planners/elastic_band/elastic_band.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::planners {

BandField::BandField(const Costmap& costmap, double costmap_weight, bool blind)
    : costmap_(costmap), weight_(costmap_weight), blind_(blind) {}

double BandField::Clearance(base::Vec2 p_O) const {
  const CellIndex c = costmap_.CellAt(p_O);
  int cost = kFreeCost;
  if (!blind_ && costmap_.Contains(c) && costmap_.cost(c) != kUnknownCost) cost = costmap_.cost(c);
  if (cost >= kInscribedCost) return 0.0;
  return std::log((kInscribedCost - 1.0) / std::max(cost, 1)) / weight_;
}

bool ElasticBand::SetPath(const BandField& field, std::span<const base::Vec2> path_O) {
  if (path_O.size() < 2) return false;
  std::vector<Bubble> before = bubbles_;
  bubbles_.clear();
  for (const base::Vec2 p_O : path_O) bubbles_.push_back({p_O, field.Clearance(p_O)});
  const bool free =
      std::all_of(bubbles_.begin(), bubbles_.end(), [](const Bubble& b) { return b.radius > 0.0; });
  if (free && Refine(field)) return true;
  bubbles_.swap(before);
  return false;
}

bool ElasticBand::BeginAt(const BandField& field, base::Vec2 p_O) {
  const Bubble robot{p_O, field.Clearance(p_O)};
  if (bubbles_.empty() || robot.radius <= 0.0) return false;
  filled_.clear();
  for (std::size_t i = bubbles_.size(); i-- > 0;) {
    if (!Overlap(robot, bubbles_[i])) continue;
    filled_.push_back(robot);
    filled_.insert(filled_.end(), bubbles_.begin() + static_cast<std::ptrdiff_t>(i),
                   bubbles_.end());
    bubbles_.swap(filled_);
    return true;
  }
  if (!FillGap(field, robot, bubbles_.front(), filled_)) return false;
  filled_.insert(filled_.end(), bubbles_.begin(), bubbles_.end());
  bubbles_.swap(filled_);
  return true;
}

bool ElasticBand::Optimise(const BandField& field) {
  std::vector<Bubble> before = bubbles_;
  const auto optimise = [&] {
    for (Bubble& bubble : bubbles_) {
      bubble.radius = field.Clearance(bubble.p_O);
      if (bubble.radius <= 0.0) return false;
    }
    if (!Refine(field)) return false;
    for (int iteration = 0; iteration < config_.num_iterations; ++iteration) {
      for (std::size_t i = 1; i + 1 < bubbles_.size(); ++i) Move(field, i);
      for (std::size_t i = bubbles_.size() - 1; i-- > 1;) Move(field, i);
      if (!Refine(field)) return false;
    }
    return true;
  };
  if (optimise()) return true;
  bubbles_.swap(before);
  return false;
}

base::Vec2 ElasticBand::Force(const BandField& field, std::size_t i, const Bubble& bubble) const {
  SLALOM_CHECK(i > 0 && i + 1 < bubbles_.size());
  const base::Vec2 before_O = bubbles_[i - 1].p_O, after_O = bubbles_[i + 1].p_O;
  const auto pull = [&](base::Vec2 to_O) {
    const base::Vec2 d = to_O - bubble.p_O;
    const double distance = base::Norm(d);
    return distance <= config_.tiny_bubble ? base::Vec2{} : (1.0 / distance) * d;
  };
  const base::Vec2 inner = config_.internal_force * (pull(before_O) + pull(after_O));

  const double r = bubble.radius;
  const auto rise = [&](base::Vec2 axis) {
    return field.Clearance(bubble.p_O + r * axis) - field.Clearance(bubble.p_O - r * axis);
  };
  const base::Vec2 outer = config_.external_force / (2.0 * std::max(r, config_.tiny_bubble)) *
                           base::Vec2{rise({1.0, 0.0}), rise({0.0, 1.0})};

  const base::Vec2 force = inner + outer;
  const base::Vec2 along = before_O - after_O;
  const double length2 = base::Dot(along, along);
  return length2 > 0.0 ? force - (base::Dot(force, along) / length2) * along : force;
}

bool ElasticBand::Overlap(const Bubble& a, const Bubble& b) const {
  return base::Norm(a.p_O - b.p_O) < config_.min_overlap * (a.radius + b.radius);
}

/// Drops bubbles whose neighbours overlap without them and fills gaps.
bool ElasticBand::Refine(const BandField& field) {
  if (bubbles_.size() < 2) return false;
  refined_.clear();
  if (!RefineBetween(field, 0, bubbles_.size() - 1, refined_)) return false;
  refined_.push_back(bubbles_.back());
  bubbles_.swap(refined_);
  return true;
}

/// Appends the refined band from bubble `first` up to, but not including, bubble `last`.
bool ElasticBand::RefineBetween(const BandField& field, std::size_t first, std::size_t last,
                                std::vector<Bubble>& out) const {
  const Bubble& begin = bubbles_[first];
  const Bubble& end = bubbles_[last];
  if (Overlap(begin, end)) {
    out.push_back(begin);
    return true;
  }
  if (last - first == 1) return FillGap(field, begin, end, out);
  const std::size_t middle = first + (last - first) / 2;
  if (!RefineBetween(field, first, middle, out)) return false;
  const std::size_t middle_out = out.size();
  if (!RefineBetween(field, middle, last, out)) return false;
  const Bubble& next = middle_out + 1 < out.size() ? out[middle_out + 1] : end;
  if (Overlap(out[middle_out - 1], next)) {
    out.erase(out.begin() + static_cast<std::ptrdiff_t>(middle_out));
  }
  return true;
}

/// Appends `a` and the bubbles that connect it to `b`.
bool ElasticBand::FillGap(const BandField& field, const Bubble& a, const Bubble& b,
                          std::vector<Bubble>& out) const {
  Bubble middle{0.5 * (a.p_O + b.p_O), 0.0};
  middle.radius = field.Clearance(middle.p_O);
  if (middle.radius <= config_.tiny_bubble) return false;
  if (Overlap(a, middle)) {
    out.push_back(a);
  } else if (!FillGap(field, a, middle, out)) {
    return false;
  }
  if (Overlap(middle, b)) {
    out.push_back(middle);
    return true;
  }
  return FillGap(field, middle, b, out);
}

bool ElasticBand::Connected(const BandField& field, const Bubble& a, const Bubble& b) {
  filled_.clear();
  return Overlap(a, b) || FillGap(field, a, b, filled_);
}

/// Moves bubble i by the force on it if it stays free and connected there.
void ElasticBand::Move(const BandField& field, std::size_t i) {
  const Bubble& old = bubbles_[i];
  const base::Vec2 force = Force(field, i, old);
  const base::Vec2 step = old.radius * force;
  Bubble moved{old.p_O + step, 0.0};
  moved.radius = field.Clearance(moved.p_O);
  if (moved.radius <= config_.tiny_bubble) return;
  const base::Vec2 new_force = Force(field, i, moved);
  if (base::Dot(new_force, force) < 0.0 && Significant(new_force, force)) {
    moved = TowardsEquilibrium(field, i, force, step, moved);
  }
  if (!Connected(field, bubbles_[i - 1], moved) || !Connected(field, moved, bubbles_[i + 1])) {
    return;
  }
  bubbles_[i] = moved;
}

/// Walks in ever smaller steps to the point where the force turns around, because a whole step went
/// too far.
Bubble ElasticBand::TowardsEquilibrium(const BandField& field, std::size_t i, base::Vec2 force,
                                       base::Vec2 step, Bubble overshot) const {
  Bubble best = overshot;
  Bubble here = bubbles_[i];
  step = 0.5 * step;
  for (int depth = 0; depth <= config_.max_equilibrium_depth; ++depth) {
    here.p_O = here.p_O + step;
    here.radius = field.Clearance(here.p_O);
    if (here.radius <= 0.0) break;
    best = here;
    const base::Vec2 new_force = Force(field, i, here);
    const bool turned = base::Dot(new_force, force) < 0.0;
    if (turned && !Significant(new_force, force)) break;
    step = (turned ? -0.5 : 0.5) * step;
    force = new_force;
  }
  return best;
}

bool ElasticBand::Significant(base::Vec2 force, base::Vec2 before) const {
  const double size = base::Norm(force);
  return size > config_.equilibrium_overshoot * base::Norm(before) &&
         size > config_.significant_force;
}

}  // namespace slalom::planners
