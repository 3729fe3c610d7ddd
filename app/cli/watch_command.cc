#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "app/cli/commands.h"
#include "app/cli/signals.h"
#include "app/train/inputs.h"
#include "app/train/policy_agents.h"
#include "app/train/scoring.h"
#include "app/watch/run_facts.h"
#include "app/watch/watch_server.h"
#include "base/error.h"
#include "base/file.h"
#include "base/machine.h"
#include "base/mutex.h"
#include "base/progress.h"
#include "eval/evaluation.h"
#include "learner/run/run_directory.h"
#include "metrics/http_server.h"
#include "sim/courses/course_sets.h"
#include "sim/pictures/animation.h"
#include "sim/pictures/animation_svg.h"

namespace slalom::cli {
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
std::optional<watch::Drives> DrivePolicy(const PolicyFile& file, const std::stop_token& stop) {
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
  watch::Drives drives;
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
  watch::Drives drives;
};

/// Drives the newest policy of a run over four of the courses that it trains on, whenever somebody
/// asks for a picture and there is a new policy. Works in a thread of its own that gives way to
/// every other (nice 19), so that it takes little from a training beside it. Thread-safe.
class WatchDrives {
 public:
  WatchDrives() : thread_(base::StartThread("drives of the newest policy", [this] { Work(); })) {}
  /// Stops a drive that is under way.
  ~WatchDrives() {
    {
      const base::MutexLock lock(mutex_);
      stopping_.request_stop();
    }
    wanted_changed_.NotifyAll();
  }
  WatchDrives(const WatchDrives&) = delete;
  WatchDrives& operator=(const WatchDrives&) = delete;

  /// Returns the newest picture of the run in `directory`, and a note that says what it shows or
  /// why there is none. Returns at once; a newer picture is made in the background.
  watch::Drives Newest(const fs::path& directory) {
    const base::MutexLock lock(mutex_);
    wanted_ = directory;
    wanted_changed_.NotifyOne();
    return known_[directory].drives;
  }

 private:
  /// The next run that somebody asks for; none: it is over.
  std::optional<fs::path> Wait() {
    const base::MutexLock lock(mutex_);
    while (!wanted_ && !stopping_.stop_requested()) wanted_changed_.Wait(mutex_);
    if (stopping_.stop_requested()) return std::nullopt;
    return std::exchange(wanted_, std::nullopt);
  }

  /// Drives the run's newest policy if that is not the one that is known.
  void Refresh(const fs::path& directory) {
    std::optional<PolicyFile> newest;
    try {
      newest = FindNewest({directory});
    } catch (const base::Error& error) {
      const base::MutexLock lock(mutex_);
      known_[directory].drives.note = error.what();
      return;
    }
    {
      const base::MutexLock lock(mutex_);
      Known& entry = known_[directory];
      if (!newest) {
        entry.drives.note = "No policy yet: the run has not written a checkpoint.";
        return;
      }
      if (entry.file == newest) return;
      if (entry.drives.svg.empty()) entry.drives.note = "The newest policy is being driven.";
    }
    std::optional<watch::Drives> drives;
    std::string fault;
    try {
      drives = DrivePolicy(*newest, stopping_.get_token());
      if (!drives) return;
    } catch (const std::exception& error) {
      fault = error.what();
    }
    const base::MutexLock lock(mutex_);
    Known& entry = known_[directory];
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

  base::Mutex mutex_;
  base::CondVar wanted_changed_;
  std::optional<fs::path> wanted_ GUARDED_BY(mutex_);  ///< The run that was asked for last.
  std::map<fs::path, Known> known_ GUARDED_BY(mutex_);
  std::stop_source stopping_;
  std::jthread thread_;
};

struct WatchOptions {
  std::string run;
  std::string bind = "127.0.0.1";
  int port = 7600;
};

/// Throws `base::Error` if there is nothing to watch.
void RequireRuns(const fs::path& root) {
  if (!fs::is_directory(root)) {
    const fs::path meant = fs::path("runs") / root;
    throw base::Error("{}: {}, expected the directory of a run, or one that holds runs{}",
                      root.string(),
                      fs::exists(root) ? "is not a directory" : "there is no such directory",
                      watch::IsRun(meant) ? fmt::format("; did you mean {}?", meant.string()) : "");
  }
  base::ThrowIf(
      watch::ListRuns(root).empty(),
      "{}: holds no run, expected config.toml or metrics.csv in it or in a directory in it; "
      "`slalom train` makes them",
      root.string());
}

void Watch(const WatchOptions& options) {
  const fs::path root = options.run;
  RequireRuns(root);
  const bool is_ipv6 = options.bind.find(':') != std::string::npos;
  const std::string host = is_ipv6 ? "[" + options.bind + "]" : options.bind;
  const metrics::Listener listener =
      metrics::Listen(fmt::format("{}:{}", host, options.port), "serve the page");
  StopSignals signals;
  WatchDrives drives;
  const watch::WatchPages pages(
      root, {.facts = watch::FactsOf,
             .drives = [&drives](const fs::path& run) { return drives.Newest(run); }});
  const metrics::HttpServer server(
      listener.socket, [&pages](std::string_view path) -> metrics::HttpAnswer {
        try {
          return pages.Answer(path);
        } catch (const std::exception& error) {
          return {500, "Internal Server Error", "text/plain; charset=utf-8", error.what()};
        }
      });
  fmt::print("watching {} at http://{}:{}/ (Ctrl-C ends)\n", options.run, host, listener.port);
  std::fflush(stdout);
  signals.Wait();
}

}  // namespace

void AddWatchCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("watch", "Show a training, running or finished, as a live page");
  auto options = std::make_shared<WatchOptions>();
  command->add_option("RUN", options->run, "Directory of a run, or one that holds runs")
      ->required();
  command
      ->add_option(
          "--bind", options->bind,
          "Address to serve at; anyone who reaches it can read the page, without a password")
      ->capture_default_str();
  command->add_option("--port", options->port, "Port to serve at; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->footer(
      "Prints the address of a page with curves, rates, time left and the newest policy's drives, "
      "which stays up to date\n"
      "until Ctrl-C. Reads the run's files and changes none. Examples:\n\n"
      "  slalom watch runs/quickstart\n"
      "  slalom watch runs --port 8080             all runs\n"
      "  ssh -L 7600:127.0.0.1:7600 HOST           to look from another machine, at "
      "http://127.0.0.1:7600/\n");
  command->callback([options] { Watch(*options); });
}

}  // namespace slalom::cli
