#pragma once

#include <cmath>
#include <vector>

#include "planners/navigation/clearance_map.h"
#include "planners/navigation/local_planner.h"

namespace slalom::planners {

/// A unicycle that does at once what is commanded, for 0.05 s at a time, in a world of 12 x 12 m
/// round the origin that is known from the start, with a path of straight stretches.
class FlatWorld {
 public:
  FlatWorld(base::Pose2 X_OR, base::Vec2 goal_O) : X_OR_(X_OR), goal_O_(goal_O) {
    path_.push_back(X_OR.p);
    LeadTo(goal_O);
  }

  /// Appends a straight stretch to the path.
  void LeadTo(base::Vec2 p_O) {
    const base::Vec2 from = path_.back();
    for (int i = 1; i <= 100; ++i) path_.push_back(from + (i / 100.0) * (p_O - from));
  }

  /// Leads the path to the goal by way of p_O.
  void LeadBy(base::Vec2 p_O) {
    path_.resize(1);
    LeadTo(p_O);
    LeadTo(goal_O_);
  }

  void AddDisc(base::Vec2 centre, double radius) {
    for (int y = 0; y < costmap_.size_y(); ++y) {
      for (int x = 0; x < costmap_.size_x(); ++x) {
        if (base::Norm(costmap_.CentreOf({x, y}) - centre) < radius) {
          costmap_.set_cost({x, y}, kLethalCost);
        }
      }
    }
  }

  LocalView View() const { return {X_OR_, velocity_, costmap_, path_, false, goal_O_}; }

  /// False: the planner found no command; the robot stands.
  bool Step(LocalPlanner& planner) {
    const auto command = planner.ComputeCommand(View());
    velocity_ = command.value_or(Twist{});
    const double middle = X_OR_.yaw + 0.5 * velocity_.angular * 0.05;
    X_OR_.p.x += velocity_.linear * 0.05 * std::cos(middle);
    X_OR_.p.y += velocity_.linear * 0.05 * std::sin(middle);
    X_OR_.yaw = base::WrapAngle(X_OR_.yaw + velocity_.angular * 0.05);
    while (path_.size() > 1 && base::Norm(path_[1] - X_OR_.p) < base::Norm(path_[0] - X_OR_.p)) {
      path_.erase(path_.begin());
    }
    return command.has_value();
  }

  double goal_distance() const { return base::Norm(goal_O_ - X_OR_.p); }
  const base::Pose2& pose() const { return X_OR_; }
  const Costmap& costmap() const { return costmap_; }
  Twist velocity() const { return velocity_; }

  /// Of the Jackal's outline, by discs, [m].
  double Clearance() const {
    ClearanceMap map(0.8);
    map.Update(costmap_, X_OR_.p);
    return DiscOutline(0.458, 0.416)
        .Clearance(map, 0.0f, 0.0f, static_cast<float>(std::cos(X_OR_.yaw)),
                   static_cast<float>(std::sin(X_OR_.yaw)));
  }

 private:
  base::Pose2 X_OR_;
  base::Vec2 goal_O_;
  Twist velocity_;
  Costmap costmap_{240, 240, 0.05, {-6.0, -6.0}};
  std::vector<base::Vec2> path_;
};

}  // namespace slalom::planners
