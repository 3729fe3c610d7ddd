#pragma once

#include <string>

#include "sim/engines/jackal/jackal.h"

namespace slalom::engines {

/// Bits of MuJoCo's contype and conaffinity, which say which geoms meet.
inline constexpr int kMeetsGround = 1;
inline constexpr int kMeetsObstacles = 2;

/// MuJoCo's description (MJCF) of the robot on level ground, with the chassis as body 1 and its
/// free joint and the hinges of the wheels, in this order, as the only joints. The geoms of the
/// world are the ground and `num_obstacles` cylinders that meet nothing: room for obstacles.
/// `step`: time step of the simulation, [s].
std::string MujocoXml(const Jackal& jackal, double step, int num_obstacles);

}  // namespace slalom::engines
