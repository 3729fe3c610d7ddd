#pragma once

#include <memory>
#include <string>

#include "metrics/registry.h"

namespace slalom::metrics {

/// Answers HTTP GET (and HEAD) on an address of its own, in a thread of its own:
///
/// - `/metrics`: the registry's `Text`;
/// - `/healthy`: 200 and "ok", or 503 and the registry's `fault`; for health checks of containers;
/// - anything else: 404; another method: 405.
///
/// Headers and bodies of requests are bounded and a peer that is slow to send is cut off after
/// seconds. There is no encryption and no password: listen on loopback or a network of one's own.
class Exposer {
 public:
  /// `address`: HOST:PORT, as "127.0.0.1:9400", "[::1]:9400", "0.0.0.0:9400" (every interface of
  /// IPv4) or "localhost:9400"; port 0: any free one. `registry` must outlive the exposer. Throws
  /// `base::Error` where the address has another form, its host is not known, or it cannot be
  /// listened on, with the reason.
  Exposer(const std::string& address, const Registry& registry);
  /// Waits for answers under way.
  ~Exposer();

  int port() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::metrics
