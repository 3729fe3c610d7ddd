#include "base/parallel.h"

#include <fmt/format.h>

#include <utility>

#include "base/check.h"
#include "base/machine.h"

namespace slalom::base {
namespace {

constexpr int kLooks = 1500;  // About 50 us.
constexpr int kCallShift = 32;
constexpr std::uint64_t kCountMask = (std::uint64_t{1} << kCallShift) - 1;

// Lets the processor rest for some cycles in a loop that looks out for something.
void Rest() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

// Looks up to `num_looks` times. Returns whether it happened.
template <class Predicate>
bool LookOut(int num_looks, Predicate happened) {
  for (int look = 0; look < num_looks; ++look) {
    if (happened()) return true;
    Rest();
  }
  return false;
}

}  // namespace

ParallelFor::ParallelFor(int num_threads)
    : num_threads_(num_threads),
      num_looks_(num_threads <= static_cast<int>(std::thread::hardware_concurrency()) ? kLooks : 0),
      shares_(num_threads) {
  SLALOM_CHECK_GE(num_threads, 1);
  try {
    for (int thread = 1; thread < num_threads; ++thread) {
      threads_.push_back(
          StartThread(fmt::format("parallel work, number {} of {}", thread + 1, num_threads),
                      [this, thread] { Work(thread); }));
    }
  } catch (...) {
    Stop();
    throw;
  }
}

ParallelFor::~ParallelFor() { Stop(); }

/// Ends the threads once they have nothing to do. `threads_` waits for them.
void ParallelFor::Stop() {
  MutexLock lock(mutex_);
  stopping_ = true;
  start_.NotifyAll();
}

void ParallelFor::For(int n, const std::function<void(int)>& body) {
  if (num_threads_ == 1) {
    for (int i = 0; i < n; ++i) body(i);
    return;
  }
  n_ = n;
  body_ = &body;
  num_unfinished_ = n;
  const std::uint64_t call = call_ + 1;
  for (int share = 0; share < num_threads_; ++share) {
    const auto count = static_cast<std::uint64_t>(ShareBegin(share + 1) - ShareBegin(share));
    shares_[share].left.store(call << kCallShift | count, std::memory_order_release);
  }
  {
    MutexLock lock(mutex_);
    call_ = call;
    start_.NotifyAll();
  }
  RunShares(0);
  LookOut(num_looks_, [this] { return num_unfinished_ == 0; });
  std::exception_ptr error;
  {
    MutexLock lock(mutex_);
    while (num_unfinished_ > 0) done_.Wait(mutex_);
    error = std::exchange(error_, nullptr);
  }
  if (error) std::rethrow_exception(error);
}

void ParallelFor::Work(int thread) {
  std::uint64_t seen = 0;
  while (true) {
    if (!LookOut(num_looks_, [&] { return call_ != seen; })) {
      MutexLock lock(mutex_);
      while (!stopping_ && call_ == seen) start_.Wait(mutex_);
      if (stopping_) return;
    }
    seen = call_;
    RunShares(thread);
  }
}

// Runs its own share first, then the rest of the others'. A worker that is late may find the shares
// of a later call, and takes part in that.
void ParallelFor::RunShares(int thread) noexcept {
  int num_run = 0;
  for (int k = 0; k < num_threads_; ++k) num_run += RunShare((thread + k) % num_threads_);
  if (num_run > 0 && num_unfinished_.fetch_sub(num_run) == num_run) {
    MutexLock lock(mutex_);
    done_.NotifyOne();
  }
}

// Returns how many bodies it has run. Only the call of the first of them can be under way, since it
// cannot end before they are counted.
int ParallelFor::RunShare(int share) noexcept {
  std::atomic<std::uint64_t>& left = shares_[share].left;
  int num_run = 0;
  std::uint64_t found = left.load(std::memory_order_acquire);
  while ((found & kCountMask) > 0) {
    if (!left.compare_exchange_weak(found, found - 1, std::memory_order_acq_rel)) continue;
    --found;
    ++num_run;
    try {
      (*body_)(ShareBegin(share + 1) - 1 - static_cast<int>(found & kCountMask));
    } catch (...) {
      MutexLock lock(mutex_);
      if (!error_) error_ = std::current_exception();
    }
  }
  return num_run;
}

}  // namespace slalom::base
