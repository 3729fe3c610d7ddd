#include "planners/guard/shield.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/check.h"

namespace slalom::planners {
namespace {

constexpr double kTick = 0.02;       // About the time of a step of the prediction, [s].
constexpr int kTicksPerLook = 2;     // The outline is held against the points so often,
constexpr int kTicksPerFarLook = 4;  // and on the way to escape.
constexpr int kLinearChoices = 11;   // Of the commands to fall back on.
constexpr int kAngularChoices = 13;  // Odd, so that one drives straight ahead.
constexpr double kKeptBeyond = 2.0;  // Points are kept up to so far beyond those that matter, [m].
constexpr double kStands = 0.01;     // A robot that moves less in a step stands, [m] and [rad].
constexpr double kMaxBraking = 3.0;  // [s]
constexpr double kSpacing = 0.015f;  // Points that are closer together count as one, [m].
constexpr int kSameSurfaceCm = 10;   // Neighbours whose ranges differ by less are of one surface.
// Each range becomes the mean of its neighbours', to each side at least and at most so many, as few
// as the noise allows, and of at most so much of a surface, [m]: a mean rounds corners off.
constexpr int kLeastNeighbours = 2, kMostNeighbours = 12;
constexpr double kSmoothed = 0.02;
// The margin is kept by a robot whose corners move that fast, [m/s]; a slower one keeps less of it,
// in proportion, but at least this share: errors of a prediction grow with the way.
constexpr float kFullMarginSpeed = 0.6f, kLeastMarginShare = 0.25f;
constexpr float kSlack = 0.005f;  // How much closer a robot may come in a step, [m].
constexpr float kFar = std::numeric_limits<float>::infinity();
// Of what moves. A way to escape is held for a while before the robot brakes, and looked at up to
// the horizon.
constexpr double kEscapeTime = 0.6, kHorizon = 1.4;  // [s]
constexpr int kCoarseLinearChoices = 6, kCoarseAngularChoices = 7;
constexpr double kMovingSpacing = 0.04;  // Of its points, [m].
constexpr int kHiddenPoints = 8;         // Of a track that is hidden.
// The margin to it grows by what its speed may be wrong by, and by how it may speed up or turn.
constexpr float kSpeedError = 0.1f, kAccelerationError = 0.15f;  // [m/s], [m/s^2]

int NumTicks(double time, double step) {
  const double tick = step / std::max(1.0, std::round(step / kTick));
  return static_cast<int>(std::ceil(time / tick - 1e-9));
}

float Around(const RobotModel& robot) {
  return static_cast<float>(std::hypot(0.5 * robot.length + std::abs(robot.centre_x),
                                       0.5 * robot.width + std::abs(robot.centre_y)));
}

/// The way of a robot at its greatest speed for that time, until it has braked.
double LongestWay(const RobotModel& robot, double time) {
  const double speed = robot.linear_limit;
  const double braking = robot.slips
                             ? std::min(robot.linear_acceleration, robot.friction * kGravity)
                             : robot.linear_acceleration;
  return speed * (robot.delay + time + 0.5 * speed / braking);
}

std::vector<Twist> GridOf(const env::ActionBounds& bounds, int num_linear, int num_angular) {
  std::vector<Twist> grid;
  for (int i = 0; i < num_linear; ++i) {
    for (int j = 0; j < num_angular; ++j) {
      const env::Action action{2.0f * i / (num_linear - 1) - 1.0f,
                               2.0f * j / (num_angular - 1) - 1.0f};
      grid.push_back({bounds.linear_mps(action), bounds.angular_radps(action)});
    }
  }
  return grid;
}

/// From the outlines of robots to the nearest of some points, [m].
class Clearance {
 public:
  /// Points farther than `reach` [m] from all robots may be left out.
  Clearance(const Motion& motion, const RobotModel& robot, float reach)
      : motion_(motion),
        min_x_(motion.x.minCoeff() - reach),
        max_x_(motion.x.maxCoeff() + reach),
        min_y_(motion.y.minCoeff() - reach),
        max_y_(motion.y.maxCoeff() + reach),
        middle_x_(static_cast<float>(robot.centre_x)),
        middle_y_(static_cast<float>(robot.centre_y)),
        half_length_(static_cast<float>(0.5 * robot.length)),
        half_width_(static_cast<float>(0.5 * robot.width)) {}

