#include "sim/engines/mujoco/mujoco_world.h"

#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <span>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/geometry.h"
#include "base/log.h"

namespace slalom::engines {
namespace {

constexpr int kFirstObstacle = 1;      // Index among the geoms; the ground comes first.
constexpr int kFirstHinge = 6;         // Index among the velocities; the free joint has six.
constexpr double kSettlingTime = 2.0;  // [s]

/// Bits of MuJoCo's contype and conaffinity, which say which geoms meet.
constexpr int kMeetsGround = 1;
constexpr int kMeetsObstacles = 2;

// With this inertia no contact slows a wheel down by more than a millionth in a step, [kg m^2].
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

/// MuJoCo's description (MJCF) of the robot on level ground, with the chassis as body 1 and its
/// free joint and the hinges of the wheels, in this order, as the only joints. The geoms of the
/// world are the ground and `num_obstacles` cylinders that meet nothing: room for obstacles.
/// `step`: time step of the simulation, [s].
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

using ModelPtr = std::unique_ptr<mjModel, void (*)(mjModel*)>;
using DataPtr = std::unique_ptr<mjData, void (*)(mjData*)>;

/// The free joint's position and quaternion at rest, C's origin over the world's.
using Rest = std::array<mjtNum, 7>;

/// Otherwise MuJoCo writes a file into the working directory, and ends the program on an error.
void HandleMessages() {
  static const bool done = [] {
    mju_user_warning = [](const char* text) { spdlog::warn("MuJoCo: {}", text); };
    mju_user_error = [](const char* text) { throw base::Error("MuJoCo: {}", text); };
    return true;
  }();
  (void)done;
}

ModelPtr Compile(const std::string& xml) {
  constexpr char kName[] = "jackal.xml";
  const auto files = std::make_unique<mjVFS>();  // Too large for a stack.
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), kName, static_cast<int>(xml.size()));
  char* const bytes = static_cast<char*>(files->filedata[mj_findFileVFS(files.get(), kName)]);
  std::ranges::copy(xml, bytes);
  std::array<char, 1000> error{};
  ModelPtr model(mj_loadXML(kName, files.get(), error.data(), error.size()), mj_deleteModel);
  mj_deleteVFS(files.get());
  base::ThrowIf(model == nullptr, "physics mujoco refuses the robot: {}", error.data());
  return model;
}

class MujocoWorld final : public World {
 public:
  /// `model`: of `MujocoXml`, copied.
  MujocoWorld(const mjModel& model, double wheel_radius, const Rest* rest);

  void Reset(const base::Pose2& X_WC, const WheelAngles& angles) override;
  bool Step(const sim::WheelSpeeds& wheels, std::span<const sim::MovingShape> obstacles) override;
  sim::BodyState state() const override;
  double lift() const override { return data_->qpos[2] - rest_[2]; }

  const Rest& rest() const { return rest_; }

 private:
  void Settle();
  void PlaceObstacle(int geom, const sim::MovingShape& obstacle);
  bool Touching() const;

  const double wheel_radius_;  // [m]
  ModelPtr model_;             // Its own, as obstacles are parts of a model.
  DataPtr data_;
  int num_obstacles_ = 0;
  Rest rest_{};
};

MujocoWorld::MujocoWorld(const mjModel& model, double wheel_radius, const Rest* rest)
    : wheel_radius_(wheel_radius),
      model_(mj_copyModel(nullptr, &model), mj_deleteModel),
      data_(mj_makeData(model_.get()), mj_deleteData) {
  SLALOM_CHECK(model_ != nullptr && data_ != nullptr);
  if (rest != nullptr) {
    rest_ = *rest;
  } else {
    Settle();
  }
}

/// Lets the robot settle where the model puts it, and keeps its pose at rest.
void MujocoWorld::Settle() {
  const int num_steps = static_cast<int>(std::lround(kSettlingTime / model_->opt.timestep));
  for (int k = 0; k < num_steps; ++k) Step({}, {});
  const sim::BodyState at_rest = state();
  std::copy_n(data_->qpos, rest_.size(), rest_.begin());
  rest_[0] = rest_[1] = 0.0;
  // Settling may have turned it.
  const std::array<mjtNum, 4> back = {std::cos(0.5 * at_rest.yaw), 0.0, 0.0,
                                      -std::sin(0.5 * at_rest.yaw)};
  mju_mulQuat(rest_.data() + 3, back.data(), data_->qpos + 3);
}

