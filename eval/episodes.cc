#include "eval/episodes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "sim/randomized_config.h"

namespace slalom::eval {
namespace {

constexpr int kIdle = -1;
constexpr int kNotStarted = -1;

double SmallestRange(const env::FrameView& frame) {
  return 0.01 * *std::min_element(frame.ranges_cm.begin(), frame.ranges_cm.end());
}

/// Whether course `c` of `num_courses` is among `num_kept` evenly spread ones, the first of them
/// course 0.
bool KeepsScans(int c, int num_courses, int num_kept) {
  const std::int64_t kept = std::min(num_kept, num_courses);
  const auto rank = [&](std::int64_t k) { return (k * kept + num_courses - 1) / num_courses; };
  return rank(c + 1) > rank(c);
}

/// Keeps the tracks of one course that are most worth watching: failures before successes, of each
/// the first. Which these are does not depend on the order in which the episodes end.
class CourseRecorder {
 public:
  explicit CourseRecorder(std::size_t capacity) : capacity_(capacity) {}

  void Add(sim::EpisodeTrack track) {
    const auto place = std::ranges::upper_bound(tracks_, Rank(track), {}, Rank);
    tracks_.insert(place, std::move(track));
    if (tracks_.size() > capacity_) tracks_.pop_back();
    // Only the first keeps its scans, which take more room than all the rest.
    for (std::size_t k = 1; k < tracks_.size(); ++k) {
      tracks_[k].beams.reset();
      tracks_[k].scans_cm.clear();
    }
  }

  /// Appends them in the order of their episodes.
  void MoveTo(std::vector<sim::EpisodeTrack>& tracks) {
    std::ranges::sort(tracks_, {}, &sim::EpisodeTrack::episode);
    std::ranges::move(tracks_, std::back_inserter(tracks));
  }

 private:
  static std::pair<bool, int> Rank(const sim::EpisodeTrack& track) {
    return {track.outcome == env::Outcome::kSuccess, track.episode};
  }

  std::size_t capacity_;
  std::vector<sim::EpisodeTrack> tracks_;  // By rank, the most worth watching first.
};

/// Hands the episodes out in order to whichever environment is free, and writes each into its own
/// place.
class Driver {
 public:
  Driver(const EvaluationTask& task, env::BatchEnvironment& environments)
      : task_(task),
        step_(task.environment.episode.step),
        limit_steps_(static_cast<int>(std::lround(task.protocol.time_limit / step_))),
        environments_(environments),
        beam_stride_(BeamStride()),
        drawn_(task.environment),
        results_(environments.batch_size()),
        actions_(environments.batch_size()),
        running_(environments.batch_size()) {
    count_.all = task.num_episodes();
    episodes_.records.resize(static_cast<std::size_t>(count_.all));
    recorders_.assign(task.courses.courses.size(),
                      CourseRecorder(static_cast<std::size_t>(task.recording.episodes_per_course)));
    for (int i = 0; i < environments_.batch_size(); ++i) StartNext(i);
  }

  const EpisodeCount& count() const { return count_; }

  void Step(env::Agent& agent) {
    agent.Act(environments_.observations(), env::NumbersOf(actions_));
    RequireFiniteActions();
    RecordInterventions(agent);
    environments_.Step(env::NumbersOf(actions_), results_);
    for (int i = 0; i < environments_.batch_size(); ++i) {
      if (running_[i].record == kIdle) continue;
      Record(i);
      if (record(i).outcome != env::Outcome::kRunning) {
        Finish(i, agent);
        StartNext(i);
      }
    }
  }

  Episodes TakeEpisodes() {
    for (CourseRecorder& recorder : recorders_) recorder.MoveTo(episodes_.tracks);
    return std::move(episodes_);
  }

 private:
  /// State of the episode that an environment drives.
  struct Running {
    int record = kIdle;  ///< Index of the record.
    int clock_start = kNotStarted;
    bool in_contact = false;
    sim::EpisodeTrack track;
  };

  int BeamStride() const {
    const double num_beams = environments_.observations().num_beams;
    return std::max(1, static_cast<int>(std::lround(num_beams / task_.recording.beams)));
  }

  sim::TrackBeams MakeBeams(const sim::LidarConfig& lidar) const {
    const double spacing = lidar.field_of_view / (environments_.observations().num_beams - 1);
    return {{lidar.offset_x, lidar.offset_y}, -0.5 * lidar.field_of_view, beam_stride_ * spacing};
  }

  /// An environment goes on driving if the protocol's clock has ended its last episode.
  void RequireFiniteActions() {
    for (int i = 0; i < environments_.batch_size(); ++i) {
      const env::Action& action = actions_[i];
      const bool finite = std::isfinite(action.linear) && std::isfinite(action.angular);
      if (environments_.observations().ended[i] != 0 || finite) continue;
      throw base::Error(
          "the agent chose the action ({}, {}) {}; expected finite numbers", action.linear,
          action.angular,
          running_[i].record == kIdle
              ? "after the time limit of an episode"
              : fmt::format("on course {}, episode {}",
                            task_.courses.courses[record(i).course]->name, record(i).episode));
    }
  }

  void RecordInterventions(const env::Agent& agent) {
    for (int i = 0; i < environments_.batch_size(); ++i) {
      if (running_[i].record == kIdle || !agent.Intervened(i)) continue;
      ++record(i).num_interventions;
      sim::EpisodeTrack& track = running_[i].track;
      track.interventions.push_back(static_cast<int>(track.poses.size()) - 1);
    }
  }

