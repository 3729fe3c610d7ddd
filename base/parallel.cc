#include "base/parallel.h"

#include <exception>

#include "base/check.h"

namespace slalom::base {

ParallelFor::ParallelFor(int num_threads) : num_threads_(num_threads) {
  SLALOM_CHECK_GE(num_threads, 1);
  for (int worker = 1; worker < num_threads; ++worker) {
    threads_.emplace_back([this, worker] { Work(worker); });
  }
}

ParallelFor::~ParallelFor() {
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
  {
    MutexLock lock(mutex_);
    error_ = nullptr;
    num_running_ = num_threads_ - 1;
    ++generation_;
    start_.NotifyAll();
  }
  RunShare(0);
  std::exception_ptr error;
  {
    MutexLock lock(mutex_);
    while (num_running_ > 0) done_.Wait(mutex_);
    error = error_;
  }
  if (error) std::rethrow_exception(error);
}

void ParallelFor::Work(int worker) {
  long seen = 0;
  while (true) {
    {
      MutexLock lock(mutex_);
      while (!stopping_ && generation_ == seen) start_.Wait(mutex_);
      if (stopping_) return;
      seen = generation_;
    }
    RunShare(worker);
    MutexLock lock(mutex_);
    if (--num_running_ == 0) done_.NotifyOne();
  }
}

void ParallelFor::RunShare(int worker) noexcept {
  const long begin = static_cast<long>(n_) * worker / num_threads_;
  const long end = static_cast<long>(n_) * (worker + 1) / num_threads_;
  try {
    for (long i = begin; i < end; ++i) (*body_)(static_cast<int>(i));
  } catch (...) {
    MutexLock lock(mutex_);
    if (!error_) error_ = std::current_exception();
  }
}

}  // namespace slalom::base
