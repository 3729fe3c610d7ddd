#pragma once

#include <functional>

namespace slalom::run {

/// The readings of the two clocks from which training time is computed. Their zero does not matter.
struct ClockReading {
  double wall_s = 0.0;       ///< A clock that only goes forward, [s].
  double processor_s = 0.0;  ///< Processor time that this process has used, all threads, [s].
};

/// The clocks of this process. The first one stands still while the machine sleeps.
ClockReading ReadProcessClocks();

/// Counts the time that a run has trained, over all its sessions.
///
/// The clock counts between `Start` and `Stop` only, so that nothing that happens before training
/// can begin (installing, building, loading courses, networks and checkpoints) counts. A resumed
/// run begins with `Restore`.
///
/// It also leaves out time in which the process did not run: stopped with Ctrl-Z or SIGSTOP, frozen
/// by a batch system, or in a virtual machine that was paused. A training loop looks at the clock
/// many times a second. A gap of more than `kLongestGap` between two looks therefore means that the
/// process waited or did not run. Only the processor time that the process used in such a gap
/// counts, but at least `kLongestGap`. So a machine that is merely busy costs a run nothing, and a
/// long write to a slow disk counts with the work in it.
///
/// Confined to one thread.
class TrainingClock {
 public:
  static constexpr double kLongestGap = 1.0;  ///< [s]

  /// The clock starts at 0 and stopped. `read` gives the time; tests give their own.
  explicit TrainingClock(std::function<ClockReading()> read = ReadProcessClocks);

  /// Sets the time that earlier sessions trained, [s]. Requires: the clock does not run.
  void Restore(double training_s);

  /// Starts to count. Does nothing if the clock runs already.
  void Start();
  /// Counts up to now, then stops. Does nothing if the clock does not run.
  void Stop();

  /// Counts up to now, if the clock runs. Call it once in each turn of the training loop.
  void Look();

  /// Time trained as of the last look, [s].
  double training_s() const { return training_s_; }
  /// The wall clock as of the last look, [s]: for how often something is shown. It goes forward
  /// whether the training clock runs or not.
  double wall_s() const { return last_.wall_s; }

 private:
  std::function<ClockReading()> read_;
  ClockReading last_;
  double training_s_ = 0.0;
  bool running_ = false;
};

}  // namespace slalom::run
