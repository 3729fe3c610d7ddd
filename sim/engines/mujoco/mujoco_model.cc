#include "sim/engines/mujoco/mujoco_model.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <iterator>

#include "base/geometry.h"

namespace slalom::engines {
namespace {

// So much that no contact slows a wheel down by more than a millionth in a step, [kg m^2].
constexpr double kWheelArmature = 1000.0;

std::string Text(const Eigen::Vector3d& v) { return fmt::format("{} {} {}", v[0], v[1], v[2]); }

std::string ChassisXml(const Jackal& jackal) {
  const Eigen::Matrix3d& inertia = jackal.chassis_inertia;
  return fmt::format(
      "<freejoint/>\n"
      "<inertial pos='{}' mass='{}' fullinertia='{} {} {} {}'/>\n"
      "<geom type='box' pos='{}' size='{}' contype='{}' friction='{} 0 0'/>\n",
      Text(jackal.chassis_centre_C), jackal.chassis_mass, Text(inertia.diagonal()), inertia(0, 1),
      inertia(0, 2), inertia(1, 2), Text(jackal.outline.centre_C), Text(jackal.outline.half_size),
      kMeetsGround | kMeetsObstacles, jackal.obstacle_friction);
}

std::string WheelXml(const Jackal& jackal, int wheel) {
  return fmt::format(
      "<body pos='{}'>\n"
      "<joint type='hinge' axis='0 1 0' armature='{}'/>\n"
      "<inertial pos='0 0 0' mass='{}' diaginertia='{}'/>\n"
      "<geom type='cylinder' size='{} {}' euler='{} 0 0' contype='{}' priority='1' "
      "friction='{} 0 0'/>\n"
      "</body>\n",
      Text(jackal.wheels_C[wheel]), kWheelArmature, jackal.wheel_mass, Text(jackal.wheel_inertia),
      jackal.wheel_radius, jackal.wheel_half_width, 0.5 * base::kPi,
      kMeetsGround | (jackal.wheels_meet_obstacles ? kMeetsObstacles : 0), jackal.wheel_friction);
}

}  // namespace

std::string MujocoXml(const Jackal& jackal, double step, int num_obstacles) {
  std::string xml = fmt::format(
      "<mujoco>\n"
      "<compiler angle='radian' inertiafromgeom='false'/>\n"
      "<option timestep='{}' gravity='0 0 {}' integrator='Euler' cone='elliptic' impratio='10' "
      "solver='Newton' iterations='50' tolerance='1e-10'/>\n"
      "<size njmax='300' nconmax='100'/>\n"
      "<default><geom contype='0' conaffinity='0' condim='3' solref='0.01 1' "
      "solimp='0.95 0.99 0.0005'/></default>\n"
      "<worldbody>\n"
      "<geom type='plane' size='1 1 1' conaffinity='{}' friction='0 0 0'/>\n",
      step, -kGravity, kMeetsGround);
  for (int i = 0; i < num_obstacles; ++i) {
    // Off the origin, as MuJoCo does not look at the place of a geom that begins there.
    fmt::format_to(
        std::back_inserter(xml),
        "<geom type='cylinder' size='1 1' pos='1 1 1' priority='2' friction='{} 0 0'/>\n",
        jackal.obstacle_friction);
  }
  fmt::format_to(std::back_inserter(xml), "<body pos='0 0 {}'>\n{}", jackal.height,
                 ChassisXml(jackal));
  for (int wheel = 0; wheel < kNumWheels; ++wheel) xml += WheelXml(jackal, wheel);
  xml += "</body>\n</worldbody>\n</mujoco>\n";
  return xml;
}

}  // namespace slalom::engines
