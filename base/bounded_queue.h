#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <utility>

#include "base/check.h"
#include "base/mutex.h"

namespace slalom::base {

/// A first-in-first-out queue between threads with a fixed capacity. Thread-safe.
///
/// After `Close` the queue accepts no more items. Those inside can still be popped; then `Pop`
/// returns nothing.
template <class T>
class BoundedQueue {
 public:
  /// Requires: capacity >= 1.
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {
    SLALOM_CHECK_GE(capacity, 1u);
  }

  /// Waits for a free place and adds `item`. Returns false and drops `item` if the queue is closed.
  [[nodiscard]] bool Push(T item) EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    ++num_waiting_push_;
    while (!closed_ && items_.size() >= capacity_) not_full_.Wait(mutex_);
    --num_waiting_push_;
    if (closed_) return false;
    items_.push_back(std::move(item));
    not_empty_.NotifyOne();
    return true;
  }

  /// Waits for an item and removes it. Returns nothing if the queue is closed and empty.
  [[nodiscard]] std::optional<T> Pop() EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    while (!closed_ && items_.empty()) not_empty_.Wait(mutex_);
    return TakeFront();
  }

  /// Removes an item if there is one now; does not wait.
  [[nodiscard]] std::optional<T> TryPop() EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return TakeFront();
  }

  void Close() EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    closed_ = true;
    not_empty_.NotifyAll();
    not_full_.NotifyAll();
  }

  std::size_t size() const EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return items_.size();
  }

  /// The number of threads that wait inside `Push` now, so that a test can see that a push blocks.
  int num_waiting_push() const EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return num_waiting_push_;
  }

 private:
  std::optional<T> TakeFront() REQUIRES(mutex_) {
    if (items_.empty()) return std::nullopt;
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    not_full_.NotifyOne();
    return item;
  }

  const std::size_t capacity_;
  mutable Mutex mutex_;
  CondVar not_empty_;
  CondVar not_full_;
  std::deque<T> items_ GUARDED_BY(mutex_);
  bool closed_ GUARDED_BY(mutex_) = false;
  int num_waiting_push_ GUARDED_BY(mutex_) = 0;
};

}  // namespace slalom::base
