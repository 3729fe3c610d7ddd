#include "sim/contact_world.h"

#include <box2d/box2d.h>

#include <cmath>
#include <utility>

#include "sim/mass_distribution.h"

namespace slalom::sim {
namespace {

constexpr int kVelocityIterations = 8;
constexpr int kPositionIterations = 3;
// The friction of the original's wheels (docs/original-system.md, section 1.1).
constexpr float kFriction = 0.5f;
constexpr float kMargin = 0.01f;  // Obstacles this near are given to Box2D, [m].

float Reach(const RobotConfig& config) {
  const MassDistribution masses = DistributeMass(config);
  return MakeFootprint(config).Circumradius() +
         static_cast<float>(std::abs(masses.x) + std::abs(masses.y));
}

}  // namespace

Footprint MakeFootprint(const RobotConfig& config) {
  return {.half_length = static_cast<float>(0.5 * config.length),
          .half_width = static_cast<float>(0.5 * config.width)};
}

/// A Box2D world with the robot's body and, during a step, the obstacles that it may touch.
class ContactWorld::World {
 public:
  explicit World(const RobotConfig& config);
  bool Step(const CollisionMap& map, std::span<const MovingShape> moving, float dt,
            BodyState& state);

 private:
  void PlaceObstacles(const CollisionMap& map, const BodyState& state);
  void PlaceMoving(std::span<const MovingShape> moving);
  void RemoveObstacles();
  bool Touching() const;

