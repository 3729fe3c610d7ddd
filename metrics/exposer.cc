#include "metrics/exposer.h"

#include <memory>
#include <string_view>
#include <utility>

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
  int port;
  HttpServer server;
};

Exposer::Exposer(const std::string& address, const Registry& registry) {
  const Listener listener = Listen(address, "show metrics");
  impl_.reset(new Impl{listener.port, {listener.socket, [&registry](std::string_view path) {
                                         return Answer(path, registry);
                                       }}});
}

Exposer::~Exposer() = default;

int Exposer::port() const { return impl_->port; }

}  // namespace slalom::metrics
