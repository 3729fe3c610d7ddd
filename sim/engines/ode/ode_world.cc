#include "sim/engines/ode/ode_world.h"

#include <ode/ode.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "base/check.h"
#include "base/random.h"

namespace slalom::engines {
namespace {

constexpr int kNumParts = 1 + kNumWheels;  // The chassis and the wheels.
constexpr int kMostPoints = 8;             // Points of contact between two shapes.
constexpr int kMostPushed = 8;             // Moving obstacles that are touched at once.
constexpr double kStiffness = 1e7;         // Stiffness of a contact, [N/m].
constexpr double kDamping = 2.0;           // Damping of a contact, both surfaces together, [N s/m].
constexpr double kSurfaceLayer = 1e-3;     // Depth to which bodies sink at rest, [m].
constexpr double kSettlingTime = 0.3;      // [s]
constexpr double kMotorTorque = 1e6;       // Torque with which wheels turn exactly as asked, [N m].

/// Generator that draws the order of the constraints in this thread's step.
thread_local base::Random* order_of_this_step = nullptr;

struct PartPose {
  dVector3 p;
  dQuaternion q;
};

/// The parts at rest, C's origin over the world's.
using Rest = std::array<PartPose, kNumParts>;

/// Once for the process, and once for each thread.
void RequireOde() {
  static const bool initialised = dInitODE2(0) != 0;
  thread_local const bool allocated = dAllocateODEDataForThread(dAllocateMaskAll) != 0;
  SLALOM_CHECK(initialised && allocated);
}

class OdeWorld final : public World {
 public:
  OdeWorld(const Jackal& jackal, double step, const Rest* rest);
  ~OdeWorld() override;

  void Reset(const base::Pose2& X_WC, const WheelAngles& angles) override;
  bool Step(const sim::WheelSpeeds& wheels, std::span<const sim::MovingShape> obstacles) override;
  sim::BodyState state() const override;
  double lift() const override;

  const Rest& rest() const { return rest_; }

 private:
  void BuildChassis(const Jackal& jackal);
  void BuildWheel(const Jackal& jackal, int wheel);
  void Settle();
  dContact MakeContact(double friction) const;
  void StandOnGround(int part);
  bool Touch(const sim::MovingShape& obstacle);
  dBodyID PushedBody(const sim::MovingShape& obstacle);

  const double step_;          // [s]
  const double height_;        // Height of C above level ground, at rest, [m].
  const double wheel_radius_;  // [m]
  const double wheel_friction_;
  const double obstacle_friction_;
  const bool wheels_meet_obstacles_;
  const Eigen::Vector3d centre_C_;  // The chassis' centre of mass, which is ODE's origin of it.