  // Upper bound of the distance from the centre of mass to the outline's corners, [m].
  const float reach_;
  std::unique_ptr<b2World> world_;
  b2Body* robot_ = nullptr;      // Owned by world_.
  b2Body* obstacles_ = nullptr;  // The fixed obstacles. Owned by world_.
  std::vector<b2Body*> moving_;  // The moving obstacles during a step. Owned by world_.
};

ContactWorld::World::World(const RobotConfig& config)
    : reach_(Reach(config)), world_(std::make_unique<b2World>(b2Vec2(0.0f, 0.0f))) {
  world_->SetAllowSleeping(false);
  // A step must not depend on impulses of the last one. In one step (at most 0.1 m) the robot
  // cannot pass through anything, as it is wider than that itself.
  world_->SetWarmStarting(false);
  world_->SetContinuousPhysics(false);

  b2BodyDef obstacles;
  obstacles_ = world_->CreateBody(&obstacles);

  constexpr int kMostTouched = 64;
  moving_.reserve(kMostTouched);

  b2BodyDef robot;
  robot.type = b2_dynamicBody;
  robot_ = world_->CreateBody(&robot);
  const MassDistribution masses = DistributeMass(config);
  const Footprint footprint = MakeFootprint(config);
  b2PolygonShape outline;  // Box2D's origin of the body is the centre of mass.
  outline.SetAsBox(footprint.half_length, footprint.half_width,
                   {static_cast<float>(-masses.x), static_cast<float>(-masses.y)}, 0.0f);
  outline.m_radius = 0.0f;  // No skin: contact begins where the outlines meet.
  b2FixtureDef fixture;
  fixture.shape = &outline;
  fixture.friction = kFriction;
  fixture.density = 1.0f;
  robot_->CreateFixture(&fixture);
  b2MassData mass;
  mass.mass = static_cast<float>(masses.mass);
  mass.center.SetZero();
  mass.I = static_cast<float>(masses.yaw_inertia);
  robot_->SetMassData(&mass);
}

bool ContactWorld::World::Step(const CollisionMap& map, std::span<const MovingShape> moving,
                               float dt, BodyState& state) {
  robot_->SetTransform({state.x, state.y}, state.yaw);
  robot_->SetLinearVelocity({state.vx, state.vy});
  robot_->SetAngularVelocity(state.yaw_rate);
  // The robot's place in the broad phase is older than any obstacle's, so contacts are made, and
  // solved, in the order in which obstacles are placed, whatever was there before.
  PlaceObstacles(map, state);
  PlaceMoving(moving);
  world_->Step(dt, kVelocityIterations, kPositionIterations);
  const bool touching = Touching();
  const b2Vec2 p = robot_->GetPosition();
  const b2Vec2 v = robot_->GetLinearVelocity();
  state = {p.x, p.y, robot_->GetAngle(), v.x, v.y, robot_->GetAngularVelocity()};
  RemoveObstacles();
  return touching;
}

void ContactWorld::World::PlaceObstacles(const CollisionMap& map, const BodyState& state) {
  const float reach = reach_ + kMargin;
  const auto near = [&](float x, float y, float radius) {
    const float dx = x - state.x, dy = y - state.y, far = reach + radius;
    return dx * dx + dy * dy < far * far;
  };
  b2FixtureDef fixture;
  fixture.friction = kFriction;
  CollisionMap::Runs runs;
  map.FindCircles(state.x, state.y, reach, runs);
  b2CircleShape circle;
  fixture.shape = &circle;
  for (const CollisionMap::Run& run : runs.span()) {
    for (int i = run.begin; i < run.end; ++i) {
      if (!near(map.x()[i], map.y()[i], map.radius()[i])) continue;
      circle.m_p.Set(map.x()[i], map.y()[i]);
      circle.m_radius = map.radius()[i];
      obstacles_->CreateFixture(&fixture);
    }
  }
  b2PolygonShape polygon;
  fixture.shape = &polygon;
  for (const PlacedBox& box : map.boxes()) {
    if (!near(box.x, box.y, box.Circumradius())) continue;
    polygon.SetAsBox(box.half_x, box.half_y, {box.x, box.y}, box.yaw);
    polygon.m_radius = 0.0f;
    obstacles_->CreateFixture(&fixture);
  }
}

void ContactWorld::World::PlaceMoving(std::span<const MovingShape> moving) {
  for (const MovingShape& shape : moving) {
    b2BodyDef definition;
    definition.type = b2_kinematicBody;
    definition.position.Set(shape.box.x, shape.box.y);
    definition.angle = shape.box.yaw;
    definition.linearVelocity.Set(shape.vx, shape.vy);
    definition.angularVelocity = shape.yaw_rate;
    b2Body* const body = world_->CreateBody(&definition);
    b2FixtureDef fixture;
    fixture.friction = kFriction;
    b2CircleShape circle;
    circle.m_radius = shape.radius;
    b2PolygonShape polygon;
    if (shape.radius > 0.0f) {
      fixture.shape = &circle;
    } else {
      polygon.SetAsBox(shape.box.half_x, shape.box.half_y);
      polygon.m_radius = 0.0f;
      fixture.shape = &polygon;
    }
    body->CreateFixture(&fixture);
    moving_.push_back(body);
  }
}

void ContactWorld::World::RemoveObstacles() {
  for (b2Body* const body : moving_) world_->DestroyBody(body);
  moving_.clear();
  while (b2Fixture* fixture = obstacles_->GetFixtureList()) obstacles_->DestroyFixture(fixture);
}

bool ContactWorld::World::Touching() const {
  for (const b2ContactEdge* edge = robot_->GetContactList(); edge != nullptr; edge = edge->next) {
    if (edge->contact->IsTouching()) return true;
  }
  return false;
}

ContactWorld::ContactWorld(const RobotConfig& config) : config_(config) {}

ContactWorld::~ContactWorld() = default;

bool ContactWorld::Step(const CollisionMap& map, std::span<const MovingShape> moving, float dt,
                        BodyState& state) {
  std::unique_ptr<World> world;
  {
    base::MutexLock lock(mutex_);
    if (!idle_.empty()) {
      world = std::move(idle_.back());
      idle_.pop_back();
    }
  }
  if (!world) world = std::make_unique<World>(config_);
  const bool touched = world->Step(map, moving, dt, state);
  base::MutexLock lock(mutex_);
  idle_.push_back(std::move(world));
  return touched;
}

}  // namespace slalom::sim
