#include "app/watch/watch_drives.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "app/train/inputs.h"
#include "app/train/policy_agents.h"
#include "app/train/scoring.h"
#include "base/error.h"
#include "base/file.h"
#include "base/machine.h"
#include "base/mutex.h"
#include "base/progress.h"
#include "eval/evaluation.h"
#include "learner/run/run_directory.h"
#include "sim/courses/course_sets.h"
#include "sim/pictures/animation.h"
#include "sim/pictures/animation_svg.h"

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kNumCourses = 4;
constexpr double kLongestLoop = 20.0;  // A longer drive is shown faster, [s].

/// A policy on disk.
struct PolicyFile {
  fs::path path;
  fs::file_time_type written;

  friend bool operator==(const PolicyFile&, const PolicyFile&) = default;
};

void Consider(const fs::path& path, std::optional<PolicyFile>& newest) {
  std::error_code missing;
  const fs::file_time_type written = fs::last_write_time(path, missing);
  if (!missing && (!newest || written > newest->written)) newest = PolicyFile{path, written};
}

/// The newest of the run's policy, its snapshots and the policies in its checkpoints. Throws
/// `base::Error` if they cannot be listed.
std::optional<PolicyFile> FindNewest(const run::RunDirectory& run) {
  std::optional<PolicyFile> newest;
  Consider(run.policy(), newest);
  // A run that ends writes a row of metrics, its policy, and then a checkpoint of the same steps.
  std::error_code missing;
  const fs::file_time_type trained = fs::last_write_time(run.metrics(), missing);
  if (newest && !missing && newest->written >= trained) return newest;
  for (const fs::path& snapshot : run.ListSnapshots()) Consider(snapshot, newest);
  for (const fs::path& checkpoint : base::ListDirectory(run.checkpoints())) {
    Consider(run::CheckpointFiles{checkpoint}.acting(), newest);
  }
  return newest;
}

/// Some of the courses, evenly spread.
sim::CourseSet Some(sim::CourseSet set) {
  sim::CourseSet some{set.name, {}};
  const std::size_t count = std::min(kNumCourses, set.courses.size());
  for (std::size_t i = 0; i < count; ++i) {
    some.courses.push_back(set.courses[i * set.courses.size() / count]);
  }
  return some;
}

/// The training courses, or some of their kinds if only fresh ones are trained on.
std::string CoursesLike(const train::CoursesConfig& courses) {
  if (courses.has_named()) return courses.train;
  std::set<std::string> specs;
  for (const sim::FreshKind kind : courses.Mix()) {
    specs.insert(fmt::format("{}1:{}", sim::FreshCoursePrefix(kind), kNumCourses));
  }
  return fmt::format("{}", fmt::join(specs, "+"));
}

/// The picture of a policy's drives. Empty if it was stopped first.
std::optional<Drives> DrivePolicy(const PolicyFile& file, const std::stop_token& stop) {
  const policy::LoadedPolicy loaded = policy::LoadPolicy(file.path);
  auto config =
      train::TrainedConfig(loaded.metadata, file.path.string()).value_or(train::RunConfig{});
  config.courses.inputs = train::InputsOf(file.path);
  config.evaluation.episodes_per_course = 1;
  config.evaluation.recorded_episodes_per_course = 1;
  config.evaluation.recorded_scan_courses = 0;
  // Planning would take the processor from the run.
  const bool plans = std::exchange(config.mpc.enabled, false);
  train::Scoring scoring =
      train::PreparePolicy(train::MakeAgentsOf(loaded.snapshot, config), loaded.snapshot,
                           file.path.string(), config, CoursesLike(config.courses), std::nullopt);
  scoring.task.courses = Some(std::move(scoring.task.courses));
  scoring.task.num_environments = scoring.task.num_episodes();
  auto evaluation = eval::EvaluateOnCourses(scoring.task, scoring.make_agent, nullptr, {}, stop);
  if (!evaluation) return std::nullopt;
  sim::AnimationOptions options;
  options.num_columns = static_cast<int>(kNumCourses);
  options.hold = 1.5;
  auto panels = sim::MakePanels(evaluation->task.courses, std::move(evaluation->episodes.tracks),
                                file.path.string());
  double longest = 0.0;
  for (const sim::AnimationPanel& panel : panels) {
    longest = std::max(longest, sim::DurationOf(panel));
  }
  options.speed = std::max(1.0, std::ceil(longest / kLongestLoop));
  Drives drives;
  drives.svg = sim::PrintAnimationSvg(sim::PlaceAnimation(std::move(panels), options));
  const auto steps = loaded.metadata.find("steps");
  drives.note = fmt::format(
      "The policy {} on {}{}{}.",
      steps == loaded.metadata.end()
          ? file.path.parent_path().filename().string()
          : fmt::format("after {} steps", base::FormatCount(std::stod(steps->second))),
      config.courses.has_named()
          ? fmt::format("courses of {}, which it trains on", config.courses.train)
          : "generated courses like those that it trains on",
      plans ? ", without planning" : "",
      options.speed > 1.0 ? fmt::format(", {:g} times as fast as driven", options.speed) : "");
  return drives;
}

