#include "metrics/exposer.h"

#include <arpa/inet.h>
#include <civetweb.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <future>
#include <optional>
#include <string_view>
#include <utility>

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

[[noreturn]] void Refuse(const std::string& address, std::string_view reason) {
  throw base::Error(fmt::format("cannot show metrics on '{}': {}", address, reason));
}

struct Resolved {
  std::string text;  // As the web server takes it: the host as numbers.
  sockaddr_storage address{};
  socklen_t length = 0;
};

/// Binds the address once to find out why it might not work, as the web server does not say.
Resolved Resolve(const std::string& text) {
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
  const bool bound = socket >= 0 &&
                     setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) == 0 &&
                     bind(socket, found->ai_addr, found->ai_addrlen) == 0 && listen(socket, 1) == 0;
  const int error = errno;
  if (socket >= 0) close(socket);
  if (!bound) Refuse(text, std::strerror(error));

  std::array<char, NI_MAXHOST> host{};
  getnameinfo(found->ai_addr, found->ai_addrlen, host.data(), host.size(), nullptr, 0,
              NI_NUMERICHOST);
  Resolved resolved;
  resolved.text = found->ai_family == AF_INET6 ? fmt::format("[{}]:{}", host.data(), address->port)
                                               : fmt::format("{}:{}", host.data(), address->port);
  std::memcpy(&resolved.address, found->ai_addr, found->ai_addrlen);
  resolved.length = found->ai_addrlen;
  return resolved;
}

/// Connects, and closes.
void Touch(const Resolved& resolved) {
  const int socket = ::socket(resolved.address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return;
  connect(socket, reinterpret_cast<const sockaddr*>(&resolved.address), resolved.length);
  close(socket);
}

int Answer(mg_connection* connection, int status, std::string_view reason, std::string_view type,
           std::string_view body, std::string_view more = "") {
  const mg_request_info* request = mg_get_request_info(connection);
  const std::string head = fmt::format(
      "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n{}\r\n",
      status, reason, type, body.size(), more);
  mg_write(connection, head.data(), head.size());
  if (std::string_view(request->request_method) != "HEAD") {
    mg_write(connection, body.data(), body.size());
  }
  return status;
}

constexpr std::string_view kPlain = "text/plain; charset=utf-8";

}  // namespace

struct Exposer::Impl {
  const Registry& registry;
  const Health health;
  mg_context* server = nullptr;
  Resolved listening{};  // With the port that was chosen.

  int Handle(mg_connection* connection) const {
    const mg_request_info* request = mg_get_request_info(connection);
    const std::string_view method = request->request_method;
    const std::string_view path = request->local_uri;
    if (method != "GET" && method != "HEAD") {
      return Answer(connection, 405, "Method Not Allowed", kPlain, "expected GET\n",
                    "Allow: GET, HEAD\r\n");
    }
    if (path == "/metrics") {
      return Answer(connection, 200, "OK", "text/plain; version=0.0.4; charset=utf-8",
                    registry.Text());
    }
    if (path == "/healthy") {
      const std::string fault = health ? health() : "";
      if (fault.empty()) return Answer(connection, 200, "OK", kPlain, "ok\n");
      return Answer(connection, 503, "Service Unavailable", kPlain, fault + "\n");
    }
    return Answer(connection, 404, "Not Found", kPlain, "here are /metrics and /healthy\n");
  }
};

Exposer::Exposer(const std::string& address, const Registry& registry, Health health)
    : impl_(new Impl{registry, std::move(health)}) {
  impl_->listening = Resolve(address);
  // Requests have no bodies and end with their answer, so a few threads do.
  const char* options[] = {"listening_ports",
                           impl_->listening.text.c_str(),
                           "num_threads",
                           "4",
                           "request_timeout_ms",
                           "5000",
                           "enable_keep_alive",
                           "no",
                           nullptr};
  mg_callbacks callbacks{};
  callbacks.log_message = [](const mg_connection*, const char*) { return 1; };  // Said below.
  mg_init_data init{};
  init.callbacks = &callbacks;
  init.configuration_options = options;
  std::array<char, 256> reason{};
  mg_error_data error{};
  error.text = reason.data();
  error.text_buffer_size = reason.size();
  mg_init_library(0);
  impl_->server = mg_start2(&init, &error);
  if (impl_->server == nullptr) {
    mg_exit_library();
    Refuse(address, reason.data());
  }
  mg_set_request_handler(
      impl_->server, "**",
      [](mg_connection* connection, void* impl) {
        return static_cast<const Impl*>(impl)->Handle(connection);
      },
      impl_.get());
  // The port is at the same place in addresses of IPv4 and IPv6.
  reinterpret_cast<sockaddr_in&>(impl_->listening.address).sin_port =
      htons(static_cast<std::uint16_t>(port()));
}

Exposer::~Exposer() {
  // The web server looks only every two seconds whether it is to stop, or when somebody connects.
  const auto stopped = std::async(std::launch::async, mg_stop, impl_->server);
  do {
    Touch(impl_->listening);
  } while (stopped.wait_for(std::chrono::milliseconds(10)) != std::future_status::ready);
  mg_exit_library();
}

int Exposer::port() const {
  mg_server_port port{};
  mg_get_server_ports(impl_->server, 1, &port);
  return port.port;
}

}  // namespace slalom::metrics
