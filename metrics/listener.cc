#include "metrics/listener.h"

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

#include "base/error.h"

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
    return std::nullopt;  // IPv6 without brackets: where the port begins is anyone's guess.
  }
  Address address{std::string(host), -1};
  const auto [end, error] =
      std::from_chars(port.data(), port.data() + port.size(), address.port, 10);
  if (error != std::errc{} || end != port.data() + port.size() || host.empty()) return std::nullopt;
  if (address.port < 0 || address.port > 65535) return std::nullopt;
  return address;
}

[[noreturn]] void Refuse(const std::string& address, std::string_view purpose,
                         std::string_view reason) {
  throw base::Error(fmt::format("cannot {} on '{}': {}", purpose, address, reason));
}

/// Of a socket that is bound; the port is at the same place in addresses of IPv4 and IPv6.
int PortOf(int socket) {
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  getsockname(socket, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

}  // namespace

Listener Listen(const std::string& text, std::string_view purpose) {
  const auto address = Parse(text);
  if (!address) {
    Refuse(text, purpose, "expected HOST:PORT, such as 127.0.0.1:9400, [::1]:9400 or 0.0.0.0:9400");
  }
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  if (const int code = getaddrinfo(address->host.c_str(), std::to_string(address->port).c_str(),
                                   &hints, &found)) {
    Refuse(text, purpose, fmt::format("the host is not known ({})", gai_strerror(code)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, freeaddrinfo);
  const int socket = ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int yes = 1;
  if (socket >= 0 && setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) == 0 &&
      bind(socket, found->ai_addr, found->ai_addrlen) == 0 && listen(socket, 16) == 0) {
    return {socket, PortOf(socket)};
  }
  const int error = errno;
  if (socket >= 0) close(socket);
  Refuse(text, purpose, std::strerror(error));
}

}  // namespace slalom::metrics
