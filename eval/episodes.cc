#include "eval/episodes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/random.h"

namespace slalom::eval {
namespace {

constexpr int kIdle = -1;

double SmallestRange(const env::FrameView& frame) {
  return 0.01 * *std::min_element(frame.ranges_cm.begin(), frame.ranges_cm.end());
}

/// Hands the episodes out in order to whichever environment is free, and writes each into its own
/// place.
class Driver {
 public:
  Driver(const EvaluationConfig& config, const sim::CourseSet& courses,
         env::BatchEnvironment& environments)
      : config_(config),
        courses_(courses),
        environments_(environments),
        results_(environments.batch_size()),
        actions_(environments.batch_size()),
        episode_of_(environments.batch_size(), kIdle),
        poses_(environments.batch_size()) {
    episodes_.records.resize(courses.courses.size() *
                             static_cast<std::size_t>(config.episodes_per_course));
    const int recorded = std::min(config.recorded_episodes_per_course, config.episodes_per_course);
    episodes_.tracks.resize(courses.courses.size() * static_cast<std::size_t>(recorded));
    for (int i = 0; i < environments_.batch_size(); ++i) StartNext(i);
  }

  int num_episodes() const { return static_cast<int>(episodes_.records.size()); }
  int num_ended() const { return num_ended_; }

  void Step(env::Agent& agent) {
    agent.Act(environments_.observations(), actions_);
    RequireFiniteActions();
    environments_.Step(actions_, results_);
    for (int i = 0; i < environments_.batch_size(); ++i) {
      if (episode_of_[i] == kIdle) continue;
      Record(i);
      if (results_[i].ended()) {
        Finish(i);
        StartNext(i);
      }
    }
  }

  Episodes TakeEpisodes() { return std::move(episodes_); }

 private:
  void RequireFiniteActions() {
    for (int i = 0; i < environments_.batch_size(); ++i) {
      const env::Action& action = actions_[i];
      const bool finite = std::isfinite(action.linear) && std::isfinite(action.angular);
      if (episode_of_[i] == kIdle || finite) continue;
      throw base::Error(fmt::format(
          "the policy chose the action ({}, {}) on course {}, episode {}; expected finite numbers",
          action.linear, action.angular, courses_.courses[record(i).course]->name,
          record(i).episode));
    }
  }

  EpisodeRecord& record(int i) { return episodes_.records[episode_of_[i]]; }

  void StartNext(int i) {
    episode_of_[i] = kIdle;
    if (num_started_ == num_episodes()) return;
    episode_of_[i] = num_started_++;
    EpisodeRecord& r = record(i);
    r.course = episode_of_[i] / config_.episodes_per_course;
    r.episode = episode_of_[i] % config_.episodes_per_course;
    r.seed = EvaluationSeed(config_.seed, *courses_.courses[r.course], r.episode);
    environments_.Reset(i, {r.course, r.seed});
    r.min_range = SmallestRange(environments_.observations().frame(i));
    poses_[i].assign(1, environments_.robot_pose(i));
  }

  void Record(int i) {
    EpisodeRecord& r = record(i);
    ++r.num_steps;
    r.episode_return += static_cast<double>(results_[i].reward);
    r.min_range = std::min(r.min_range, SmallestRange(environments_.observations().frame(i)));
    const base::Pose2 X_WR = environments_.robot_pose(i);
    r.path_length += base::Norm(X_WR.p - poses_[i].back().p);
    poses_[i].push_back(X_WR);
  }

  void Finish(int i) {
    EpisodeRecord& r = record(i);
    r.outcome = results_[i].outcome;
    const int recorded =
        std::min(config_.recorded_episodes_per_course, config_.episodes_per_course);
    if (r.episode < recorded) {
      episodes_.tracks[static_cast<std::size_t>(r.course) * recorded + r.episode] = {
          courses_.courses[r.course]->name, r.outcome, poses_[i]};
    }
    ++num_ended_;
  }

  const EvaluationConfig& config_;
  const sim::CourseSet& courses_;
  env::BatchEnvironment& environments_;
  std::vector<env::StepResult> results_;         // [B]
  std::vector<env::Action> actions_;             // [B]
  std::vector<int> episode_of_;                  // [B] index of the record, or kIdle.
  std::vector<std::vector<base::Pose2>> poses_;  // [B] of the running episode.
  Episodes episodes_;
  int num_started_ = 0;
  int num_ended_ = 0;
};

}  // namespace

std::uint64_t EvaluationSeed(std::int64_t root_seed, const sim::Course& course, int episode) {
  return base::DeriveSeed(
      static_cast<std::uint64_t>(root_seed), "evaluation",
      {base::Checksum(std::string_view(course.name)), static_cast<std::uint64_t>(episode)});
}

std::optional<Episodes> RunEpisodes(const EvaluationConfig& config, const sim::CourseSet& courses,
                                    env::BatchEnvironment& environments, env::Agent& agent,
                                    const Progress& progress, std::stop_token stop) {
  SLALOM_CHECK_GE(courses.courses.size(), 1u);
  SLALOM_CHECK_EQ(environments.num_courses(), static_cast<int>(courses.courses.size()));
  Driver driver(config, courses, environments);
  while (driver.num_ended() < driver.num_episodes()) {
    if (stop.stop_requested()) return std::nullopt;
    driver.Step(agent);
    if (progress) progress(driver.num_ended(), driver.num_episodes());
  }
  return driver.TakeEpisodes();
}

}  // namespace slalom::eval
