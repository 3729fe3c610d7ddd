#pragma once

#include <memory>
#include <string>

#include "metrics/registry.h"

namespace slalom::metrics {

/// Answers HTTP GET and HEAD requests on its own address, in its own thread:
///
/// - `/metrics`: the registry's `Text`;
/// - `/healthy`, for health checks of containers: 200 and "ok", 503 and the registry's `fault`, or
///   500 and its `standstill`;
/// - anything else: 404; another method: 405.
///
/// The size of a request is bounded, and a peer that sends too slowly is cut off after a few
/// seconds. There is no encryption and no password, so listen on loopback or a private network
/// only.
class Exposer {
 public:
  /// `address`: HOST:PORT, such as "127.0.0.1:9400", "[::1]:9400", "0.0.0.0:9400" (every IPv4
  /// interface) or "localhost:9400". Port 0 stands for any free port. `registry` must outlive the
  /// exposer. Throws `base::Error` with the reason if the address has another form, its host is not
  /// known, or it cannot be listened on.
  Exposer(const std::string& address, const Registry& registry);
  /// Waits until answers under way are sent.
  ~Exposer();

  /// Shows `registry` in the place of the one before, which may end once this returns. Thread-safe.
  void Show(std::shared_ptr<const Registry> registry);

  int port() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::metrics
