#include "eval/oracle_agent.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <queue>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/random.h"
#include "sim/robot.h"
#include "sim/scene.h"

namespace slalom::eval {
namespace {

constexpr double kHorizon = 3.6;  // Duration of a sequence of commands, [s].
constexpr double kHold = 0.2;     // For so long a sequence has the same noise, [s].
constexpr int kNumSamples = 32;   // Sequences in an iteration.
constexpr int kNumElites = 5;     // The best of them, from which the next are drawn.
constexpr int kNumIterations = 3;
constexpr int kNumDashes = 6;            // Sequences that stand still, then dash ahead.
constexpr double kDashDelay = 0.4;       // For so long each stands still longer than the last, [s].
constexpr float kFirstDeviation = 0.6f;  // Of the normalised commands.
constexpr float kLeastDeviation = 0.1f;
constexpr double kPersistence = 0.7;  // Correlation of one noise with the next.

/// How long it takes to the goal from each place and, among moving obstacles, from each moment, for
/// a disc that knows their motion. Times are on the clock of the moving obstacles.
///
/// Past fixed obstacles the ways are the shortest on cells of 0.1 m, and a metre counts more where
/// room is scarce. Among moving ones the disc steps from cell to cell of 0.2 m, or waits.
class TimesToGoal {
 public:
  TimesToGoal(const sim::Scene& scene, double begin)
      : begin_(begin),
        cell_(scene.moving_obstacles().empty() ? 0.1 : 0.2),
        origin_(scene.course().bounds.min_W - base::Vec2{kMargin, kMargin}) {
    const base::Vec2 size = scene.course().bounds.max_W + base::Vec2{kMargin, kMargin} - origin_;
    num_cols_ = static_cast<int>(size.x / cell_) + 1;
    num_rows_ = static_cast<int>(size.y / cell_) + 1;
    FindWays(scene);
    if (!scene.moving_obstacles().empty()) FindTimes(scene);
  }

  /// Whether the times hold from `time` on for another `duration`, both [s].
  bool Covers(double time, double duration) const {
    return layers_.size() == 1 || time + duration < begin_ + kNumLayers * layer_time();
  }

  /// Time to the goal, [s], from a point at a time.
  double From(base::Vec2 p_W, double time) const {
    const int last = static_cast<int>(layers_.size()) - 1;
    const int layer = static_cast<int>(std::lround((time - begin_) / layer_time()));
    const std::vector<float>& times = layers_[std::clamp(layer, 0, last)];
    const auto [col, row] = CellAt(p_W);
    float best = times[Index(col, row)];
    if (best < kNever) return best;
    // The robot may stand where the disc does not.
    for (int y = std::max(0, row - kReach); y <= std::min(num_rows_ - 1, row + kReach); ++y) {
      for (int x = std::max(0, col - kReach); x <= std::min(num_cols_ - 1, col + kReach); ++x) {
        best = std::min(best, times[Index(x, y)] + 1.0f);
      }
    }
    return best;
  }

 private:
  static constexpr double kMargin = 1.0;   // Beyond the course's bounds, [m].
  static constexpr double kSpeed = 1.7;    // [m/s]
  static constexpr float kRadius = 0.21f;  // Of the disc: half the robot's width, [m].
  static constexpr float kRoom = 0.45f;    // To turn in, [m].
  static constexpr float kNever = 1e4f;    // [s]
  static constexpr float kNoWay = 20.0f;   // Added where obstacles close all ways, [s].
  static constexpr int kReach = 3;         // [cells]
  static constexpr int kNumLayers = 400;

  double layer_time() const { return cell_ / kSpeed; }
  int Index(int col, int row) const { return row * num_cols_ + col; }
  base::Vec2 Centre(int col, int row) const {
    return origin_ + cell_ * base::Vec2{double(col), double(row)};
  }
  std::pair<int, int> CellAt(base::Vec2 p_W) const {
    const base::Vec2 at = (1.0 / cell_) * (p_W - origin_);
    return {std::clamp(static_cast<int>(std::lround(at.x)), 0, num_cols_ - 1),
            std::clamp(static_cast<int>(std::lround(at.y)), 0, num_rows_ - 1)};
  }
  static sim::FootprintPose PoseAt(base::Vec2 p_W) {
    return {.x = static_cast<float>(p_W.x), .y = static_cast<float>(p_W.y)};
  }