  dThreadingImplementationID threading_;
  dWorldID world_;
  dJointGroupID contacts_;  // Contacts of this step.
  dGeomID ground_;
  dGeomID cylinder_, box_;  // Take the shape and place of one obstacle after the other.
  std::array<dBodyID, kNumParts> parts_{};
  std::array<dGeomID, kNumParts> shapes_{};
  std::array<dJointID, kNumWheels> motors_{};
  std::array<dBodyID, kMostPushed> pushed_{};  // Moving obstacles that are touched.
  int num_pushed_ = 0;
  Rest rest_{};
  base::Random order_;  // Order of constraints.
};

OdeWorld::OdeWorld(const Jackal& jackal, double step, const Rest* rest)
    : step_(step),
      height_(jackal.height - kSurfaceLayer),
      wheel_radius_(jackal.wheel_radius),
      wheel_friction_(jackal.wheel_friction),
      obstacle_friction_(jackal.obstacle_friction),
      wheels_meet_obstacles_(jackal.wheels_meet_obstacles),
      centre_C_(jackal.chassis_centre_C),
      order_(0) {
  RequireOde();
  world_ = dWorldCreate();
  // One of its own: that which worlds share by default is for one thread.
  threading_ = dThreadingAllocateSelfThreadedImplementation();
  dWorldSetStepThreadingImplementation(world_, dThreadingImplementationGetFunctions(threading_),
                                       threading_);
  contacts_ = dJointGroupCreate(0);
  dWorldSetGravity(world_, 0.0, 0.0, -kGravity);
  dWorldSetERP(world_, 0.2);
  dWorldSetCFM(world_, 0.0);
  dWorldSetQuickStepNumIterations(world_, 50);
  dWorldSetQuickStepW(world_, 1.3);
  dWorldSetContactMaxCorrectingVel(world_, 100.0);
  dWorldSetContactSurfaceLayer(world_, kSurfaceLayer);
  ground_ = dCreatePlane(nullptr, 0.0, 0.0, 1.0, 0.0);
  cylinder_ = dCreateCylinder(nullptr, 1.0, 2.0 * kObstacleHalfHeight);
  box_ = dCreateBox(nullptr, 1.0, 1.0, 2.0 * kObstacleHalfHeight);
  BuildChassis(jackal);
  for (int wheel = 0; wheel < kNumWheels; ++wheel) BuildWheel(jackal, wheel);
  for (dBodyID& body : pushed_) {
    body = dBodyCreate(world_);
    dBodySetKinematic(body);
    dBodyDisable(body);
  }
  if (rest != nullptr) {
    rest_ = *rest;
  } else {
    Settle();
  }
}

OdeWorld::~OdeWorld() {
  RequireOde();
  for (const dGeomID shape : shapes_) dGeomDestroy(shape);
  for (const dGeomID shape : {ground_, cylinder_, box_}) dGeomDestroy(shape);
  dJointGroupDestroy(contacts_);
  dWorldDestroy(world_);
  dThreadingFreeImplementation(threading_);
}

void OdeWorld::BuildChassis(const Jackal& jackal) {
  const Eigen::Matrix3d& inertia = jackal.chassis_inertia;
  dMass mass;
  dMassSetParameters(&mass, jackal.chassis_mass, 0.0, 0.0, 0.0, inertia(0, 0), inertia(1, 1),
                     inertia(2, 2), inertia(0, 1), inertia(0, 2), inertia(1, 2));
  parts_[0] = dBodyCreate(world_);
  dBodySetMass(parts_[0], &mass);
  dBodySetPosition(parts_[0], centre_C_.x(), centre_C_.y(), height_ + centre_C_.z());
  const Eigen::Vector3d sides = 2.0 * jackal.outline.half_size;
  shapes_[0] = dCreateBox(nullptr, sides.x(), sides.y(), sides.z());
  dGeomSetBody(shapes_[0], parts_[0]);
  const Eigen::Vector3d offset = jackal.outline.centre_C - centre_C_;
  dGeomSetOffsetPosition(shapes_[0], offset.x(), offset.y(), offset.z());
}

void OdeWorld::BuildWheel(const Jackal& jackal, int wheel) {
  const int part = 1 + wheel;
  const Eigen::Vector3d p = jackal.wheels_C[wheel] + Eigen::Vector3d{0.0, 0.0, height_};
  const Eigen::Vector3d& inertia = jackal.wheel_inertia;
  dMass mass;
  dMassSetParameters(&mass, jackal.wheel_mass, 0.0, 0.0, 0.0, inertia.x(), inertia.y(), inertia.z(),
                     0.0, 0.0, 0.0);
  parts_[part] = dBodyCreate(world_);
  dBodySetMass(parts_[part], &mass);
  dBodySetPosition(parts_[part], p.x(), p.y(), p.z());
  dBodySetFiniteRotationMode(parts_[part], 1);  // It turns by 20 rad/s and more.
  shapes_[part] = dCreateCylinder(nullptr, jackal.wheel_radius, 2.0 * jackal.wheel_half_width);
  dGeomSetBody(shapes_[part], parts_[part]);
  dMatrix3 across;  // From a cylinder's own axis, z, to y.
  dRFromAxisAndAngle(across, 1.0, 0.0, 0.0, 0.5 * base::kPi);
  dGeomSetOffsetRotation(shapes_[part], across);
  motors_[wheel] = dJointCreateHinge(world_, nullptr);
  dJointAttach(motors_[wheel], parts_[part], parts_[0]);
  dJointSetHingeAnchor(motors_[wheel], p.x(), p.y(), p.z());
  dJointSetHingeAxis(motors_[wheel], 0.0, 1.0, 0.0);
  dJointSetHingeParam(motors_[wheel], dParamFMax, kMotorTorque);
}

/// Lets the robot settle where it was built and keeps its pose at rest.
void OdeWorld::Settle() {
  const int num_steps = static_cast<int>(std::lround(kSettlingTime / step_));
  for (int k = 0; k < num_steps; ++k) Step({}, {});
  const sim::BodyState at_rest = state();
  dQuaternion back;  // Settling may have turned it.
  dQFromAxisAndAngle(back, 0.0, 0.0, 1.0, -at_rest.yaw);
  dMatrix3 rotation;
  dQtoR(back, rotation);
  for (int part = 0; part < kNumParts; ++part) {
    const dReal* const p = dBodyGetPosition(parts_[part]);
    const dVector3 from_C = {p[0] - at_rest.x, p[1] - at_rest.y, p[2]};
    dMultiply0_331(rest_[part].p, rotation, from_C);
    dQMultiply0(rest_[part].q, back, dBodyGetQuaternion(parts_[part]));
  }
}

void OdeWorld::Reset(const base::Pose2& X_WC, const WheelAngles& angles) {
  RequireOde();
  dQuaternion heading;
  dQFromAxisAndAngle(heading, 0.0, 0.0, 1.0, X_WC.yaw);
  dMatrix3 rotation;
  dQtoR(heading, rotation);
  for (int part = 0; part < kNumParts; ++part) {
    dVector3 p;
    dQuaternion turn, level, q;
    dQFromAxisAndAngle(turn, 0.0, 1.0, 0.0, part == 0 ? 0.0 : angles[part - 1]);
    dMultiply0_331(p, rotation, rest_[part].p);
    dQMultiply0(level, rest_[part].q, turn);
    dQMultiply0(q, heading, level);
    dBodySetPosition(parts_[part], X_WC.p.x + p[0], X_WC.p.y + p[1], p[2]);
    dBodySetQuaternion(parts_[part], q);
    dBodySetLinearVel(parts_[part], 0.0, 0.0, 0.0);
    dBodySetAngularVel(parts_[part], 0.0, 0.0, 0.0);
    dBodySetForce(parts_[part], 0.0, 0.0, 0.0);
    dBodySetTorque(parts_[part], 0.0, 0.0, 0.0);
  }
  order_ = base::Random(0);
}

bool OdeWorld::Step(const sim::WheelSpeeds& wheels, std::span<const sim::MovingShape> obstacles) {
  RequireOde();
  for (int wheel = 0; wheel < kNumWheels; ++wheel) {
    const double speed = static_cast<double>(IsLeft(wheel) ? wheels.left : wheels.right);
    dJointSetHingeParam(motors_[wheel], dParamVel, speed / wheel_radius_);
  }
  for (int part = 0; part < kNumParts; ++part) StandOnGround(part);
  num_pushed_ = 0;
  bool touched = false;
  for (const sim::MovingShape& obstacle : obstacles) {
    if (Touch(obstacle)) touched = true;
  }
  order_of_this_step = &order_;
  dWorldQuickStep(world_, step_);
  order_of_this_step = nullptr;
  dJointGroupEmpty(contacts_);
  for (int i = 0; i < num_pushed_; ++i) dBodyDisable(pushed_[i]);
  return touched;
}

dContact OdeWorld::MakeContact(double friction) const {
  dContact contact{};
  dSurfaceParameters& surface = contact.surface;
  surface.mode = dContactMu2 | dContactSoftERP | dContactSoftCFM | dContactApprox1;
  surface.mu = surface.mu2 = friction;
  surface.soft_erp = step_ * kStiffness / (step_ * kStiffness + kDamping);
  surface.soft_cfm = 1.0 / (step_ * kStiffness + kDamping);
  return contact;
}

void OdeWorld::StandOnGround(int part) {
  const bool is_wheel = part > 0;
  std::array<dContactGeom, kMostPoints> points;
  const int num_points =
      dCollide(shapes_[part], ground_, kMostPoints, points.data(), sizeof(dContactGeom));
  dContact contact = MakeContact(is_wheel ? wheel_friction_ : obstacle_friction_);
  if (is_wheel) {
    const dReal* const rotation = dBodyGetRotation(parts_[part]);
    contact.surface.mode |= dContactFDir1;
    for (int k = 0; k < 3; ++k) contact.fdir1[k] = rotation[4 * k];
  }
  for (int k = 0; k < num_points; ++k) {
    contact.geom = points[k];
    dJointAttach(dJointCreateContact(world_, contacts_, &contact), parts_[part], nullptr);
  }
}

bool OdeWorld::Touch(const sim::MovingShape& obstacle) {
  const dGeomID shape = obstacle.radius > 0.0f ? cylinder_ : box_;
  const sim::PlacedBox& box = obstacle.box;
  if (obstacle.radius > 0.0f) {
    dGeomCylinderSetParams(shape, obstacle.radius, 2.0 * kObstacleHalfHeight);
  } else {
    dGeomBoxSetLengths(shape, 2.0 * box.half_x, 2.0 * box.half_y, 2.0 * kObstacleHalfHeight);
    dMatrix3 rotation;
    dRFromAxisAndAngle(rotation, 0.0, 0.0, 1.0, box.yaw);
    dGeomSetRotation(shape, rotation);
  }
  dGeomSetPosition(shape, box.x, box.y, 0.0);
  std::optional<dBodyID> body;
  for (int part = 0; part < (wheels_meet_obstacles_ ? kNumParts : 1); ++part) {
    std::array<dContactGeom, kMostPoints> points;
    const int num_points =
        dCollide(shapes_[part], shape, kMostPoints, points.data(), sizeof(dContactGeom));
    if (num_points == 0) continue;
    if (!body) body = PushedBody(obstacle);
    dContact contact = MakeContact(obstacle_friction_);
    for (int k = 0; k < num_points; ++k) {
      contact.geom = points[k];
      dJointAttach(dJointCreateContact(world_, contacts_, &contact), parts_[part], *body);
    }
  }
  return body.has_value();
}

/// A body that moves as the obstacle does; null if it stands still, or if there is none left.
dBodyID OdeWorld::PushedBody(const sim::MovingShape& obstacle) {
  const bool moves = obstacle.vx != 0.0f || obstacle.vy != 0.0f || obstacle.yaw_rate != 0.0f;
  if (!moves || num_pushed_ == kMostPushed) return nullptr;
  const dBodyID body = pushed_[num_pushed_++];
  dBodyEnable(body);
  dBodySetPosition(body, obstacle.box.x, obstacle.box.y, 0.0);
  dBodySetLinearVel(body, obstacle.vx, obstacle.vy, 0.0);
  dBodySetAngularVel(body, 0.0, 0.0, obstacle.yaw_rate);
  return body;
}

sim::BodyState OdeWorld::state() const {
  dVector3 p, v;
  dBodyGetRelPointPos(parts_[0], -centre_C_.x(), -centre_C_.y(), -centre_C_.z(), p);
  dBodyGetRelPointVel(parts_[0], -centre_C_.x(), -centre_C_.y(), -centre_C_.z(), v);
  const dReal* const rotation = dBodyGetRotation(parts_[0]);
  return {.x = static_cast<float>(p[0]),
          .y = static_cast<float>(p[1]),
          .yaw = static_cast<float>(std::atan2(rotation[4], rotation[0])),
          .vx = static_cast<float>(v[0]),
          .vy = static_cast<float>(v[1]),
          .yaw_rate = static_cast<float>(dBodyGetAngularVel(parts_[0])[2])};
}

double OdeWorld::lift() const { return dBodyGetPosition(parts_[0])[2] - rest_[0].p[2]; }

}  // namespace

std::string OdeVersion() { return dODE_VERSION; }

std::vector<std::unique_ptr<World>> MakeOdeWorlds(const Jackal& jackal, double step, int count) {
  std::vector<std::unique_ptr<World>> worlds;
  std::optional<Rest> rest;
  for (int i = 0; i < count; ++i) {
    auto world = std::make_unique<OdeWorld>(jackal, step, rest ? &*rest : nullptr);
    rest = world->rest();
    worlds.push_back(std::move(world));
  }
  return worlds;
}

}  // namespace slalom::engines

/// Takes the place of ODE's own function, which draws from one generator for the whole process:
/// with that, a drive would depend on the work of other threads meanwhile.
extern "C" int dRandInt(int n) {
  slalom::base::Random* const order = slalom::engines::order_of_this_step;
  SLALOM_CHECK(order != nullptr);
  return static_cast<int>(order->UniformInt(static_cast<std::uint64_t>(n)));
}
