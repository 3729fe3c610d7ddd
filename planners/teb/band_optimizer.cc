#include "planners/teb/band_optimizer.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "planners/teb/teb_edges.h"

namespace slalom::planners {
namespace {

constexpr int kUnknownsPerPose = 4;
/// The shortest time between two poses, [s].
constexpr double kLeastTime = 1e-3;
/// The first damping, as a share of the largest diagonal element.
constexpr double kFirstDamping = 1e-5;
constexpr int kMaxTrials = 10;

/// The system to which errors are added (null: none), and the sum of the errors.
struct Sink {
  BandedSystem* system;
  double sum = 0.0;

  template <int N>
  void Add(int pose, const Eigen::Matrix<double, N, 1>& gradient, double error, double weight) {
    if (error == 0.0 || weight == 0.0) return;
    sum += weight * error * error;
    if (system) system->AddError(kUnknownsPerPose * pose, gradient, error, weight);
  }

  /// A penalty of a number with derivatives.
  template <int N>
  void Add(int pose, const Dual<N>& number, const Penalty& penalty, double weight) {
    if (penalty.value == 0.0) return;
    Add<N>(pose, penalty.slope * number.gradient, penalty.value, weight);
  }
};

void AddMotions(const TebConfig& config, Twist start, const TimedBand& band, Sink& sink) {
  const TebRobotConfig& robot = config.robot;
  const TebOptimizerConfig& weights = config.optimizer;
  const double margin = weights.penalty_epsilon;
  const auto add_acceleration = [&](int pose, const auto& linear, const auto& angular) {
    sink.Add(pose, linear,
             PenalizeOutside(linear.value, -robot.max_acceleration, robot.max_acceleration, margin),
             weights.weight_acceleration);
    sink.Add(pose, angular,
             PenalizeOutside(angular.value, -robot.max_angular_acceleration,
                             robot.max_angular_acceleration, margin),
             weights.weight_angular_acceleration);
  };
  PairMotion last;
  const int num_pairs = static_cast<int>(band.dts.size());
  for (int i = 0; i < num_pairs; ++i) {
    const double dt = band.dts[i];
    const PairMotion motion = MotionBetween(band.poses[i], dt, band.poses[i + 1]);
    sink.Add(i, motion.linear,
             PenalizeOutside(motion.linear.value, -robot.max_backward, robot.max_linear, margin),
             weights.weight_max_linear);
    sink.Add(i, motion.angular,
             PenalizeOutside(motion.angular.value, -robot.max_angular, robot.max_angular, margin),
             weights.weight_max_angular);
    if (i == 0) {
      add_acceleration(0, AccelerationAtEnd(motion.linear, dt, start.linear, true),
                       AccelerationAtEnd(motion.angular, dt, start.angular, true));
    } else {
      add_acceleration(i - 1, AccelerationBetween(last.linear, band.dts[i - 1], motion.linear, dt),
                       AccelerationBetween(last.angular, band.dts[i - 1], motion.angular, dt));
    }
    if (i + 1 == num_pairs) {
      add_acceleration(i, AccelerationAtEnd(motion.linear, dt, 0.0, false),
                       AccelerationAtEnd(motion.angular, dt, 0.0, false));
    }
    last = motion;
  }
}

void AddShape(const TebOptimizerConfig& weights, const TimedBand& band, Sink& sink) {
  for (int i = 0; i < static_cast<int>(band.dts.size()); ++i) {
    const base::Pose2 &a = band.poses[i], &b = band.poses[i + 1];
    const Dual<kPairSize> nonholonomic = NonholonomicError(a, b);
    sink.Add(i, nonholonomic.gradient, nonholonomic.value, weights.weight_nonholonomic);
    const Dual<kPairSize> forward = ForwardWay(a, b);
    sink.Add(i, forward, PenalizeBelow(forward.value, 0.0, 0.0), weights.weight_forward_drive);
    if (weights.weight_shortest_path > 0.0) {
      const Dual<kPairSize> distance = DistanceBetween(a, b);
      sink.Add(i, distance.gradient, distance.value, weights.weight_shortest_path);
    }
    sink.Add<4>(i, Eigen::Vector4d::UnitW(), band.dts[i], weights.weight_time);
  }
}

/// The share of min_distance that is missing, raised to `exponent`, with its slope.
Penalty Raise(const Penalty& penalty, double min_distance, double exponent) {
  if (exponent == 1.0 || min_distance <= 0.0 || penalty.value == 0.0) return penalty;
  const double share = penalty.value / min_distance;
  return {min_distance * std::pow(share, exponent),
          penalty.slope * exponent * std::pow(share, exponent - 1.0)};
}

int NearestPose(const TimedBand& band, base::Vec2 p) {
  const auto nearest = std::min_element(band.poses.begin(), band.poses.end(),
                                        [p](const base::Pose2& a, const base::Pose2& b) {
                                          return base::Norm(a.p - p) < base::Norm(b.p - p);
                                        });
  return static_cast<int>(nearest - band.poses.begin());
}

}  // namespace

void BandOptimizer::FindContacts(const BandSurroundings& surroundings, const TimedBand& band) {
  const TebObstacleConfig& config = config_.obstacle;
  const double forced = config.min_distance * config.force_inclusion_factor;
  const double cutoff = config.min_distance * config.cutoff_factor;
  contacts_.clear();
  for (int i = 1; i + 1 < static_cast<int>(band.poses.size()); ++i) {
    const base::Pose2& pose = band.poses[i];
    const auto [s, c] = base::SinCos(pose.yaw);
    double nearest[2] = {cutoff, cutoff};  // To the right, to the left.
    std::optional<base::Vec2> nearest_point[2];
    for (const base::Vec2 p : surroundings.obstacles_O) {
      const base::Vec2 d = p - pose.p;
      const double squared = base::Dot(d, d);
      if (squared > cutoff * cutoff) continue;
      const double distance = std::sqrt(squared);
      if (distance < forced) {
        contacts_.push_back({i, p});
        continue;
      }
      const int side = c * d.y - s * d.x > 0.0;
      if (distance < nearest[side]) {
        nearest[side] = distance;
        nearest_point[side] = p;
      }
    }
    for (const auto& point : nearest_point) {
      if (point) contacts_.push_back({i, *point});
    }
  }
}

void BandOptimizer::FindViaContacts(const BandSurroundings& surroundings, const TimedBand& band) {
  via_contacts_.clear();
  const int last_free = static_cast<int>(band.poses.size()) - 2;
  for (const base::Vec2 p : surroundings.via_points_O) {
    const int nearest = NearestPose(band, p);
    if (nearest < 1 || last_free < 1) continue;  // Close to the robot or behind it.
    via_contacts_.push_back({std::min(nearest, last_free), p});
  }
}

BandCost BandOptimizer::Sum(const BandSurroundings& surroundings, double obstacle_weight,
                            const TimedBand& band, BandedSystem* system) const {
  const TebOptimizerConfig& weights = config_.optimizer;
  Sink rest{system}, obstacles{system};
  AddMotions(config_, surroundings.start_velocity, band, rest);
  AddShape(weights, band, rest);
  for (const Contact& contact : contacts_) {
    const Dual<3> distance = DistanceToPoint(band.poses[contact.pose], contact.p_O);
    obstacles.Add(
        contact.pose, distance,
        Raise(PenalizeBelow(distance.value, config_.obstacle.min_distance, weights.penalty_epsilon),
              config_.obstacle.min_distance, config_.obstacle.cost_exponent),
        obstacle_weight);
    obstacles.Add(contact.pose, distance,
                  PenalizeBelow(distance.value, config_.obstacle.inflation_distance, 0.0),
                  weights.weight_inflation);
  }
  for (const Contact& contact : via_contacts_) {
    const Dual<3> distance = DistanceToPoint(band.poses[contact.pose], contact.p_O);
    rest.Add(contact.pose, distance.gradient, distance.value, weights.weight_via_point);
  }
  return {obstacles.sum, rest.sum};
}

bool BandOptimizer::DescendFrom(const BandSurroundings& surroundings, double obstacle_weight,
                                TimedBand& band) {
  const int last_pose = static_cast<int>(band.poses.size()) - 1;
  double damping = 0.0, growth = 2.0;
  for (int iteration = 0; iteration < config_.optimizer.inner_iterations; ++iteration) {
    system_.Clear(kUnknownsPerPose * last_pose + 3);
    const double cost = Sum(surroundings, obstacle_weight, band, &system_).total();
    if (!std::isfinite(cost)) return false;
    for (int i = 0; i < 3; ++i) {
      system_.Fix(i);
      system_.Fix(kUnknownsPerPose * last_pose + i);
    }
    if (iteration == 0) damping = kFirstDamping * system_.MaxDiagonal();
    bool improved = false;
    for (int trial = 0; trial < kMaxTrials && !improved; ++trial) {
      if (!system_.Solve(damping, step_)) {
        damping *= growth;
        growth *= 2.0;
        continue;
      }
      tried_ = band;
      double predicted = 1e-3;  // As g2o does, so that nothing is divided by zero.
      for (int i = 0; i < system_.size(); ++i) {
        predicted += step_[i] * (damping * step_[i] + system_.gradient(i));
      }
      for (int i = 0; i <= last_pose; ++i) {
        const Eigen::Vector3d d = step_.segment<3>(kUnknownsPerPose * i);
        base::Pose2& pose = tried_.poses[i];
        pose.p = pose.p + base::Vec2{d.x(), d.y()};
        if (d.z() != 0.0) pose.yaw = base::WrapAngle(pose.yaw + std::clamp(d.z(), -1e4, 1e4));
        if (i < last_pose) {
          tried_.dts[i] = std::max(tried_.dts[i] + step_[kUnknownsPerPose * i + 3], kLeastTime);
        }
      }
      const double tried_cost = Sum(surroundings, obstacle_weight, tried_, nullptr).total();
      const double ratio = (cost - tried_cost) / predicted;
      if (std::isfinite(tried_cost) && ratio > 0.0) {
        std::swap(band, tried_);
        const double shrink = 1.0 - std::pow(2.0 * ratio - 1.0, 3);
        damping *= std::clamp(shrink, 1.0 / 3.0, 2.0 / 3.0);
        growth = 2.0;
        improved = true;
      } else {
        damping *= growth;
        growth *= 2.0;
      }
    }
    if (!improved) break;
  }
  return true;
}

bool BandOptimizer::Optimize(const BandSurroundings& surroundings, TimedBand& band) {
  const TebTrajectoryConfig& trajectory = config_.trajectory;
  double obstacle_weight = config_.optimizer.weight_obstacle;
  for (int i = 0; i < config_.optimizer.outer_iterations; ++i) {
    ResizeBand(trajectory.dt_ref, trajectory.dt_hysteresis, trajectory.min_samples,
               trajectory.max_samples, band);
    FindContacts(surroundings, band);
    FindViaContacts(surroundings, band);
    if (!DescendFrom(surroundings, obstacle_weight, band)) return false;
    obstacle_weight *= config_.optimizer.weight_adapt_factor;
  }
  return true;
}

BandCost BandOptimizer::Cost(const BandSurroundings& surroundings, const TimedBand& band) {
  FindContacts(surroundings, band);
  FindViaContacts(surroundings, band);
  return Sum(surroundings, config_.optimizer.weight_obstacle, band, nullptr);
}

}  // namespace slalom::planners
