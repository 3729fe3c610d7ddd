#include "sim/environments.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "base/error.h"

namespace slalom::sim {
namespace {

constexpr int kMaxStartDraws = 1000;
constexpr int kGroup = SkidLanes::kSize;    // Environments that are stepped together.
constexpr double kMotionTimeSpan = 1000.0;  // Many rounds of any obstacle of the paper, [s].

const EnvironmentConfig& Checked(const EnvironmentConfig& config) {
  CheckConsistent(config);
  return config;
}

std::unique_ptr<env::ObstacleTracker> MakeTracker(const EnvironmentConfig& config) {
  return std::make_unique<env::ObstacleTracker>(ScanGeometryOf(config), config.episode.step);
}

/// Place [m] and velocity [m/s] of each of the obstacles that are nearest at motion time `time`
/// [s], in the robot's frame.
auto NearestObstacles(const MovingObstacles& moving, double time, const base::Pose2& X_WR) {
  constexpr int kMost = env::kObservedObstacles;
  const auto [sine, cosine] = base::SinCos(X_WR.yaw);
  const auto s = static_cast<float>(sine), c = static_cast<float>(cosine);
  std::array<std::array<double, 4>, kMost> nearest{};
  std::array<float, kMost> distances;  // To the circles round them, [m].
  int size = 0;
  for (int i = 0; i < moving.size(); ++i) {
    const MovingShape shape = moving.At(i, time);
    const float dx = shape.box.x - static_cast<float>(X_WR.p.x);
    const float dy = shape.box.y - static_cast<float>(X_WR.p.y);
    const float distance = std::hypot(dx, dy) - moving.circumradius(i);
    const auto known = std::span(distances).first(size);
    const auto place = std::ranges::upper_bound(known, distance) - known.begin();
    if (place == kMost) continue;
    size = std::min(size + 1, kMost);
    std::shift_right(distances.begin() + place, distances.begin() + size, 1);
    std::shift_right(nearest.begin() + place, nearest.begin() + size, 1);
    distances[place] = distance;
    nearest[place] = {c * dx + s * dy, c * dy - s * dx, c * shape.vx + s * shape.vy,
                      c * shape.vy - s * shape.vx};
  }
  return std::bit_cast<std::array<double, 4 * kMost>>(nearest);
}

}  // namespace

CourseEnvironments::CourseEnvironments(const EnvironmentConfig& config,
                                       std::vector<std::shared_ptr<const Scene>> scenes,
                                       int batch_size, base::ParallelFor* parallel,
                                       const MakeRobotBodies& make_bodies,
                                       std::unique_ptr<SceneStream> fresh)
    : config_(Checked(config)),
      state_writer_(config.observation, config.action),
      scenes_(std::move(scenes)),
      fresh_(std::move(fresh)),
      make_bodies_(make_bodies),
      footprint_(MakeFootprint(config.robot)),
      lidar_(config.lidar, config.observation.range_clip),
      parallel_(parallel) {
  SLALOM_CHECK_GE(batch_size, 1);
  SLALOM_CHECK(!scenes_.empty() || fresh_ != nullptr);
  int max_moving = 0;
  for (const auto& scene : scenes_) {
    SLALOM_CHECK(scene != nullptr);
    RequireDrivable(*scene);
    max_moving = std::max(max_moving, scene->moving_obstacles().size());
  }
  if (fresh_) RequireDrivable(*fresh_->Get(0));  // It stands for all.
  environments_.reserve(batch_size);
  for (auto& body : make_bodies(config, scenes_, batch_size)) {
    Environment& environment = environments_.emplace_back(std::move(body), config);
    environment.moving.Reserve(max_moving);
    if (config.observation.tracked) environment.tracker = MakeTracker(config);
    if (config.randomize.empty()) continue;
    environment.task = std::make_unique<RandomizedConfig>(config);
    if (environment.task->draws("lidar")) environment.lidar = std::make_unique<Lidar>(lidar_);
  }
  SLALOM_CHECK_EQ(static_cast<int>(environments_.size()), batch_size);
  if (environments_[0].task) RequireBodies(*environments_[0].task);
  observations_.Resize(batch_size, config.lidar.num_beams, env::StateSize(config.observation));
}

void CourseEnvironments::RequireDrivable(const Scene& scene) const {
  const base::Pose2& start = scene.course().start;
  base::ThrowIf(
      Touches(scene, start),
      "course '{}': a robot of {} x {} m touches an obstacle at the start pose ({} m, {} m, {} "
      "rad)",
      scene.course().name, config_.robot.length, config_.robot.width, start.p.x, start.p.y,
      start.yaw);
  base::ThrowIf(
      !DrawStart(scene, 0),
      "course '{}': moving obstacles touch a robot of {} x {} m at the start pose ({} m, {} m, "
      "{} rad) at each of {} times",
      scene.course().name, config_.robot.length, config_.robot.width, start.p.x, start.p.y,
      start.yaw, kMaxStartDraws);
}

/// Throws the error of a physics that cannot represent a robot that may be drawn, as far as the
/// ends of single fields tell.
void CourseEnvironments::RequireBodies(RandomizedConfig& task) const {
  const std::span<const RandomizedField> fields = task.fields();
  std::vector<double> values;
  for (const RandomizedField& field : fields) values.push_back(field.low);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (!fields[i].key.starts_with("robot.")) continue;
    const auto make = [&](double value) {
      values[i] = value;
      task.Set(values);
      make_bodies_(task.config(), {}, 1);
    };
    for (std::size_t k = 0; k < fields[i].names.size(); ++k) make(static_cast<double>(k));
    if (fields[i].names.empty()) make(fields[i].high);
    make(fields[i].low);
  }
}

