#include "metrics/exposer.h"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "metrics/http_server.h"

namespace slalom::metrics {
namespace {

struct Address {
  std::string host;
  int port = 0;
};

std::optional<Address> Parse(std::string_view text) {
  const auto colon = text.rfind(':');
  if (colon == std::string_view::npos) return std::nullopt;
  std::string_view host = text.substr(0, colon);
  const std::string_view port = text.substr(colon + 1);
  if (host.starts_with('[') && host.ends_with(']')) {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return std::nullopt;  // IPv6 without brackets: it is not clear where the port begins.
  }
  Address address{std::string(host), -1};
  const auto [end, error] =
      std::from_chars(port.data(), port.data() + port.size(), address.port, 10);
  if (error != std::errc{} || end != port.data() + port.size() || host.empty()) return std::nullopt;
  if (address.port < 0 || address.port > 65535) return std::nullopt;
  return address;
}

[[noreturn]] void Refuse(const std::string& address, std::string_view reason) {
  throw base::Error(fmt::format("cannot show metrics on '{}': {}", address, reason));
}

/// Opens a socket that listens at the address.
int Listen(const std::string& text) {
  const auto address = Parse(text);
  if (!address) {
    Refuse(text, "expected HOST:PORT, such as 127.0.0.1:9400, [::1]:9400 or 0.0.0.0:9400");
  }
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  if (const int code = getaddrinfo(address->host.c_str(), std::to_string(address->port).c_str(),
                                   &hints, &found)) {
    Refuse(text, fmt::format("the host is not known ({})", gai_strerror(code)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, freeaddrinfo);
  const int socket = ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int yes = 1;
  if (socket >= 0 && setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) == 0 &&
      bind(socket, found->ai_addr, found->ai_addrlen) == 0 && listen(socket, 16) == 0) {
    return socket;
  }
  const int error = errno;
  if (socket >= 0) close(socket);
  Refuse(text, std::strerror(error));
}

/// The port of a bound socket. It lies at the same place in IPv4 and IPv6 addresses.
int PortOf(int socket) {
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  getsockname(socket, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

HttpAnswer Answer(std::string_view path, const Registry& registry) {
  if (path == "/metrics") {
    return {200, "OK", "text/plain; version=0.0.4; charset=utf-8", registry.Text()};
  }
  if (path == "/healthy") {
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
  const int listener = Listen(address);
  impl_.reset(new Impl{PortOf(listener), {listener, [&registry](std::string_view path) {
                                            return Answer(path, registry);
                                          }}});
}

Exposer::~Exposer() = default;

int Exposer::port() const { return impl_->port; }

}  // namespace slalom::metrics
