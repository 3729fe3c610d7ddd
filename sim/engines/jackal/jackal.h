#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>

#include "sim/environment_config.h"

/// Frame: `C` the chassis, x ahead, y left, z up, its origin midway between the wheels and a little
/// below their axles, where the Jackal's description has it.

namespace slalom::engines {

inline constexpr int kNumWheels = 4;     ///< Left front, right front, left back, right back.
inline constexpr double kGravity = 9.8;  ///< As the original's worlds set it, [m/s^2].

inline constexpr bool IsLeft(int wheel) { return wheel % 2 == 0; }

/// An upright box.
struct Box3 {
  Eigen::Vector3d centre_C;
  Eigen::Vector3d half_size;
};

/// The Jackal as an engine builds it: a chassis and four wheels about axles across it
/// (docs/original-system.md, section 1.1). A value.
struct Jackal {
  double chassis_mass = 0.0;                         ///< [kg]
  Eigen::Vector3d chassis_centre_C;                  ///< The chassis' centre of mass, [m].
  Eigen::Matrix3d chassis_inertia;                   ///< About that centre, [kg m^2].
  double height = 0.0;                               ///< Height of C above level ground, [m].
  double wheel_radius = 0.0;                         ///< [m]
  double wheel_half_width = 0.0;                     ///< [m]
  double wheel_mass = 0.0;                           ///< [kg]
  Eigen::Vector3d wheel_inertia;                     ///< Diagonal, the axle along y, [kg m^2].
  std::array<Eigen::Vector3d, kNumWheels> wheels_C;  ///< Centres, [m].
  double wheel_friction = 0.0;                       ///< Friction of wheels on the ground.
  double obstacle_friction = 0.0;                    ///< Friction of anything on obstacles.
  Box3 outline;  ///< The part that obstacles meet: the chassis, or the whole robot.
  bool wheels_meet_obstacles = false;  ///< Whether they meet the wheels, too.
};

/// The Jackal with the masses, the moment of inertia, the wheels and the outline of `config`; its
/// sensor is part of the chassis. The rest is the original's: the masses of the wheels, and how the
/// chassis' mass is spread. The law of friction is the engine's own.
///
/// Obstacles meet chassis and wheels if the configured outline equals theirs to the millimetre, as
/// it does by default. Otherwise they meet a box of that length and width.
///
/// Throws `base::Error` that names the key and `physics` if no such robot can be built: an ideal
/// drive, or no more mass or moment of inertia than the wheels have alone.
Jackal MakeJackal(const sim::RobotConfig& config, std::string_view physics);

}  // namespace slalom::engines