  /// Dijkstra's algorithm from the goal, past fixed obstacles.
  void FindWays(const sim::Scene& scene) {
    std::vector<float> costs(static_cast<std::size_t>(num_cols_) * num_rows_);  // [s/m]
    for (int row = 0; row < num_rows_; ++row) {
      for (int col = 0; col < num_cols_; ++col) {
        const float clearance =
            scene.collision_map().Clearance(kPoint, PoseAt(Centre(col, row)), kRoom);
        costs[Index(col, row)] = clearance < kRadius
                                     ? kNever
                                     : (1.0f + 3.0f * (kRoom - clearance) / (kRoom - kRadius)) /
                                           static_cast<float>(kSpeed);
      }
    }
    std::vector<float>& times = layers_.emplace_back(costs.size(), kNever);
    using Candidate = std::pair<float, int>;
    std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
    const auto [goal_col, goal_row] = CellAt(scene.course().goal_W);
    times[Index(goal_col, goal_row)] = 0.0f;
    queue.emplace(0.0f, Index(goal_col, goal_row));
    while (!queue.empty()) {
      const auto [time, cell] = queue.top();
      queue.pop();
      if (time > times[cell]) continue;
      const int col = cell % num_cols_, row = cell / num_cols_;
      for (int y = std::max(0, row - 1); y <= std::min(num_rows_ - 1, row + 1); ++y) {
        for (int x = std::max(0, col - 1); x <= std::min(num_cols_ - 1, col + 1); ++x) {
          const int next = Index(x, y);
          const double length = cell_ * std::hypot(x - col, y - row);
          const float arrival = time + static_cast<float>(length) * costs[next];
          if (arrival >= std::min(times[next], kNever)) continue;
          times[next] = arrival;
          queue.emplace(arrival, next);
        }
      }
    }
  }

  /// Goes back in time from the ways past fixed obstacles, a layer after the other.
  void FindTimes(const sim::Scene& scene) {
    const std::vector<float> ways = layers_.front();
    layers_.assign(kNumLayers, ways);
    for (int layer = kNumLayers - 2; layer >= 0; --layer) {
      std::vector<float>& times = layers_[layer];
      const std::vector<float>& later = layers_[layer + 1];
      for (int row = 0; row < num_rows_; ++row) {
        for (int col = 0; col < num_cols_; ++col) {
          const int cell = Index(col, row);
          if (ways[cell] == 0.0f || ways[cell] >= kNever) continue;
          float best = kNever;
          for (int y = std::max(0, row - 1); y <= std::min(num_rows_ - 1, row + 1); ++y) {
            for (int x = std::max(0, col - 1); x <= std::min(num_cols_ - 1, col + 1); ++x) {
              best = std::min(best, later[Index(x, y)]);
            }
          }
          times[cell] = std::min(ways[cell] + kNoWay, best + static_cast<float>(layer_time()));
        }
      }
      Block(scene.moving_obstacles(), begin_ + layer * layer_time(), times);
    }
  }

  void Block(const sim::MovingObstacles& obstacles, double time, std::vector<float>& times) const {
    for (int i = 0; i < obstacles.size(); ++i) {
      const sim::MovingShape shape = obstacles.At(i, time);
      const double reach = obstacles.circumradius(i) + kRadius;
      const base::Vec2 place{shape.box.x, shape.box.y};
      const auto [min_col, min_row] = CellAt(place - base::Vec2{reach, reach});
      const auto [max_col, max_row] = CellAt(place + base::Vec2{reach, reach});
      for (int row = min_row; row <= max_row; ++row) {
        for (int col = min_col; col <= max_col; ++col) {
          if (sim::Clearance(shape, kPoint, PoseAt(Centre(col, row))) < kRadius) {
            times[Index(col, row)] = kNever;
          }
        }
      }
    }
  }