  void Add(float x, float y) {
    if (x < min_x_ || x > max_x_ || y < min_y_ || y > max_y_) return;
    const Lanes dx = x - motion_.x, dy = y - motion_.y;
    const Lanes ahead = (motion_.cos * dx + motion_.sin * dy + middle_x_).abs() - half_length_;
    const Lanes aside = (motion_.cos * dy - motion_.sin * dx + middle_y_).abs() - half_width_;
    side_ = side_.min(ahead.max(aside));
    const Lanes out_ahead = ahead.max(0.0f), out_aside = aside.max(0.0f);
    square_ = square_.min(out_ahead * out_ahead + out_aside * out_aside);
  }
  /// Negative inside; infinite without a point.
  Lanes Least() const { return (side_ < 0.0f).select(side_, square_.sqrt()); }

 private:
  const Motion& motion_;
  const float min_x_, max_x_, min_y_, max_y_;                   // [m]
  const float middle_x_, middle_y_, half_length_, half_width_;  // [m]
  // To the outline's sides, and the square of the distance outside.
  Lanes side_ = Lanes::Constant(kFar), square_ = Lanes::Constant(kFar);
};

/// How many neighbours to each side it takes to bring the noise of a scan down to half a
/// centimetre. The noise is known by the median of the ranges' second differences, which are small
/// on surfaces.
int NeighboursFor(std::span<const std::uint16_t> ranges_cm) {
  std::array<std::size_t, 32> counts{};
  for (std::size_t i = 2; i < ranges_cm.size(); ++i) {
    const int difference = std::abs(ranges_cm[i - 2] - 2 * ranges_cm[i - 1] + ranges_cm[i]);
    ++counts[std::min<std::size_t>(difference, counts.size() - 1)];
  }
  std::size_t median = 0;
  for (std::size_t below = counts[0]; 2 * below + 2 < ranges_cm.size(); below += counts[median]) {
    ++median;
  }
  const double noise = static_cast<double>(median) / (0.6745 * std::sqrt(6.0));  // [cm]
  return std::clamp(static_cast<int>(2.0 * noise * noise), kLeastNeighbours, kMostNeighbours);
}

}  // namespace

Shield::Shield(const GuardConfig& config, const RobotModel& robot,
               const env::ScanGeometry& geometry, const env::ActionBounds& bounds, double step)
    : config_(config),
      robot_(robot),
      geometry_(geometry),
      bounds_(bounds),
      step_ticks_(NumTicks(step, step)),
      delay_ticks_(NumTicks(robot.delay, step)),
      least_delay_ticks_(std::min(NumTicks(robot.least_delay, step), delay_ticks_)),
      memory_steps_(static_cast<int>(std::lround(config.memory / step))),
      drive_(robot, step / step_ticks_),
      tick_(step / step_ticks_),
      escape_ticks_(NumTicks(kEscapeTime, step)),
      horizon_ticks_(NumTicks(kHorizon, step)),
      around_(Around(robot)),
      reach_(LongestWay(robot, step + (config.tracking ? kEscapeTime : 0.0)) + Around(robot) +
             config.margin),
      kept_(reach_ + kKeptBeyond),
      cos_view_(std::cos(0.5 * geometry.field_of_view)),
      angle_step_(geometry.field_of_view / (geometry.num_beams - 1)),
      directions_R_(env::BeamDirections(geometry)),
      grid_(GridOf(bounds, kLinearChoices, kAngularChoices)),
      coarse_grid_(GridOf(bounds, kCoarseLinearChoices, kCoarseAngularChoices)) {
  const auto ahead = static_cast<float>(bounds.linear_mps({1.0f, 0.0f}));
  const auto back = static_cast<float>(bounds.linear_mps({-1.0f, 0.0f}));
  const auto left = static_cast<float>(bounds.angular_radps({0.0f, 1.0f}));
  // The first brakes; the second is replaced by the command itself.
  escape_linear_ << 0.0f, 0.0f, ahead, ahead, ahead, back, 0.5f * ahead, 0.5f * ahead;
  escape_angular_ << 0.0f, 0.0f, 0.0f, 0.5f * left, -0.5f * left, 0.0f, left, -left;
  Reset();
}

void Shield::Reset() {
  points_.clear();
  near_.clear();
  moving_.clear();
  sent_.assign(2 + delay_ticks_ / step_ticks_, Twist{});
  now_ = start_ = Motion{};
  promised_ = -kFar;
}

/// The command on which the drive acts in that tick from now on, if it acts after a delay of so
/// many ticks. The last one was sent a step ago.
Twist Shield::CommandAt(int tick, int delay) const {
  int sent = -step_ticks_;
  for (const Twist& command : sent_) {
    if (sent + delay <= tick) return command;
    sent -= step_ticks_;
  }
  return sent_.back();
}

/// Moves the robot on by what it was told, on which it acts after a delay of so many ticks.
void Shield::Drive(int begin, int end, int delay, Motion& motion) const {
  for (int tick = begin; tick < end; ++tick) {
    const Twist command = CommandAt(tick, delay);
    drive_.Step(Lanes::Constant(static_cast<float>(command.linear)),
                Lanes::Constant(static_cast<float>(command.angular)), motion);
  }
}

void Shield::See(std::span<const std::uint16_t> ranges_cm, const env::Odometry& odometry,
                 std::span<const env::Track> tracks) {
  SLALOM_CHECK_EQ(ranges_cm.size(), directions_R_.size());
  // Nothing is forgotten while the robot stands: what is behind it is still there.
  moves_ = base::Norm(odometry.X_OR.p - X_OR_.p) > kStands ||
           std::abs(base::WrapAngle(odometry.X_OR.yaw - X_OR_.yaw)) > kStands;
  X_OR_ = odometry.X_OR;
  LookAround(ranges_cm, tracks);

  // What the odometry does not tell is how it was predicted: slip to the side, and the wheels.
  Drive(-step_ticks_, 0, delay_ticks_, now_);
  now_.x.setZero();
  now_.y.setZero();
  now_.sin.setZero();
  now_.cos.setOnes();
  now_.ahead.setConstant(static_cast<float>(odometry.linear - odometry.angular * robot_.centre_y));
  now_.yaw_rate.setConstant(static_cast<float>(odometry.angular));

  start_ = now_;
  room_ = RoomAmong(start_, 0)[0];
  for (int tick = 0; tick < delay_ticks_; tick += kTicksPerLook) {
    const int end = std::min(tick + kTicksPerLook, delay_ticks_);
    Drive(tick, end, delay_ticks_, start_);
    room_ = std::min(room_, RoomAmong(start_, end)[0]);
  }
  if (least_delay_ticks_ == delay_ticks_) return;
  early_start_ = now_;
  Drive(0, least_delay_ticks_, least_delay_ticks_, early_start_);
}

/// The mean of a range and of its neighbours on the same surface, [m]. So noise does not bring the
/// nearest of many beams nearer, or a robot would creep up to a wall, and a pole that one beam hits
/// stays.
double Shield::Smoothed(std::span<const std::uint16_t> ranges_cm, int beam, int neighbours) const {
  const int range = ranges_cm[beam];
  const double spacing = 0.01 * std::max(range, 1) * angle_step_;
  const int half = std::clamp(static_cast<int>(kSmoothed / spacing), kLeastNeighbours, neighbours);
  int count = 0, sum = 0;
  const int last = std::min(beam + half, geometry_.num_beams - 1);
  for (int k = std::max(beam - half, 0); k <= last; ++k) {
    const int other = ranges_cm[k];
    if (std::abs(other - range) > kSameSurfaceCm) continue;
    sum += other;
    ++count;
  }
  return 0.01 * sum / count;
}

/// Takes the near points of the scan, and keeps those seen before in directions where the range
/// finder does not look now. Lists those that matter, the nearest first.
void Shield::LookAround(std::span<const std::uint16_t> ranges_cm,
                        std::span<const env::Track> tracks) {
  const int neighbours = NeighboursFor(ranges_cm);
  is_moving_.assign(ranges_cm.size(), 0);
  moving_.clear();
  for (const env::Track& track : tracks) AddTrack(ranges_cm, track, neighbours);
  near_.clear();
  const base::SinCosResult yaw = base::SinCos(X_OR_.yaw);
  const auto matters = [&](base::Vec2 p_R) {
    const auto x = static_cast<float>(p_R.x - robot_.centre_x);
    const auto y = static_cast<float>(p_R.y - robot_.centre_y);
    const float distance = std::sqrt(x * x + y * y);
    if (distance <= static_cast<float>(reach_)) near_.push_back({x, y, distance});
    return distance <= static_cast<float>(kept_);
  };
  std::erase_if(points_, [&](Point& point) {
    if ((point.age += moves_) > memory_steps_) return true;
    const base::Vec2 d = point.p_O - X_OR_.p;
    const base::Vec2 p_R = {yaw.cos * d.x + yaw.sin * d.y, yaw.cos * d.y - yaw.sin * d.x};
    const base::Vec2 p_S = p_R - geometry_.p_RS;
    if (p_S.x >= cos_view_ * base::Norm(p_S)) return true;  // It is looked at.
    return !matters(p_R);
  });
  const double reach = kept_ + base::Norm(geometry_.p_RS) + around_;
  const int longest = static_cast<int>(100.0 * std::min(reach, geometry_.clip - 0.005));
  base::Vec2 last{1e9, 1e9};
  for (int i = 0; i < geometry_.num_beams; ++i) {
    if (ranges_cm[i] > longest || is_moving_[i] != 0) continue;
    const base::Vec2 p_R = geometry_.p_RS + Smoothed(ranges_cm, i, neighbours) * directions_R_[i];
    const base::Vec2 way = p_R - last;
    if (base::Dot(way, way) < kSpacing * kSpacing || !matters(p_R)) continue;
    last = p_R;
    points_.push_back(
        {X_OR_.p + base::Vec2{yaw.cos * p_R.x - yaw.sin * p_R.y, yaw.sin * p_R.x + yaw.cos * p_R.y},
         0});
  }
  std::ranges::sort(near_, {}, &NearPoint::distance);
}

/// Takes the points that show what moves, if it can come near within the horizon; those of a circle
/// if it is hidden.
void Shield::AddTrack(std::span<const std::uint16_t> ranges_cm, const env::Track& track,
                      int neighbours) {
  const base::Vec2 v_R = base::InverseTransform({{}, X_OR_.yaw}, track.v_O);
  const double way = (robot_.delay + step_ticks_ * tick_ + kHorizon) * base::Norm(v_R);
  const auto add = [&](base::Vec2 p_R) {
    const base::Vec2 p_C = p_R - base::Vec2{robot_.centre_x, robot_.centre_y};
    if (base::Norm(p_C) > reach_ + way) return;
    moving_.push_back({static_cast<float>(p_C.x), static_cast<float>(p_C.y),
                       static_cast<float>(v_R.x), static_cast<float>(v_R.y)});
  };
  if (track.first_beam == track.end_beam) {
    const base::Vec2 middle_R = base::InverseTransform(X_OR_, track.p_O);
    for (int k = 0; k < kHiddenPoints; ++k) {
      const auto [s, c] = base::SinCos(2.0 * base::kPi * k / kHiddenPoints);
      add(middle_R + track.radius * base::Vec2{c, s});
    }
    return;
  }
  base::Vec2 last{1e9, 1e9};
  for (int i = track.first_beam; i < track.end_beam; ++i) {
    is_moving_[i] = 1;
    if (0.01 * ranges_cm[i] >= geometry_.clip) continue;
    const base::Vec2 p_R = geometry_.p_RS + Smoothed(ranges_cm, i, neighbours) * directions_R_[i];
    if (base::Norm(p_R - last) < kMovingSpacing && i + 1 < track.end_beam) continue;
    last = p_R;
    add(p_R);
  }
}

/// From the outline to the nearest point, negative inside; infinite if much more than the margin.
Lanes Shield::RoomAt(const Motion& m) const {
  const float way = std::sqrt((m.x * m.x + m.y * m.y).maxCoeff());
  const float reach = around_ + static_cast<float>(config_.margin);
  Clearance clearance(m, robot_, reach);
  for (const NearPoint& point : near_) {
    if (point.distance > way + reach) break;
    clearance.Add(point.x, point.y);
  }
  return clearance.Least();
}

/// From the outline to the nearest point that moves, so many ticks after it was seen, less what
/// nobody knows of its motion.
Lanes Shield::RoomToMoving(const Motion& m, int tick) const {
  const auto time = static_cast<float>(tick * tick_);
  const float unknown = time * (kSpeedError + 0.5f * time * kAccelerationError);
  Clearance clearance(m, robot_, around_ + static_cast<float>(config_.margin) + unknown);
  for (const MovingPoint& point : moving_) {
    clearance.Add(point.x + time * point.vx, point.y + time * point.vy);
  }
  return clearance.Least() - unknown;
}

Lanes Shield::RoomAmong(const Motion& motion, int tick) const {
  return RoomAt(motion).min(RoomToMoving(motion, tick));
}

/// The least room from when the commands begin to act until the robots stand, whether they begin
/// as late as they may, or as early as they may and end late.
Lanes Shield::RoomOf(const Lanes& linear, const Lanes& angular) const {
  Lanes late = RoomFrom(start_, step_ticks_, linear, angular);
  if (least_delay_ticks_ == delay_ticks_) return late;
  const int ticks = step_ticks_ + delay_ticks_ - least_delay_ticks_;
  return late.min(RoomFrom(early_start_, ticks, linear, angular));
}

/// The least room of robots that take the commands for so many ticks, and then brake.
Lanes Shield::RoomFrom(Motion motion, int num_ticks, const Lanes& linear,
                       const Lanes& angular) const {
  Lanes room = Lanes::Constant(kFar);
  const auto drive = [&](const Lanes& v, const Lanes& w, int ticks, bool brakes) {
    for (int tick = 0; tick < ticks; ++tick) {
      drive_.Step(v, w, motion);
      if (tick % kTicksPerLook != kTicksPerLook - 1 && tick + 1 != ticks) continue;
      room = room.min(RoomAt(motion));
      if (brakes && (motion.ahead.abs() < 0.02f && motion.yaw_rate.abs() < 0.1f).all()) return;
    }
  };
  drive(linear, angular, num_ticks, false);
  drive(Lanes::Zero(), Lanes::Zero(), static_cast<int>(kMaxBraking / kTick), true);
  return room;
}

/// The least room of a robot that takes the command for so many ticks and then escapes, a lane for
/// each way to escape. It acts on the command from tick `begin` on. May end early if none leaves
/// more than `least`.
Lanes Shield::RoomOfEscapes(Motion motion, int begin, int num_ticks, const Twist& command,
                            float least) const {
  Lanes room = Lanes::Constant(kFar);
  int time = begin;
  const auto drive = [&](const Lanes& v, const Lanes& w, int ticks, int ticks_per_look) {
    for (int tick = 0; tick < ticks && room.maxCoeff() > least; ++tick) {
      drive_.Step(v, w, motion);
      ++time;
      if (tick % ticks_per_look != ticks_per_look - 1 && tick + 1 != ticks) continue;
      room = room.min(RoomAmong(motion, time));
    }
  };
  const auto v = static_cast<float>(command.linear), w = static_cast<float>(command.angular);
  drive(Lanes::Constant(v), Lanes::Constant(w), num_ticks, kTicksPerLook);
  Lanes linear = escape_linear_, angular = escape_angular_;
  linear[1] = v;
  angular[1] = w;
  drive(linear, angular, escape_ticks_, kTicksPerFarLook);
  drive(Lanes::Zero(), Lanes::Zero(), horizon_ticks_ - escape_ticks_, kTicksPerFarLook);
  return room;
}

/// The room that a command leaves by the best way to escape after it, or at most `least`.
float Shield::RoomToEscape(const Twist& command, float least) const {
  Lanes room = RoomOfEscapes(start_, delay_ticks_, step_ticks_, command, least);
  if (least_delay_ticks_ != delay_ticks_) {
    const int ticks = step_ticks_ + delay_ticks_ - least_delay_ticks_;
    room = room.min(RoomOfEscapes(early_start_, least_delay_ticks_, ticks, command, least));
  }
  return room.maxCoeff();
}

/// The part of `guard.margin` that is kept at the speed of a command, or at the robot's if that is
/// greater, [m].
float Shield::MarginOf(const Twist& command) const {
  const double linear = std::max(std::abs(command.linear), std::abs(double{now_.ahead[0]}));
  const double angular = std::max(std::abs(command.angular), std::abs(double{now_.yaw_rate[0]}));
  const auto speed = static_cast<float>(linear + around_ * angular);
  return std::clamp(speed / kFullMarginSpeed, kLeastMarginShare, 1.0f) *
         static_cast<float>(config_.margin);
}

Shield::Choice Shield::Choose(Twist wanted) {
  const auto send = [this](const Choice& choice) {
    std::shift_right(sent_.begin(), sent_.end(), 1);
    sent_.front() = choice.command;
    promised_ = static_cast<float>(std::min(choice.clearance, config_.margin)) - kSlack;
    return choice;
  };
  const bool evades = !moving_.empty();
  if (near_.empty() && !evades) return send({wanted, false, kFar});
  // No closer than the margin or, if the robot is closer already, hardly closer than it is, and
  // than the last command would have brought it: noise gives no leave to come closer.
  const float kept = std::max(room_, promised_);
  const float least = kept - std::clamp(0.1f * kept, 0.0f, kSlack);
  const auto enough = [this, least](const Twist& command) {
    return std::min(MarginOf(command), least);
  };

  choices_.clear();
  const env::Action asked = bounds_.Scale(wanted.linear, wanted.angular);
  const auto add = [&](const Twist& command) {
    const env::Action action = bounds_.Scale(command.linear, command.angular);
    choices_.emplace_back(std::hypot(action.linear - asked.linear, action.angular - asked.angular),
                          command);
  };
  add(wanted);
  for (const double share : {0.75, 0.5, 0.25, 0.0}) {
    add({share * wanted.linear, share * wanted.angular});
  }
  for (const Twist& command : evades ? coarse_grid_ : grid_) add(command);

  const std::size_t num_together = evades ? 1 : kLanes;
  Choice best{wanted, false, -kFar};
  std::size_t sorted = 0;
  for (std::size_t begin = 0; begin < choices_.size(); begin += num_together) {
    const std::size_t end = std::min(begin + num_together, choices_.size());
    // Mostly the wanted command passes, and the order of the others does not matter.
    if (end > sorted) {
      const auto by_distance = [](const auto& a, const auto& b) { return a.first < b.first; };
      const auto first = choices_.begin() + static_cast<std::ptrdiff_t>(begin);
      if (begin == 0) {
        std::partial_sort(first, first + static_cast<std::ptrdiff_t>(end), choices_.end(),
                          by_distance);
        sorted = end;
      } else {
        std::sort(first, choices_.end(), by_distance);
        sorted = choices_.size();
      }
    }
    Lanes linear, angular;
    for (int k = 0; k < kLanes; ++k) {
      const Twist& command = choices_[std::min(begin + k, end - 1)].second;
      linear[k] = static_cast<float>(command.linear);
      angular[k] = static_cast<float>(command.angular);
    }
    const Lanes room = evades
                           ? Lanes::Constant(RoomToEscape(choices_[begin].second, best.clearance))
                           : RoomOf(linear, angular);
    for (std::size_t i = begin; i < end; ++i) {
      const float clearance = room[static_cast<Eigen::Index>(i - begin)];
      const Choice choice{choices_[i].second, i > 0, clearance};
      if (clearance >= enough(choice.command)) return send(choice);
      if (clearance > best.clearance) best = choice;
    }
  }
  return send(best);
}

}  // namespace slalom::planners
