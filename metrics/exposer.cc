#include "metrics/exposer.h"

#include <memory>
#include <string_view>
#include <utility>

#include "base/mutex.h"
#include "metrics/http_server.h"

namespace slalom::metrics {
namespace {

HttpAnswer Answer(std::string_view path, const Registry& registry) {
  if (path == "/metrics") {
    return {200, "OK", "text/plain; version=0.0.4; charset=utf-8", registry.Text()};
  }
  if (path == "/healthy") {
    if (const std::string standstill = registry.standstill(); !standstill.empty()) {
      return {.status = 500, .reason = "Internal Server Error", .body = standstill + "\n"};
    }
    const std::string fault = registry.fault();
    if (fault.empty()) return {.body = "ok\n"};
    return {.status = 503, .reason = "Service Unavailable", .body = fault + "\n"};
  }
  return {.status = 404, .reason = "Not Found", .body = "here are /metrics and /healthy\n"};
}

}  // namespace

struct Exposer::Impl {
  Impl(const Listener& listener, std::shared_ptr<const Registry> shown_first)
      : port(listener.port),
        shown(std::move(shown_first)),
        server(listener.socket, [this](std::string_view path) { return Answer(path, *Shown()); }) {}

  std::shared_ptr<const Registry> Shown() const {
    const base::MutexLock lock(mutex);
    return shown;
  }

  const int port;
  mutable base::Mutex mutex;
  std::shared_ptr<const Registry> shown GUARDED_BY(mutex);
  HttpServer server;  // The last member, since its thread uses the others.
};

Exposer::Exposer(const std::string& address, const Registry& registry)
    : impl_(std::make_unique<Impl>(
          Listen(address, "show metrics"),
          // Its owner keeps it.
          std::shared_ptr<const Registry>(std::shared_ptr<void>(), &registry))) {}

void Exposer::Show(std::shared_ptr<const Registry> registry) {
  const base::MutexLock lock(impl_->mutex);
  impl_->shown = std::move(registry);
}

Exposer::~Exposer() = default;

int Exposer::port() const { return impl_->port; }

}  // namespace slalom::metrics
