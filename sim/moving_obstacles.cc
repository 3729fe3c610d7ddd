#include "sim/moving_obstacles.h"

#include "sim/vector_lanes.h"

namespace slalom::sim {

float Clearance(const MovingShape& shape, const Footprint& footprint, const FootprintPose& X_WR) {
  if (shape.radius > 0.0f) {
    return CircleClearance(shape.box.x, shape.box.y, shape.radius, footprint, X_WR);
  }
  return BoxClearance(shape.box, footprint, X_WR);
}

void MovingShapes::Reserve(int num_obstacles) {
  for (std::vector<float>* numbers : {&x, &y, &radius}) numbers->reserve(num_obstacles + kLanes);
  boxes.reserve(num_obstacles);
}

MovingObstacles::MovingObstacles(const Course& course) {
  for (const MovingObstacle& obstacle : course.moving) {
    Obstacle made{.motion = Motion(obstacle),
                  .radius = static_cast<float>(obstacle.radius),
                  .half_x = static_cast<float>(obstacle.half_size.x),
                  .half_y = static_cast<float>(obstacle.half_size.y),
                  .circumradius = static_cast<float>(
                      obstacle.radius > 0.0 ? obstacle.radius : base::Norm(obstacle.half_size)),
                  .max_speed = 0.0f};
    made.max_speed = static_cast<float>(made.motion.max_speed());
    obstacles_.push_back(std::move(made));
  }
}

MovingShape MovingObstacles::At(int i, double time) const {
  const Obstacle& obstacle = obstacles_[i];
  const MotionState state = obstacle.motion.At(time);
  MovingShape shape{.box = {.x = static_cast<float>(state.X_WB.p.x),
                            .y = static_cast<float>(state.X_WB.p.y),
                            .half_x = obstacle.half_x,
                            .half_y = obstacle.half_y,
                            .yaw = static_cast<float>(state.X_WB.yaw)},
                    .radius = obstacle.radius,
                    .vx = static_cast<float>(state.v_B.x),
                    .vy = static_cast<float>(state.v_B.y),
                    .yaw_rate = static_cast<float>(state.yaw_rate)};
  if (obstacle.radius == 0.0f) {
    const auto [s, c] = base::SinCos(state.X_WB.yaw);
    shape.box.cos_yaw = static_cast<float>(c);
    shape.box.sin_yaw = static_cast<float>(s);
  }
  return shape;
}

void MovingObstacles::PlaceAll(double time, MovingShapes& shapes) const {
  constexpr float kNowhere = 1.0e6f;  // [m]
  shapes.x.clear();
  shapes.y.clear();
  shapes.radius.clear();
  shapes.boxes.clear();
  for (int i = 0; i < size(); ++i) {
    const MovingShape shape = At(i, time);
    if (shape.radius == 0.0f) {
      shapes.boxes.push_back(shape.box);
      continue;
    }
    shapes.x.push_back(shape.box.x);
    shapes.y.push_back(shape.box.y);
    shapes.radius.push_back(shape.radius);
  }
  shapes.num_circles = static_cast<int>(shapes.x.size());
  shapes.x.insert(shapes.x.end(), kLanes, kNowhere);
  shapes.y.insert(shapes.y.end(), kLanes, kNowhere);
  shapes.radius.insert(shapes.radius.end(), kLanes, 0.0f);
}

bool MovingObstacles::Touch(double time, const Footprint& footprint,
                            const FootprintPose& X_WR) const {
  for (int i = 0; i < size(); ++i) {
    if (Clearance(At(i, time), footprint, X_WR) <= 0.0f) return true;
  }
  return false;
}

}  // namespace slalom::sim
