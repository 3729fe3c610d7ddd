#include "app/cli/sweep_serve.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <stop_token>

#include "app/cli/commands.h"
#include "app/cli/signals.h"
#include "base/exit_code.h"
#include "base/machine.h"
#include "base/mutex.h"
#include "base/version.h"

namespace slalom::cli {
namespace {

metrics::Identity ThisProcess() {
  std::array<char, 256> host{};
  metrics::Identity identity;
  identity.name = ::gethostname(host.data(), host.size() - 1) == 0 ? host.data() : "host";
  identity.version = base::Version();
  identity.commit = base::Commit();
  return identity;
}

/// Calls `act` again and again, with `SweepMetrics::kInterval` between the calls, until a stop is
/// requested.
template <class Act>
void RepeatUntilStop(const std::stop_token& stop, const Act& act) {
  base::Mutex mutex;
  base::CondVar changed;
  const std::stop_callback wake(stop, [&] {
    const base::MutexLock lock(mutex);
    changed.NotifyAll();
  });
  const base::MutexLock lock(mutex);
  while (!stop.stop_requested()) {
    act();
    changed.WaitFor(mutex, sweep::SweepMetrics::kInterval);
  }
}

}  // namespace

SweepExposer::SweepExposer(const sweep::Plan& plan, const sweep::Cells& cells,
                           const std::filesystem::path& store, const std::string& address)
    : metrics_(plan, cells, store, ThisProcess()),
      exposer_(address, metrics_.registry()),
      thread_(base::StartThread("the metrics of a sweep", [this](const std::stop_token& stop) {
        RepeatUntilStop(stop, [this] { metrics_.Update(); });
      })) {
  fmt::print("sweep {}: metrics at http://{}:{}/metrics\n", plan.sweep.name,
             address.substr(0, address.rfind(':')), exposer_.port());
  std::fflush(stdout);
}

int ServeSweep(const sweep::Plan& plan, const sweep::Cells& cells,
               const std::filesystem::path& store, const std::string& address) {
  StopSignals signals;
  const SweepExposer exposer(plan, cells, store, address);
  RepeatUntilStop(signals.token(), [] {});
  return base::kExitOk;
}

}  // namespace slalom::cli