  static constexpr sim::Footprint kPoint{0.001f, 0.001f};

  const double begin_;       // [s]
  const double cell_;        // [m]
  const base::Vec2 origin_;  // Centre of the first cell.
  int num_cols_ = 0;
  int num_rows_ = 0;
  std::vector<std::vector<float>> layers_;  // [1 or kNumLayers][num_rows, num_cols] [s]
};

const sim::Robot& RobotOf(const sim::CourseEnvironments& environments, int i) {
  const auto* robot = dynamic_cast<const sim::Robot*>(&environments.robot(i));
  base::ThrowIf(
      robot == nullptr,
      "the oracle drives copies of the robot, which only Slalom's own physics makes, expected "
      "--physics slalom");
  return *robot;
}

}  // namespace

/// Drives one environment.
class OracleAgent::Driver {
 public:
  Driver(const sim::CourseEnvironments& environments, int i)
      : environments_(environments),
        i_(i),
        step_(environments.config().episode.step),
        best_(static_cast<std::size_t>(StepsIn(kHorizon))),
        samples_(kNumSamples, best_) {}

  void BeginEpisode() {
    const base::Pose2 start = environments_.robot_pose(i_);
    random_ = base::Random(base::DeriveSeed(
        std::bit_cast<std::uint64_t>(environments_.motion_time(i_)), "oracle",
        {std::bit_cast<std::uint64_t>(start.p.x), std::bit_cast<std::uint64_t>(start.yaw)}));
    times_.reset();
    std::ranges::fill(best_, environments_.config().action.Standstill());
  }

  env::Action Act() {
    const double now = environments_.motion_time(i_);
    if (!times_ || !times_->Covers(now, kHorizon)) times_.emplace(environments_.scene(i_), now);
    std::shift_left(best_.begin(), best_.end(), 1);
    Sequence mean = best_;
    Sequence deviation(best_.size(), {kFirstDeviation, kFirstDeviation});
    double best_cost = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < kNumIterations; ++iteration) {
      Draw(mean, deviation);
      if (iteration == 0) TryPlainSequences();
      Drive();
      std::array<int, kNumSamples> order;
      for (int k = 0; k < kNumSamples; ++k) order[k] = k;
      std::ranges::stable_sort(order, {}, [this](int k) { return costs_[k]; });
      if (costs_[order[0]] < best_cost) {
        best_cost = costs_[order[0]];
        best_ = samples_[order[0]];
      }
      Fit(std::span(order).first<kNumElites>(), mean, deviation);
    }
    return best_.front();
  }

 private:
  using Sequence = std::vector<env::Action>;

  /// At least one.
  int StepsIn(double duration) const {
    return std::max(1, static_cast<int>(std::lround(duration / step_)));
  }
  int num_steps() const { return static_cast<int>(best_.size()); }

  void Draw(const Sequence& mean, const Sequence& deviation) {
    const double fresh = std::sqrt(1.0 - kPersistence * kPersistence);
    for (Sequence& sample : samples_) {
      double a = random_.Normal(), b = random_.Normal();
      for (int n = 0; n < num_steps(); ++n) {
        const auto noisy = [](float centre, float width, double noise) {
          return std::clamp(centre + width * static_cast<float>(noise), -1.0f, 1.0f);
        };
        sample[n] = {noisy(mean[n].linear, deviation[n].linear, a),
                     noisy(mean[n].angular, deviation[n].angular, b)};
        if ((n + 1) % StepsIn(kHold) != 0) continue;
        a = kPersistence * a + fresh * random_.Normal();
        b = kPersistence * b + fresh * random_.Normal();
      }
    }
  }

