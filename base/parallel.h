#pragma once

#include <functional>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace slalom::base {

/// A fixed crew of threads that runs the same loop body over an index range, again and again.
///
/// `For` is called by one thread at a time (confined to its owner). With one thread it runs in
/// place. Cost: about 5 us a call beyond one thread.
class ParallelFor {
 public:
  /// Starts `num_threads - 1` threads; the caller of `For` is the last. Requires: num_threads >= 1.
  explicit ParallelFor(int num_threads);
  ~ParallelFor();
  ParallelFor(const ParallelFor&) = delete;
  ParallelFor& operator=(const ParallelFor&) = delete;

  /// Calls body(i) once for each i in [0, n), split in even contiguous shares, and waits for all.
  /// The first exception thrown by a body is thrown again here, after all have ended.
  void For(int n, const std::function<void(int)>& body);

  int num_threads() const { return num_threads_; }

 private:
  void Work(int worker);
  void RunShare(int worker) noexcept;

  const int num_threads_;
  Mutex mutex_;
  CondVar start_;
  CondVar done_;
  long generation_ GUARDED_BY(mutex_) = 0;
  int num_running_ GUARDED_BY(mutex_) = 0;
  bool stopping_ GUARDED_BY(mutex_) = false;
  std::exception_ptr error_ GUARDED_BY(mutex_);
  // Written by For before the generation is raised under the mutex, read by workers after they saw
  // it.
  int n_ = 0;
  const std::function<void(int)>* body_ = nullptr;
  std::vector<std::jthread> threads_;
};

}  // namespace slalom::base