void CourseEnvironments::DrawTask(Environment& environment, std::uint64_t seed) const {
  RandomizedConfig& task = *environment.task;
  task.Draw(seed);
  const EnvironmentConfig& config = task.config();
  if (task.draws("robot")) {
    environment.robot = std::move(make_bodies_(config, {&environment.scene, 1}, 1).front());
  }
  if (environment.lidar) {
    environment.lidar->Configure(config.lidar, config.observation.range_clip);
    if (environment.tracker) environment.tracker = MakeTracker(config);
  }
  environment.localisation = Localisation(config.localisation);
  environment.speed_sensor.Configure(config.localisation);
}

void CourseEnvironments::Reset(int i, const env::EpisodeSpec& spec) {
  SLALOM_CHECK_GE(i, 0);
  SLALOM_CHECK_LT(i, batch_size());
  SLALOM_CHECK_GE(spec.course, 0);
  Environment& environment = environments_[i];
  if (spec.course < num_courses()) {
    environment.scene = scenes_[spec.course];
  } else {
    SLALOM_CHECK(has_fresh_courses());
    environment.scene = fresh_->Get(spec.course - num_courses());
  }
  if (environment.task) DrawTask(environment, spec.seed);
  const Scene& scene = *environment.scene;
  const Start start = DrawStart(scene, spec.seed).value_or(Start{scene.course().start});
  environment.robot->Reset(start.X_WR, base::DeriveSeed(spec.seed, "command jitter"));
  environment.motion_start = environment.motion_time = start.motion_time;
  environment.localisation.Reset(environment.robot->pose(),
                                 base::DeriveSeed(spec.seed, "localisation drift"));
  environment.lidar_noise = base::Random(base::DeriveSeed(spec.seed, "lidar noise"));
  environment.speed_sensor.Reset(base::DeriveSeed(spec.seed, "speed noise"));
  if (environment.tracker) environment.tracker->Reset();
  std::ranges::fill(environment.actions, config_.action.Standstill());
  environment.goal_distance = base::Norm(scene.course().goal_W - environment.robot->pose().p);
  environment.num_steps = 0;
  environment.running = true;
  observations_.first[i] = 1;
  observations_.ended[i] = 0;
  Observe(i);
}