  /// Puts the best sequence so far and a few that noise hardly ever draws in the place of samples:
  /// those that stand still for a while, then drive straight ahead at full speed.
  void TryPlainSequences() {
    const env::Action still = environments_.config().action.Standstill();
    samples_[0] = best_;
    for (int dash = 0; dash < kNumDashes; ++dash) {
      Sequence& sample = samples_[1 + dash];
      for (int n = 0; n < num_steps(); ++n) {
        sample[n] = n < dash * StepsIn(kDashDelay) ? still : env::Action{1.0f, still.angular};
      }
    }
  }

  /// Computes the cost of each sample, about the time until the goal, [s].
  void Drive() {
    const sim::EnvironmentConfig& config = environments_.config();
    const sim::Scene& scene = environments_.scene(i_);
    const double now = environments_.motion_time(i_);
    std::vector<sim::Robot> robots(kNumSamples, RobotOf(environments_, i_));
    std::vector<int> driving(kNumSamples);
    for (int k = 0; k < kNumSamples; ++k) driving[k] = k;
    std::vector<sim::RobotBody::Order> orders;
    for (int n = 0; n < num_steps() && !driving.empty(); ++n) {
      orders.clear();
      for (const int k : driving) {
        orders.push_back({.robot = &robots[k],
                          .scene = &scene,
                          .linear = config.action.linear_mps(samples_[k][n]),
                          .angular = config.action.angular_radps(samples_[k][n]),
                          .motion_time = now + n * step_});
      }
      robots.front().DriveTogether(orders);
      std::vector<int> still;
      for (std::size_t j = 0; j < driving.size(); ++j) {
        const int k = driving[j];
        const base::Vec2 p = robots[k].pose().p;
        if (orders[j].touched) {
          costs_[k] = kCollision - n;
        } else if (base::Norm(scene.course().goal_W - p) < config.episode.goal_tolerance) {
          costs_[k] = (n + 1) * step_;
        } else {
          costs_[k] = num_steps() * step_ + times_->From(p, now + (n + 1) * step_);
          still.push_back(k);
        }
      }
      driving = std::move(still);
    }
  }

  static void FitOne(std::span<const float> values, float& mean, float& deviation) {
    float sum = 0.0f, squares = 0.0f;
    for (const float value : values) sum += value;
    mean = sum / static_cast<float>(values.size());
    for (const float value : values) squares += (value - mean) * (value - mean);
    deviation = std::max(kLeastDeviation, std::sqrt(squares / static_cast<float>(values.size())));
  }

  void Fit(std::span<const int, kNumElites> elites, Sequence& mean, Sequence& deviation) const {
    for (int n = 0; n < num_steps(); ++n) {
      std::array<float, kNumElites> linear, angular;
      for (int e = 0; e < kNumElites; ++e) {
        linear[e] = samples_[elites[e]][n].linear;
        angular[e] = samples_[elites[e]][n].angular;
      }
      FitOne(linear, mean[n].linear, deviation[n].linear);
      FitOne(angular, mean[n].angular, deviation[n].angular);
    }
  }

  static constexpr double kCollision = 1e6;

  const sim::CourseEnvironments& environments_;
  const int i_;
  const double step_;  // [s]
  base::Random random_{0};
  std::optional<TimesToGoal> times_;
  Sequence best_;  // Its first command is the last one given.
  std::vector<Sequence> samples_;
  std::array<double, kNumSamples> costs_{};
};

OracleAgent::OracleAgent(const sim::CourseEnvironments& environments, base::ParallelFor* parallel)
    : parallel_(parallel) {
  (void)RobotOf(environments, 0);
  for (int i = 0; i < environments.batch_size(); ++i) {
    drivers_.push_back(std::make_unique<Driver>(environments, i));
  }
}

OracleAgent::~OracleAgent() = default;

void OracleAgent::Act(const env::ObservationBatch& observations, std::span<float> actions) {
  SLALOM_CHECK_EQ(static_cast<std::size_t>(observations.batch_size), drivers_.size());
  base::For(parallel_, observations.batch_size, [&](int i) {
    if (observations.ended[i]) return;
    if (observations.first[i]) drivers_[i]->BeginEpisode();
    env::AsActions(actions)[i] = drivers_[i]->Act();
  });
}

}  // namespace slalom::eval
