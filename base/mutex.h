#pragma once

#include <condition_variable>
#include <mutex>

// Annotations for Clang's thread-safety analysis (-Wthread-safety, preset `tidy`). Under g++ they
// expand to nothing.
#if defined(__clang__)
#define SLALOM_TSA(x) __attribute__((x))
#else
#define SLALOM_TSA(x)
#endif
#define GUARDED_BY(x) SLALOM_TSA(guarded_by(x))
#define REQUIRES(...) SLALOM_TSA(requires_capability(__VA_ARGS__))
#define EXCLUDES(...) SLALOM_TSA(locks_excluded(__VA_ARGS__))

namespace slalom::base {

/// A mutex that the compiler can reason about. Lock it with `MutexLock`.
class SLALOM_TSA(capability("mutex")) Mutex {
 public:
  void Lock() SLALOM_TSA(acquire_capability()) { mutex_.lock(); }
  void Unlock() SLALOM_TSA(release_capability()) { mutex_.unlock(); }

 private:
  friend class CondVar;
  std::mutex mutex_;
};

/// Holds a `Mutex` for the length of a scope.
class SLALOM_TSA(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) SLALOM_TSA(acquire_capability(mutex)) : mutex_(mutex) {
    mutex_.Lock();
  }
  ~MutexLock() SLALOM_TSA(release_capability()) { mutex_.Unlock(); }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

 private:
  Mutex& mutex_;
};

/// A condition variable on a `Mutex`. Wait in a loop over the condition.
class CondVar {
 public:
  /// Releases `mutex`, sleeps until notified (or, rarely, wakes without a reason), and locks
  /// `mutex` again.
  void Wait(Mutex& mutex) REQUIRES(mutex) {
    std::unique_lock lock(mutex.mutex_, std::adopt_lock);
    condition_.wait(lock);
    lock.release();
  }
  /// As `Wait`, but sleeps for at most `time`.
  template <class Duration>
  void WaitFor(Mutex& mutex, Duration time) REQUIRES(mutex) {
    std::unique_lock lock(mutex.mutex_, std::adopt_lock);
    condition_.wait_for(lock, time);
    lock.release();
  }
  void NotifyOne() { condition_.notify_one(); }
  void NotifyAll() { condition_.notify_all(); }

 private:
  std::condition_variable condition_;
};

}  // namespace slalom::base