std::optional<CourseEnvironments::Start> CourseEnvironments::DrawStart(const Scene& scene,
                                                                       std::uint64_t seed) const {
  const EpisodeConfig& episode = config_.episode;
  const base::Pose2& start = scene.course().start;
  const MovingObstacles& moving = scene.moving_obstacles();
  base::Random random(base::DeriveSeed(seed, "start pose"));
  base::Random random_time(base::DeriveSeed(seed, "motion time"));
  for (int draw = 0; draw < kMaxStartDraws; ++draw) {
    const double x = random.Uniform(-episode.start_position_jitter, episode.start_position_jitter);
    const double y = random.Uniform(-episode.start_position_jitter, episode.start_position_jitter);
    const double yaw = random.Uniform(-episode.start_yaw_jitter, episode.start_yaw_jitter);
    const base::Pose2 drawn{start.p + base::Vec2{x, y}, start.yaw + yaw};
    const double time = moving.empty() ? 0.0 : random_time.Uniform(0.0, kMotionTimeSpan);
    if (Touches(scene, drawn)) continue;
    const FootprintPose X_WR =
        MakeFootprintPose(static_cast<float>(drawn.p.x), static_cast<float>(drawn.p.y),
                          static_cast<float>(drawn.yaw));
    if (!moving.Touch(time, footprint_, X_WR)) return Start{drawn, time};
  }
  return std::nullopt;
}

bool CourseEnvironments::Touches(const Scene& scene, const base::Pose2& X_WR) const {
  constexpr float kLimit = 0.1f;  // [m]
  return scene.collision_map().Clearance(footprint_, static_cast<float>(X_WR.p.x),
                                         static_cast<float>(X_WR.p.y), static_cast<float>(X_WR.yaw),
                                         kLimit) <= 0.0f;
}

void CourseEnvironments::Step(std::span<const float> actions, std::span<env::StepResult> results) {
  actions_ = env::AsActions(actions);
  SLALOM_CHECK_EQ(actions_.size(), environments_.size());
  SLALOM_CHECK_EQ(results.size(), environments_.size());
  results_ = results;
  const int num_groups = (batch_size() + kGroup - 1) / kGroup;
  // Robots drive in groups. Scans, which take longer, are then done one by one, so that no thread
  // waits long for the last.
  base::For(parallel_, num_groups, [this](int group) { DriveGroup(group); });
  base::For(parallel_, batch_size(), [this](int i) { EndStep(i); });
}

void CourseEnvironments::DriveGroup(int group) {
  const int begin = group * kGroup, end = std::min(begin + kGroup, batch_size());
  std::array<RobotBody::Order, kGroup> orders;
  int num_orders = 0;
  for (int i = begin; i < end; ++i) {
    if (environments_[i].running) orders[num_orders++] = OrderFor(environments_[i], actions_[i]);
  }
  if (num_orders == 0) return;
  orders[0].robot->DriveTogether(std::span(orders).first(num_orders));
  num_orders = 0;
  for (int i = begin; i < end; ++i) {
    if (environments_[i].running) environments_[i].touched = orders[num_orders++].touched;
  }
}

void CourseEnvironments::EndStep(int i) {
  Environment& environment = environments_[i];
  if (!environment.running) return;
  results_[i] = ResultOf(environment);
  observations_.first[i] = 0;
  observations_.ended[i] = environment.running ? 0 : 1;
  Observe(i);
}

RobotBody::Order CourseEnvironments::OrderFor(Environment& environment,
                                              const env::Action& action) const {
  SLALOM_CHECK(std::isfinite(action.linear) && std::isfinite(action.angular));
  const env::Action clipped{std::clamp(action.linear, -1.0f, 1.0f),
                            std::clamp(action.angular, -1.0f, 1.0f)};
  std::shift_right(environment.actions.begin(), environment.actions.end(), 1);
  environment.actions.front() = clipped;
  return {.robot = environment.robot.get(),
          .scene = environment.scene.get(),
          .linear = config_.action.linear_mps(clipped),
          .angular = config_.action.angular_radps(clipped),
          .motion_time = environment.motion_time};
}

env::StepResult CourseEnvironments::ResultOf(Environment& environment) const {
  const Scene& scene = *environment.scene;
  const bool collided = environment.touched;
  environment.localisation.Advance(environment.robot->pose(), environment.robot->drive().rolled());
  ++environment.num_steps;
  environment.motion_time = environment.motion_start + environment.num_steps * config_.episode.step;

  const double distance = base::Norm(scene.course().goal_W - environment.robot->pose().p);
  double reward =
      config_.reward.progress * (environment.goal_distance - distance) - config_.reward.slack;
  environment.goal_distance = distance;
  env::StepResult result;
  if (collided) {
    result.cost = 1.0f;
    reward -= config_.reward.collision;
  }
  if (collided && config_.episode.collision_ends) {
    result.outcome = env::Outcome::kCollision;
  } else if (IsLookedAt(environment) && HasArrived(environment)) {
    result.outcome = env::Outcome::kSuccess;
    reward += config_.reward.success;
  } else if (environment.num_steps >= config_.episode.max_steps) {
    result.outcome = env::Outcome::kTimeout;
    reward -= config_.reward.timeout;
  }
  result.reward = static_cast<float>(reward);
  environment.running = !result.ended();
  return result;
}