  EpisodeRecord& record(int i) { return episodes_.records[running_[i].record]; }

  void StartNext(int i) {
    running_[i].record = kIdle;
    if (num_started_ == count_.all) return;
    Running& running = running_[i];
    running = {
        num_started_++, task_.protocol.clock_start_distance > 0.0 ? kNotStarted : 0, false, {}};
    EpisodeRecord& r = record(i);
    r.course = running.record / task_.episodes_per_course;
    r.episode = running.record % task_.episodes_per_course;
    r.seed = EvaluationSeed(task_.seed, *task_.courses.courses[r.course], r.episode);
    drawn_.Draw(r.seed);
    r.drawn.assign(drawn_.values().begin(), drawn_.values().end());
    environments_.Reset(i, {r.course, r.seed});
    r.min_range = SmallestRange(environments_.observations().frame(i));
    sim::EpisodeTrack& track = running.track;
    track.course = task_.courses.courses[r.course]->name;
    track.episode = r.episode;
    track.step = step_;
    track.motion_start = environments_.motion_time(i);
    track.poses.assign(1, environments_.robot_pose(i));
    // Which episode is worth its scans shows when it ends.
    if (KeepsScans(r.course, static_cast<int>(task_.courses.courses.size()),
                   task_.recording.scan_courses)) {
      track.beams = MakeBeams(drawn_.config().lidar);
    }
    RecordScan(i);
  }

  void RecordScan(int i) {
    sim::EpisodeTrack& track = running_[i].track;
    if (!track.beams) return;
    const auto ranges_cm = environments_.observations().frame(i).ranges_cm;
    std::vector<std::uint16_t>& scan = track.scans_cm.emplace_back();
    for (std::size_t k = 0; k < ranges_cm.size(); k += beam_stride_) scan.push_back(ranges_cm[k]);
  }

  void Record(int i) {
    EpisodeRecord& r = record(i);
    Running& running = running_[i];
    std::vector<base::Pose2>& poses = running.track.poses;
    ++r.num_steps;
    r.outcome = results_[i].outcome;
    r.episode_return += static_cast<double>(results_[i].reward);
    r.min_range = std::min(r.min_range, SmallestRange(environments_.observations().frame(i)));
    const bool in_contact = results_[i].cost > 0.0f;
    if (in_contact && !running.in_contact) ++r.num_collisions;
    running.in_contact = in_contact;
    const base::Pose2 X_WR = environments_.robot_pose(i);
    r.path_length += base::Norm(X_WR.p - poses.back().p);
    poses.push_back(X_WR);
    RecordScan(i);
    AdvanceClock(r, running);
  }

  void AdvanceClock(EpisodeRecord& r, Running& running) const {
    const std::vector<base::Pose2>& poses = running.track.poses;
    const bool far_enough =
        base::Norm(poses.back().p - poses.front().p) >= task_.protocol.clock_start_distance;
    if (running.clock_start == kNotStarted && far_enough) running.clock_start = r.num_steps;
    r.clock_start_step = std::max(running.clock_start, 0);
    const bool is_time_up = r.num_steps - r.clock_start_step >= limit_steps_;
    if (r.outcome == env::Outcome::kRunning && is_time_up) r.outcome = env::Outcome::kTimeout;
  }

  void Finish(int i, const env::Agent& agent) {
    EpisodeRecord& r = record(i);
    r.agent_status = agent.Status(i);
    running_[i].track.outcome = r.outcome;
    recorders_[r.course].Add(std::move(running_[i].track));
    ++count_.ended;
    if (r.outcome == env::Outcome::kSuccess) ++count_.successes;
    if (r.num_collisions > 0) ++count_.collisions;
  }

  const EvaluationTask& task_;
  const double step_;      // [s]
  const int limit_steps_;  // Limit of the protocol's clock.
  env::BatchEnvironment& environments_;
  const int beam_stride_;                 // Every n-th beam is kept.
  sim::RandomizedConfig drawn_;           // The task of the episode that begins.
  std::vector<env::StepResult> results_;  // [B]
  std::vector<env::Action> actions_;      // [B]
  std::vector<Running> running_;          // [B]
  Episodes episodes_;
  EpisodeCount count_;
  std::vector<CourseRecorder> recorders_;  // [number of courses]
  int num_started_ = 0;
};

}  // namespace

std::uint64_t EvaluationSeed(std::int64_t root_seed, const sim::Course& course, int episode) {
  return base::DeriveSeed(
      static_cast<std::uint64_t>(root_seed), "evaluation",
      {base::Checksum(std::string_view(course.name)), static_cast<std::uint64_t>(episode)});
}

std::optional<Episodes> RunEpisodes(const EvaluationTask& task, env::BatchEnvironment& environments,
                                    env::Agent& agent, const Progress& progress,
                                    std::stop_token stop) {
  SLALOM_CHECK_GE(task.courses.courses.size(), 1u);
  SLALOM_CHECK_EQ(environments.num_courses(), static_cast<int>(task.courses.courses.size()));
  Driver driver(task, environments);
  while (driver.count().ended < driver.count().all) {
    if (stop.stop_requested()) return std::nullopt;
    driver.Step(agent);
    if (progress) progress(driver.count());
  }
  return driver.TakeEpisodes();
}

}  // namespace slalom::eval
