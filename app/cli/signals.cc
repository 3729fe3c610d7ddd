#include "app/cli/signals.h"

#include <semaphore.h>
#include <signal.h>
#include <time.h>

#include <atomic>
#include <thread>

#include "base/check.h"
#include "base/log.h"
#include "base/machine.h"

namespace slalom::cli {

struct StopSignals::Impl {
  std::stop_source source;
  std::atomic<int> received = 0;
  sem_t arrived;
  std::jthread waiter;
};

namespace {

// Variables that the handler reaches. Libraries start threads with any signal mask before `main`,
// so a handler takes signals and no thread waits for them.
std::atomic<int>* received_signal = nullptr;
sem_t* signal_arrived = nullptr;

double SecondsNow() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}
std::atomic<double> first_stop_s = 0.0;  // When SIGINT or SIGTERM came; 0: it has not.

extern "C" void OnStopSignal(int number) {
  if (number != SIGHUP) {
    if (first_stop_s == 0.0) {
      first_stop_s = SecondsNow();
    } else if (SecondsNow() - first_stop_s >= 1.0) {
      signal(number, SIG_DFL);
      raise(number);
      return;
    }
  }
  *received_signal = number;
  sem_post(signal_arrived);
}

}  // namespace

StopSignals::StopSignals() : impl_(new Impl) {
  SLALOM_CHECK(received_signal == nullptr);
  sem_init(&impl_->arrived, 0, 0);
  received_signal = &impl_->received;
  signal_arrived = &impl_->arrived;
  struct sigaction action = {};
  action.sa_handler = OnStopSignal;
  action.sa_flags = SA_RESTART;
  first_stop_s = 0.0;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction before = {};
  sigaction(SIGHUP, nullptr, &before);
  takes_hangup_ = before.sa_handler != SIG_IGN;
  if (takes_hangup_) sigaction(SIGHUP, &action, nullptr);
  // The reader of the log may end (`2>&1 | tee log`); the work goes on.
  signal(SIGPIPE, SIG_IGN);
  impl_->waiter = base::StartThread("signals", [impl = impl_] {
    while (sem_wait(&impl->arrived) != 0) {
    }
    if (impl->received == 0) return;
    impl->source.request_stop();
    impl->received.notify_all();
    spdlog::info(impl->received == SIGHUP
                     ? "stopping; the terminal is gone"
                     : "stopping; the same signal again ends the program at once");
  });
}

StopSignals::~StopSignals() {
  signal(SIGINT, SIG_DFL);
  signal(SIGTERM, SIG_DFL);
  // After a hangup another one must not end the program, which still has to print where files lie.
  if (takes_hangup_) signal(SIGHUP, received() == SIGHUP ? SIG_IGN : SIG_DFL);
  sem_post(&impl_->arrived);
  impl_->waiter.join();
  received_signal = nullptr;
  signal_arrived = nullptr;
  sem_destroy(&impl_->arrived);
  delete impl_;
}

std::stop_token StopSignals::token() const { return impl_->source.get_token(); }

int StopSignals::received() const { return impl_->received; }

void StopSignals::Wait() const { impl_->received.wait(0); }

}  // namespace slalom::cli
