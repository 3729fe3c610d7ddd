#include "cli/signals.h"

#include <pthread.h>
#include <signal.h>

#include <atomic>
#include <thread>

#include "base/log.h"

namespace slalom::cli {

struct StopSignals::Impl {
  std::stop_source source;
  std::atomic<int> received = 0;
  sigset_t watched{};
  std::thread waiter;
};

namespace {

constexpr int kWakeUp = SIGUSR1;  // Ends the waiting thread.

}  // namespace

StopSignals::StopSignals() : impl_(new Impl) {
  sigemptyset(&impl_->watched);
  for (const int signal : {SIGINT, SIGTERM, kWakeUp}) sigaddset(&impl_->watched, signal);
  pthread_sigmask(SIG_BLOCK, &impl_->watched, nullptr);
  impl_->waiter = std::thread([impl = impl_] {
    int signal = 0;
    if (sigwait(&impl->watched, &signal) != 0 || signal == kWakeUp) return;
    impl->received = signal;
    impl->source.request_stop();
    spdlog::info("stopping and saving; the same signal again ends at once");
    // From here on the signals do what they do by default.
    pthread_sigmask(SIG_UNBLOCK, &impl->watched, nullptr);
    sigset_t wake_up;
    sigemptyset(&wake_up);
    sigaddset(&wake_up, kWakeUp);
    pthread_sigmask(SIG_BLOCK, &wake_up, nullptr);
    sigwait(&wake_up, &signal);
  });
}

StopSignals::~StopSignals() {
  pthread_kill(impl_->waiter.native_handle(), kWakeUp);
  impl_->waiter.join();
  pthread_sigmask(SIG_UNBLOCK, &impl_->watched, nullptr);
  delete impl_;
}

std::stop_token StopSignals::token() const { return impl_->source.get_token(); }

int StopSignals::received() const { return impl_->received; }

}  // namespace slalom::cli
