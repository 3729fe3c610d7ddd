#include "cli/sweep_serve.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <stop_token>

#include "base/mutex.h"
#include "cli/commands.h"
#include "cli/signals.h"
#include "cli/version.h"
#include "metrics/exposer.h"
#include "sweep/sweep_metrics.h"

namespace slalom::cli {

int ServeSweep(const sweep::Plan& plan, const sweep::Cells& cells,
               const std::filesystem::path& store, const std::string& address) {
  std::array<char, 256> host{};
  metrics::Identity identity;
  identity.name = ::gethostname(host.data(), host.size() - 1) == 0 ? host.data() : "host";
  identity.version = Version();
  identity.commit = Commit();
  sweep::SweepMetrics sweep(plan, cells, store, identity);
  StopSignals signals;
  const metrics::Exposer exposer(address, sweep.registry());
  fmt::print("sweep {}: metrics at http://{}:{}/metrics (Ctrl-C ends)\n", plan.sweep.name,
             address.substr(0, address.rfind(':')), exposer.port());
  std::fflush(stdout);

  base::Mutex mutex;
  base::CondVar changed;
  bool stopped = false;
  const std::stop_callback wake(signals.token(), [&] {
    const base::MutexLock lock(mutex);
    stopped = true;
    changed.NotifyAll();
  });
  const base::MutexLock lock(mutex);
  while (!stopped) {
    changed.WaitFor(mutex, sweep::SweepMetrics::kInterval);
    sweep.Update();
  }
  return kExitOk;
}

}  // namespace slalom::cli