void MujocoWorld::Reset(const base::Pose2& X_WC, const WheelAngles& angles) {
  mj_resetData(model_.get(), data_.get());
  const std::array<mjtNum, 4> heading = {std::cos(0.5 * X_WC.yaw), 0.0, 0.0,
                                         std::sin(0.5 * X_WC.yaw)};
  data_->qpos[0] = X_WC.p.x;
  data_->qpos[1] = X_WC.p.y;
  data_->qpos[2] = rest_[2];
  mju_mulQuat(data_->qpos + 3, heading.data(), rest_.data() + 3);
  std::ranges::copy(angles, data_->qpos + rest_.size());
}

bool MujocoWorld::Step(const sim::WheelSpeeds& wheels,
                       std::span<const sim::MovingShape> obstacles) {
  for (int wheel = 0; wheel < kNumWheels; ++wheel) {
    const double speed = static_cast<double>(IsLeft(wheel) ? wheels.left : wheels.right);
    data_->qvel[kFirstHinge + wheel] = speed / wheel_radius_;
  }
  const int num_obstacles = static_cast<int>(obstacles.size());
  SLALOM_CHECK_LE(num_obstacles, kMaxNearObstacles);
  for (int i = 0; i < num_obstacles; ++i) PlaceObstacle(kFirstObstacle + i, obstacles[i]);
  for (int i = num_obstacles; i < num_obstacles_; ++i) {
    model_->geom_conaffinity[kFirstObstacle + i] = 0;
  }
  num_obstacles_ = num_obstacles;
  mj_step(model_.get(), data_.get());
  return Touching();
}

void MujocoWorld::PlaceObstacle(int geom, const sim::MovingShape& obstacle) {
  const sim::PlacedBox& box = obstacle.box;
  const bool is_box = obstacle.radius == 0.0f;
  mjtNum* const size = model_->geom_size + 3 * geom;
  mjtNum* const p = model_->geom_pos + 3 * geom;
  mjtNum* const q = model_->geom_quat + 4 * geom;
  size[0] = is_box ? box.half_x : obstacle.radius;
  size[1] = is_box ? box.half_y : kObstacleHalfHeight;
  size[2] = is_box ? kObstacleHalfHeight : 0.0;
  const double across = is_box ? std::hypot(size[0], size[1]) : size[0];
  model_->geom_type[geom] = is_box ? mjGEOM_BOX : mjGEOM_CYLINDER;
  model_->geom_rbound[geom] = std::hypot(across, kObstacleHalfHeight);
  model_->geom_conaffinity[geom] = kMeetsObstacles;
  p[0] = box.x;
  p[1] = box.y;
  p[2] = 0.0;
  const double half_yaw = is_box ? 0.5 * static_cast<double>(box.yaw) : 0.0;
  q[0] = std::cos(half_yaw);
  q[1] = q[2] = 0.0;
  q[3] = std::sin(half_yaw);
}

/// As the last step began.
bool MujocoWorld::Touching() const {
  const auto is_obstacle = [](int geom) {
    return geom >= kFirstObstacle && geom < kFirstObstacle + kMaxNearObstacles;
  };
  const std::span contacts(data_->contact, static_cast<std::size_t>(data_->ncon));
  return std::ranges::any_of(contacts, [&](const mjContact& contact) {
    return contact.dist < 0.0 && (is_obstacle(contact.geom1) || is_obstacle(contact.geom2));
  });
}

sim::BodyState MujocoWorld::state() const {
  const mjtNum* const p = data_->qpos;
  const mjtNum* const v = data_->qvel;
  std::array<mjtNum, 9> rotation;
  mju_quat2Mat(rotation.data(), p + 3);
  // Turn rates are in the chassis' own directions, other velocities in the world's.
  const double yaw_rate = rotation[6] * v[3] + rotation[7] * v[4] + rotation[8] * v[5];
  return {.x = static_cast<float>(p[0]),
          .y = static_cast<float>(p[1]),
          .yaw = static_cast<float>(std::atan2(rotation[3], rotation[0])),
          .vx = static_cast<float>(v[0]),
          .vy = static_cast<float>(v[1]),
          .yaw_rate = static_cast<float>(yaw_rate)};
}

}  // namespace

std::string MujocoVersion() { return mj_versionString(); }

std::vector<std::unique_ptr<World>> MakeMujocoWorlds(const Jackal& jackal, double step, int count) {
  HandleMessages();
  const ModelPtr model = Compile(MujocoXml(jackal, step, kMaxNearObstacles));
  std::vector<std::unique_ptr<World>> worlds;
  const Rest* rest = nullptr;
  for (int i = 0; i < count; ++i) {
    auto world = std::make_unique<MujocoWorld>(*model, jackal.wheel_radius, rest);
    if (rest == nullptr) rest = &world->rest();
    worlds.push_back(std::move(world));
  }
  return worlds;
}

}  // namespace slalom::engines
