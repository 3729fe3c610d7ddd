#pragma once

#include <memory>
#include <string>

#include "metrics/registry.h"

namespace slalom::metrics {

/// Answers HTTP GET /metrics (what the registry holds) and /healthy on an address of its own, in
/// threads of its own.
class Exposer {
 public:
  /// `address`: "127.0.0.1:9400"; port 0: any free one. Throws `base::Error` where it cannot be
  /// bound. `registry` must outlive it.
  Exposer(const std::string& address, const Registry& registry);
  ~Exposer();

  int port() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::metrics