/// The newest drives of one run.
struct Known {
  std::optional<PolicyFile> file;  ///< The policy of `drives`, or one that could not drive.
  Drives drives;
};

}  // namespace

struct WatchDrives::Impl {
  base::Mutex mutex;
  base::CondVar wanted_changed;
  std::optional<fs::path> wanted GUARDED_BY(mutex);  ///< The run that was asked for last.
  std::map<fs::path, Known> known GUARDED_BY(mutex);
  std::stop_source stopping;
  std::jthread thread;

  /// The next run that somebody asks for; none: it is over.
  std::optional<fs::path> Wait() {
    const base::MutexLock lock(mutex);
    while (!wanted && !stopping.stop_requested()) wanted_changed.Wait(mutex);
    if (stopping.stop_requested()) return std::nullopt;
    return std::exchange(wanted, std::nullopt);
  }

  /// Drives the run's newest policy if that is not the one that is known.
  void Refresh(const fs::path& directory) {
    std::optional<PolicyFile> newest;
    try {
      newest = FindNewest({directory});
    } catch (const base::Error& error) {
      const base::MutexLock lock(mutex);
      known[directory].drives.note = error.what();
      return;
    }
    {
      const base::MutexLock lock(mutex);
      Known& entry = known[directory];
      if (!newest) {
        entry.drives.note = "No policy yet: the run has not written a checkpoint.";
        return;
      }
      if (entry.file == newest) return;
      if (entry.drives.svg.empty()) entry.drives.note = "The newest policy is being driven.";
    }
    std::optional<Drives> drives;
    std::string fault;
    try {
      drives = DrivePolicy(*newest, stopping.get_token());
      if (!drives) return;
    } catch (const std::exception& error) {
      fault = error.what();
    }
    const base::MutexLock lock(mutex);
    Known& entry = known[directory];
    entry.file = newest;
    if (drives) {
      drives->number = entry.drives.number + 1;
      entry.drives = std::move(*drives);
    } else {
      entry.drives.note = "The newest policy cannot be driven: " + fault;
    }
  }

  void Work() {
    // On Linux this sets the priority of this thread alone. If it fails, the thread runs at the
    // usual one.
    setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), 19);
    while (const auto directory = Wait()) Refresh(*directory);
  }
};

WatchDrives::WatchDrives() : impl_(std::make_unique<Impl>()) {
  impl_->thread =
      base::StartThread("drives of the newest policy", [impl = impl_.get()] { impl->Work(); });
}

WatchDrives::~WatchDrives() {
  {
    const base::MutexLock lock(impl_->mutex);
    impl_->stopping.request_stop();
  }
  impl_->wanted_changed.NotifyAll();
}

Drives WatchDrives::Newest(const fs::path& directory) {
  const base::MutexLock lock(impl_->mutex);
  impl_->wanted = directory;
  impl_->wanted_changed.NotifyOne();
  return impl_->known[directory].drives;
}

}  // namespace slalom::watch
