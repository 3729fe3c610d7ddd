#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <vector>

#include "base/config_field.h"
#include "base/random.h"

namespace slalom::actor {

/// How the courses of training episodes are chosen.
enum class Sampling { kUniform, kLearnable };
inline base::OneOf EnumNames(Sampling) { return {"uniform", "learnable"}; }

/// Settings of a `CourseSampler`: the part of the section [courses] that the actor reads.
struct SamplingConfig {
  Sampling sampling = Sampling::kUniform;
  double fresh_share = 0.5;
  int fresh_episodes = 4;
  double learnable_share = 0.5;
  int learnable_courses = 2000;

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf for_fresh{"fresh"}, for_learnable{"sampling", {"learnable"}};
    v("fresh_share", fresh_share, base::Range{0.0, 1.0}, "",
      "Share of the uniformly drawn episodes that are driven on fresh courses; the others are on "
      "those of courses.train. Without any there, all are on fresh ones.",
      for_fresh);
    v("fresh_episodes", fresh_episodes, base::Range{1, 1000}, "",
      "Uniformly drawn episodes on a fresh course before the next one takes its place. The success "
      "of the policy in training is measured over them.",
      for_fresh);
    v("sampling", sampling,
      "uniform: every course is as likely as any other. learnable: a share of the episodes is on "
      "courses on which the policy succeeds sometimes; such a course is drawn in proportion to "
      "p (1 - p), where p is its measured success.");
    v("learnable_share", learnable_share, base::Range{0.0, 1.0}, "",
      "Share of the episodes on learnable courses; the others are drawn uniformly.", for_learnable);
    v("learnable_courses", learnable_courses, base::Range{1, 100000}, "",
      "Number of fresh courses that are kept because they are the most learnable.", for_learnable);
  }
};

/// A course and the results on it of the policy in training.
struct MeasuredCourse {
  std::int32_t course = 0;  ///< Its number, as in `env::EpisodeSpec`.
  /// Numbers of episodes. On a course that is drawn as learnable, older ones count less, as the
  /// policy has changed.
  float num_successes = 0.0f;
  float num_failures = 0.0f;

  double num_episodes() const { return double{num_successes} + double{num_failures}; }
  /// p (1 - p) with the share of successes p; 0 without an episode.
  double learnability() const;

  friend bool operator==(const MeasuredCourse&, const MeasuredCourse&) = default;
};

/// State of a `CourseSampler`.
struct SamplerState {
  std::int64_t num_fresh_draws = 0;        ///< Uniform draws of a fresh course so far.
  std::vector<MeasuredCourse> named;       ///< All courses of the named set, by number.
  std::vector<MeasuredCourse> candidates;  ///< Fresh ones, while they are measured, by number.
  std::vector<MeasuredCourse> learnable;   ///< Fresh ones that are kept, in no order.
  std::vector<MeasuredCourse> recent;      ///< The last candidates that were measured.
};

/// The courses drawn, and the policy's success on them.
struct SamplingStats {
  std::int64_t num_courses = 0;  ///< Different courses that were driven.
  /// Mean share of successes of the fresh courses measured last, and the share of these courses
  /// with successes and failures. NaN before the first.
  double mean_success = std::numeric_limits<double>::quiet_NaN();
  double learnable_share = std::numeric_limits<double>::quiet_NaN();
};

/// Chooses the course of each training episode, and measures how learnable courses are by the
/// training episodes themselves.
///
/// The rule is by Rutherford et al., "No Regrets: Investigating and Improving Regret Approximations
/// for Curriculum Discovery" (2024): a policy learns most on a course on which it succeeds as often
/// as it fails. They measure it in episodes driven for that alone; here a fresh course is driven
/// `fresh_episodes` times by uniform draws, which are training data as well. The ones that are more
/// learnable than the least of `learnable_courses` take its place. Confined to one thread.
class CourseSampler {
 public:
  /// Courses are 0 to `num_named` - 1, and with `has_fresh` all numbers beyond. `first_fresh`: the
  /// fresh course that comes first. Requires: num_named >= 1 or has_fresh.
  CourseSampler(const SamplingConfig& config, int num_named, bool has_fresh, int first_fresh);

  /// A course, and why it was chosen.
  struct Draw {
    int course = 0;
    bool is_learnable = false;  ///< Not drawn uniformly.
  };
  Draw Next(base::Random& random);
  /// Counts the end of an episode on a course that `Next` returned.
  void Report(const Draw& draw, bool is_success);

  SamplingStats stats() const;
  SamplerState Save() const;
  /// Throws `base::Error` if the state is one of another number of named courses.
  void Restore(const SamplerState& state);

 private:
  bool IsFresh(int course) const { return course >= num_named_; }
  void Remember(const MeasuredCourse& measured);
  void Keep(const MeasuredCourse& measured);

  const SamplingConfig config_;
  const int num_named_;
  const bool has_fresh_;
  const int first_fresh_;
  std::int64_t num_fresh_draws_ = 0;
  std::vector<MeasuredCourse> named_;  // [num_named]
  std::map<int, MeasuredCourse> candidates_;
  std::vector<MeasuredCourse> learnable_;
  std::deque<MeasuredCourse> recent_;  // The last candidates that were measured.
  // Sums over `recent_`, and of the courses of the named set those that were driven.
  std::int64_t recent_successes_ = 0;
  std::int64_t recent_learnable_ = 0;
  std::int64_t num_named_driven_ = 0;
};

}  // namespace slalom::actor