/// Whether a period of looking ends with the present step.
bool CourseEnvironments::IsLookedAt(const Environment& environment) const {
  const double period = config_.episode.look_period;
  if (period <= 0.0) return true;
  const auto num_looks = [&](int steps) {
    return std::floor((steps * config_.episode.step + 1e-9) / period);
  };
  return num_looks(environment.num_steps) > num_looks(environment.num_steps - 1);
}

bool CourseEnvironments::HasArrived(const Environment& environment) const {
  const Localisation& localisation = environment.localisation;
  const double distance =
      localisation.decides_arrival()
          ? base::Norm(localisation.InRobotFrame(environment.scene->course().goal_W))
          : environment.goal_distance;
  if (distance < config_.episode.goal_tolerance) return true;
  if (config_.episode.finish_ahead <= 0.0) return false;
  const base::Pose2& start = environment.scene->course().start;
  const base::Vec2 gone = base::InverseTransform(start, environment.robot->pose().p);
  return gone.x >= config_.episode.finish_ahead;
}

void CourseEnvironments::Observe(int i) {
  Environment& environment = environments_[i];
  const Scene& scene = *environment.scene;
  const base::Pose2 X_WR = environment.robot->pose();
  const MovingObstacles& moving = scene.moving_obstacles();
  if (!moving.empty()) moving.PlaceAll(environment.motion_time, environment.moving);
  const Lidar& lidar = environment.lidar ? *environment.lidar : lidar_;
  lidar.Scan(scene.collision_map(), X_WR, environment.lidar_noise, observations_.mutable_ranges(i),
             moving.empty() ? nullptr : &environment.moving);
  const base::Vec2 goal_R = environment.localisation.InRobotFrame(scene.course().goal_W);
  const BodyState& body = environment.robot->body();
  const auto [s, c] = base::SinCos(X_WR.yaw);
  const double forward = c * body.vx + s * body.vy, turn_rate = body.yaw_rate;
  const double speed =
      environment.localisation.from_wheels() ? environment.robot->drive().speed() : forward;
  observations_.odometry[i] = {environment.localisation.X_OR(), speed, turn_rate};

  const auto write = [this, state = observations_.mutable_state(i)](std::size_t field,
                                                                    const auto& values) {
    state_writer_.Write(field, values, state);
  };
  write(env::FieldOf("goal"), std::array{goal_R.x, goal_R.y});
  const std::span<const env::Action> actions = environment.actions;
  write(env::FieldOf("last action"), env::NumbersOf(actions.first(1)));
  write(env::FieldOf("earlier action"), env::NumbersOf(actions.subspan(1)));
  if (config_.observation.speeds) {
    const Speeds seen = environment.speed_sensor.Observe({speed, turn_rate});
    write(env::FieldOf("speeds"), std::array{seen.forward, seen.turn_rate});
  }
  write(env::FieldOf("mounting"), std::array{lidar.mounting().x, lidar.mounting().y});
  if (environment.tracker) {
    const base::Pose2& X_OR = observations_.odometry[i].X_OR;
    environment.tracker->Update(observations_.frame(i).ranges_cm, X_OR);
    write(env::FieldOf("tracked obstacle"), environment.tracker->Observe(X_OR));
  }
  if (!config_.observation.privileged) return;
  write(env::FieldOf("true speeds"), std::array{forward, turn_rate});
  write(env::FieldOf("nearest obstacle"), NearestObstacles(moving, environment.motion_time, X_WR));
  const RobotConfig& drive = environment.task ? environment.task->config().robot : config_.robot;
  write(env::FieldOf("drive"),
        std::array{drive.command_delay, drive.command_jitter, drive.speed_gain - 1.0,
                   drive.yaw_gain - 1.0, drive.linear_acceleration, drive.angular_acceleration});
}

}  // namespace slalom::sim
