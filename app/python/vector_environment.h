#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "env/action.h"
#include "env/episode.h"
#include "env/observation.h"
#include "policy/nn/feature_map.h"
#include "sim/courses/course.h"
#include "sim/environment_config.h"
#include "sim/environments.h"
#include "sim/robot_body.h"

namespace slalom::python {

/// When an environment whose episode has ended begins the next one, in Gymnasium's words.
enum class Autoreset {
  kSameStep,  ///< In the step that ended it: observations are of the new episode's start.
  kNextStep,  ///< In the next step, which takes no action for it and has reward 0.
  kDisabled,  ///< When it is reset.
};
inline base::OneOf EnumNames(Autoreset) { return {"SameStep", "NextStep", "Disabled"}; }

/// Settings of a `VectorEnvironment`.
struct VectorConfig {
  sim::EnvironmentConfig environment;
  sim::CourseSet courses;
  int num_environments = 1;
  int num_threads = 1;
  Autoreset autoreset = Autoreset::kSameStep;
  sim::Physics physics;  ///< Defaults to Slalom's own.
};

/// Environments in which one episode follows another, as Gymnasium's vector interface has it.
///
/// Environment i draws its episodes from a stream of its own: the course, uniformly, and then the
/// seed of the episode. So its episodes are a function of the seed that `Reset` was given and of
/// the actions, bit for bit, whatever the other environments do. Confined to one thread at a time.
class VectorEnvironment {
 public:
  /// Throws `base::Error` as `sim::CourseEnvironments` does.
  explicit VectorEnvironment(const VectorConfig& config);

  int size() const { return static_cast<int>(streams_.size()); }
  const sim::EnvironmentConfig& config() const { return environments_.config(); }
  const nn::FeatureMap& features() const { return features_; }  ///< The paper's.
  const std::vector<std::string>& course_names() const { return course_names_; }

  /// Environment i begins the stream of `seed`. Its next episode is the first of it.
  void Seed(int i, std::uint64_t seed);
  /// Begins an episode in environment i: the next of its stream, or on the course and with the seed
  /// given in its place. Throws `base::Error` if there is no such course.
  void Reset(int i, std::optional<int> course = {}, std::optional<std::uint64_t> seed = {});

  /// Runs one step and returns whether an episode ended in it. Throws `base::Error`, before any
  /// environment moves, if an action that counts is not finite, if an environment was never reset,
  /// and if autoreset is disabled and an episode has ended before. Requires: actions.size() ==
  /// size().
  bool Step(std::span<const env::Action> actions);

  /// Observations after the last step or reset.
  const env::ObservationBatch& observations() const { return environments_.observations(); }
  /// The last frames of the episodes that ended in the last step: the rows whose `ended` is set.
  /// Other rows are of earlier steps.
  const env::ObservationBatch& final_observations() const { return final_; }

  /// Results of the last step, [size()].
  std::span<const double> rewards() const { return rewards_; }
  std::span<const std::uint8_t> terminations() const { return terminations_; }
  std::span<const std::uint8_t> truncations() const { return truncations_; }
  std::span<const std::uint8_t> ended() const { return ended_; }
  std::span<const double> costs() const { return costs_; }
  /// `env::Outcome`, course, number of steps and sum of rewards of the episodes that ended in the
  /// last step: the rows whose `ended` is set.
  std::span<const std::uint8_t> outcomes() const { return outcomes_; }
  std::span<const std::int32_t> final_courses() const { return final_courses_; }
  std::span<const std::int32_t> final_lengths() const { return final_lengths_; }
  std::span<const double> final_returns() const { return final_returns_; }
  /// The courses that are driven now, [size()].
  std::span<const std::int32_t> courses() const { return courses_; }

  base::Pose2 robot_pose(int i) const { return environments_.robot_pose(i); }
  const sim::Course& course(int i) const { return environments_.course(courses_[i]); }

 private:
  void KeepFinal(int i, env::Outcome outcome);

  const Autoreset autoreset_;
  std::vector<std::string> course_names_;
  base::ParallelFor parallel_;
  sim::CourseEnvironments environments_;
  const nn::FeatureMap features_;
  std::vector<base::Random> streams_;
  std::vector<env::StepResult> results_;
  env::ObservationBatch final_;
  std::vector<double> rewards_, costs_, final_returns_, returns_;
  std::vector<std::uint8_t> terminations_, truncations_, ended_, outcomes_;
  std::vector<std::uint8_t> waiting_;  // For a reset, at first and after an episode's end.
  std::vector<int> changing_;          // Environments whose episode ends or begins in a step.
  std::vector<std::int32_t> courses_, lengths_, final_courses_, final_lengths_;
};

}  // namespace slalom::python
