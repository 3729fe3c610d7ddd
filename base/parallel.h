#pragma once

#include <functional>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace slalom::base {

/// A fixed set of threads that run the same loop body over an index range, again and again.
///
/// Confined to its owner: one thread at a time calls `For`. With one thread, `For` runs the loop in
/// place. With more, a call costs about 5 us.
class ParallelFor {
 public:
  /// Starts `num_threads - 1` threads, since the caller of `For` works, too.
  /// Requires: num_threads >= 1.
  explicit ParallelFor(int num_threads);
  ~ParallelFor();
  ParallelFor(const ParallelFor&) = delete;
  ParallelFor& operator=(const ParallelFor&) = delete;

  /// Calls body(i) once for each i in [0, n), split into even contiguous shares, and waits for all
  /// of them. If bodies throw, the first exception is thrown again here once all threads have
  /// ended.
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
