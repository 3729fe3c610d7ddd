#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace slalom::base {

/// A fixed set of threads that run the same loop body over an index range, again and again.
///
/// Every thread begins with an even, contiguous share of the indices, the same in each call, so
/// that it finds their data in its cache. A thread that has done its share takes over indices that
/// others have not begun. The caller thus waits for bodies that run, but never for a thread that is
/// late: on a busy machine it does the work alone.
///
/// Confined to its owner: one thread at a time calls `For`. With one thread, `For` runs the loop in
/// place. With more, a call costs about 1 us if the one before ended within the last 50 us, because
/// threads look for work for that long before they sleep (unless there are more of them than
/// processors). To wake a thread takes 5 us or more.
class ParallelFor {
 public:
  /// Starts `num_threads - 1` threads, since the caller of `For` works, too. Throws `base::Error`
  /// if one of them cannot be started. Requires: num_threads >= 1.
  explicit ParallelFor(int num_threads);
  ~ParallelFor();
  ParallelFor(const ParallelFor&) = delete;
  ParallelFor& operator=(const ParallelFor&) = delete;

  /// Calls body(i) once for each i in [0, n), and waits for all of them. If bodies throw, one of
  /// the exceptions is thrown again here once all have ended.
  void For(int n, const std::function<void(int i)>& body);

  int num_threads() const { return num_threads_; }

 private:
  /// The number of the call of `For` that a share belongs to, in the upper half, and the number of
  /// its indices that no thread has begun. On a cache line of its own.
  struct alignas(64) Share {
    std::atomic<std::uint64_t> left = 0;
  };

  int ShareBegin(int share) const {
    return static_cast<int>(static_cast<long>(n_) * share / num_threads_);
  }
  void Stop();
  void Work(int thread);
  void RunShares(int thread) noexcept;
  int RunShare(int share) noexcept;

  const int num_threads_;
  const int num_looks_;  // Looks for a change before sleeping until it comes.
  std::vector<Share> shares_;
  // Written by For before it fills the shares, read by who has taken an index from one.
  int n_ = 0;
  const std::function<void(int)>* body_ = nullptr;
  std::atomic<int> num_unfinished_ = 0;

  Mutex mutex_;
  CondVar start_;
  CondVar done_;
  std::atomic<std::uint64_t> call_ = 0;  // Changes under the mutex; workers look without.
  bool stopping_ GUARDED_BY(mutex_) = false;
  std::exception_ptr error_ GUARDED_BY(mutex_);
  std::vector<std::jthread> threads_;
};

/// Calls body(i) once for each i in [0, n): by the threads of `parallel`, or in turn if it is null.
/// Allocates nothing.
template <class Body>
void For(ParallelFor* parallel, int n, const Body& body) {
  if (parallel != nullptr) return parallel->For(n, std::cref(body));
  for (int i = 0; i < n; ++i) body(i);
}

}  // namespace slalom::base
