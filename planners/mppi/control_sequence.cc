#include "planners/mppi/control_sequence.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.h"

namespace slalom::planners {
namespace {

/// Coefficients of the quadratic filter over 9 points, times 231.
constexpr float kSavitzkyGolay[9] = {-21, 14, 39, 54, 59, 54, 39, 14, -21};

/// Sampled controls, [T, B].
using Controls =
    Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

Controls AsMatrix(const std::vector<float>& controls, const Rollouts& rollouts) {
  return {controls.data(), rollouts.num_steps, rollouts.batch_size};
}

Eigen::Map<const Eigen::VectorXf> AsVector(std::span<const float> values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

Eigen::Map<Eigen::VectorXf> AsResult(std::span<float> values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

float Limit(float wanted, float from, float largest_step) {
  return std::clamp(wanted, from - largest_step, from + largest_step);
}

/// Smooths `values`. `padded`: `values`, with four numbers before and four after them.
void SmoothPadded(const std::vector<float>& padded, std::vector<float>& values) {
  for (std::size_t t = 0; t < values.size(); ++t) {
    float sum = 0.0f;
    for (std::size_t k = 0; k < 9; ++k) sum += kSavitzkyGolay[k] * padded[t + k];
    values[t] = sum / 231.0f;
  }
}

}  // namespace

ControlSequence::ControlSequence(int num_steps) {
  SLALOM_CHECK_GE(num_steps, 1);
  linear.resize(static_cast<std::size_t>(num_steps));
  angular.resize(static_cast<std::size_t>(num_steps));
  Clear();
}

void ControlSequence::Clear() {
  std::fill(linear.begin(), linear.end(), 0.0f);
  std::fill(angular.begin(), angular.end(), 0.0f);
  commanded.fill({});
}

void ControlSequence::Shift() {
  std::copy(commanded.begin() + 1, commanded.end(), commanded.begin());
  commanded.back() = {linear.front(), angular.front()};
  std::copy(linear.begin() + 1, linear.end(), linear.begin());
  std::copy(angular.begin() + 1, angular.end(), angular.begin());
}

void SoftmaxOfCosts(std::span<const float> costs, double temperature, std::span<float> weights) {
  SLALOM_CHECK(!costs.empty() && costs.size() == weights.size() && temperature > 0.0);
  const float least = *std::min_element(costs.begin(), costs.end());
  double sum = 0.0;
  for (std::size_t b = 0; b < costs.size(); ++b) {
    const double weight = std::exp(-static_cast<double>(costs[b] - least) / temperature);
    weights[b] = static_cast<float>(weight);
    sum += weight;
  }
  const auto share = static_cast<float>(1.0 / sum);
  for (float& weight : weights) weight *= share;
}

void AddControlCosts(const Rollouts& rollouts, const ControlSequence& sequence, double gamma,
                     double linear_std, double angular_std, std::span<float> costs) {
  const auto add = [&](const std::vector<float>& sampled, const std::vector<float>& mean,
                       double std) {
    const Eigen::VectorXf factors = static_cast<float>(gamma / (std * std)) * AsVector(mean);
    AsResult(costs).noalias() += AsMatrix(sampled, rollouts).transpose() * factors;
    AsResult(costs).array() -= factors.dot(AsVector(mean));
  };
  add(rollouts.control_linear, sequence.linear, linear_std);
  add(rollouts.control_angular, sequence.angular, angular_std);
}

void TakeWeightedMean(const Rollouts& rollouts, std::span<const float> weights,
                      ControlSequence& sequence) {
  AsResult(sequence.linear).noalias() =
      AsMatrix(rollouts.control_linear, rollouts) * AsVector(weights);
  AsResult(sequence.angular).noalias() =
      AsMatrix(rollouts.control_angular, rollouts) * AsVector(weights);
}

void Smooth(ControlSequence& sequence) {
  std::vector<float> padded_linear, padded_angular;
  for (const Twist& twist : sequence.commanded) {
    padded_linear.push_back(static_cast<float>(twist.linear));
    padded_angular.push_back(static_cast<float>(twist.angular));
  }
  padded_linear.insert(padded_linear.end(), sequence.linear.begin(), sequence.linear.end());
  padded_angular.insert(padded_angular.end(), sequence.angular.begin(), sequence.angular.end());
  padded_linear.insert(padded_linear.end(), 4, sequence.linear.back());
  padded_angular.insert(padded_angular.end(), 4, sequence.angular.back());
  SmoothPadded(padded_linear, sequence.linear);
  SmoothPadded(padded_angular, sequence.angular);
}

void LimitControls(double min_linear, double max_linear, double max_angular,
                   const DriveLimits& limits, Twist now, ControlSequence& sequence) {
  const auto low = static_cast<float>(min_linear), high = static_cast<float>(max_linear);
  const auto turn = static_cast<float>(max_angular);
  // The present speeds may be beyond the limits: then they are brought back as fast as possible.
  auto last_linear = static_cast<float>(now.linear), last_angular = static_cast<float>(now.angular);
  for (std::size_t t = 0; t < sequence.linear.size(); ++t) {
    last_linear =
        Limit(std::clamp(sequence.linear[t], low, high), last_linear, limits.max_linear_step);
    last_angular =
        Limit(std::clamp(sequence.angular[t], -turn, turn), last_angular, limits.max_angular_step);
    sequence.linear[t] = last_linear;
    sequence.angular[t] = last_angular;
  }
}

}  // namespace slalom::planners
