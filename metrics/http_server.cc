#include "metrics/http_server.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <strings.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/machine.h"
#include "base/split.h"

namespace slalom::metrics {
namespace {

using std::chrono::steady_clock;

constexpr std::size_t kMaxConnections = 64;
constexpr std::size_t kMaxRequestBytes = 8192;
// From the connection to the end of its request, and from there to the end of the answer.
constexpr std::chrono::seconds kMaxRequestTime{1};
constexpr std::chrono::seconds kMaxAnswerTime{5};
constexpr int kBacklog = 256;
// Reads of 4 KiB from an answered connection: a client that sends without an end must not keep the
// others waiting.
constexpr int kMaxReadsAfter = 256;

/// Value of a header's line, without spaces around it. Empty if there is no such line.
std::string_view HeaderOf(std::string_view request, std::string_view name) {
  while (true) {
    const auto line_end = request.find("\r\n");
    if (line_end == std::string_view::npos) return {};
    request.remove_prefix(line_end + 2);
    if (request.size() <= name.size() || request[name.size()] != ':' ||
        strncasecmp(request.data(), name.data(), name.size()) != 0) {
      continue;
    }
    std::string_view value = request.substr(name.size() + 1);
    value = value.substr(0, value.find("\r\n"));
    const auto first = value.find_first_not_of(" \t");
    if (first == std::string_view::npos) return {};
    return value.substr(first, value.find_last_not_of(" \t") + 1 - first);
  }
}

/// Whether a Host header, "NAME:PORT" or "NAME", names this machine to itself. A page of another
/// site that a browser here has open may have its own name resolved to 127.0.0.1, but cannot say
/// that it is this one.
bool IsLocal(std::string_view host) {
  const auto colon = host.rfind(':');
  if (colon != std::string_view::npos && host.find(']', colon) == std::string_view::npos) {
    host = host.substr(0, colon);
  }
  std::string name(host);
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  return base::IsLocalHost(name);
}

HttpAnswer Answer(std::string_view request, HostRule hosts, const HttpServer::Handler& handler) {
  const std::string_view line = request.substr(0, request.find("\r\n"));
  const std::size_t method_end = line.find(' ');
  const std::size_t path_end = line.rfind(" HTTP/1.");
  if (method_end == std::string_view::npos || path_end == std::string_view::npos ||
      path_end <= method_end) {
    return {400, "Bad Request", "text/plain; charset=utf-8", "expected HTTP\n"};
  }
  const std::string_view method = line.substr(0, method_end);
  if (method != "GET" && method != "HEAD") {
    return {405, "Method Not Allowed", "text/plain; charset=utf-8", "expected GET\n"};
  }
  const std::string_view host = HeaderOf(request, "Host");
  if (hosts == HostRule::kLocal && !host.empty() && !IsLocal(host)) {
    return {421, "Misdirected Request", "text/plain; charset=utf-8",
            "this address answers for localhost and 127.0.0.1 only\n"};
  }
  const std::string_view path = line.substr(method_end + 1, path_end - method_end - 1);
  return handler(path.substr(0, path.find('?')));
}

std::string Print(const HttpAnswer& answer, bool with_body) {
  return fmt::format(
      "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\n{}X-Content-Type-Options: "
      "nosniff\r\nConnection: close\r\n\r\n{}",
      answer.status, answer.reason, answer.type, answer.body.size(),
      answer.status == 405 ? "Allow: GET, HEAD\r\n" : "", with_body ? answer.body : "");
}

}  // namespace

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
    return std::nullopt;  // IPv6 without brackets: nothing tells where the port begins.
  }
  const auto number = base::ParseNumber<int>(port);
  if (!number || *number < 0 || *number > 65535 || host.empty()) return std::nullopt;
  return Address{std::string(host), *number};
}

[[noreturn]] void Refuse(const std::string& address, std::string_view purpose,
                         std::string_view reason) {
  throw base::Error("cannot {} on '{}': {}", purpose, address, reason);
}

/// The address that a bound socket has, as numbers.
Address AddressOf(int socket) {
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  auto* const plain = reinterpret_cast<sockaddr*>(&address);
  getsockname(socket, plain, &length);
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> port{};
  const int error = getnameinfo(plain, length, host.data(), host.size(), port.data(), port.size(),
                                NI_NUMERICHOST | NI_NUMERICSERV);
  SLALOM_CHECK_EQ(error, 0);
  return {host.data(), std::atoi(port.data())};
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
      bind(socket, found->ai_addr, found->ai_addrlen) == 0 && listen(socket, kBacklog) == 0) {
    return {socket, AddressOf(socket).port};
  }
  const int error = errno;
  if (socket >= 0) close(socket);
  Refuse(text, purpose, std::strerror(error));
}

std::string AnswerHttp(std::string_view request, HostRule hosts,
                       const HttpServer::Handler& handler) {
  const bool whole = request.find("\r\n\r\n") != std::string_view::npos;
  return Print(whole ? Answer(request, hosts, handler)
                     : HttpAnswer{400, "Bad Request", "text/plain; charset=utf-8",
                                  "expected a request of at most 8192 bytes\n"},
               !request.starts_with("HEAD "));
}

struct HttpServer::Connection {
  int socket;
  steady_clock::time_point end;
  std::string request;
  std::string answer;  // Empty while the request is read.
  std::size_t sent = 0;

  bool reading() const { return answer.empty(); }

  /// Returns false if the connection is finished or broken.
  bool Read(HostRule hosts, const Handler& handler, const Clock& clock) {
    std::array<char, 4096> bytes;
    const ssize_t size = ::recv(socket, bytes.data(), bytes.size(), 0);
    if (size < 0) return errno == EAGAIN || errno == EINTR;
    request.append(bytes.data(), static_cast<std::size_t>(size));
    const bool whole = request.find("\r\n\r\n") != std::string::npos;
    if (!whole && size > 0 && request.size() <= kMaxRequestBytes) return true;
    if (!whole && request.empty()) return false;
    answer = AnswerHttp(request, hosts, handler);
    end = clock() + kMaxAnswerTime;
    return Write();
  }

  bool Write() {
    const ssize_t size = ::send(socket, answer.data() + sent, answer.size() - sent, MSG_NOSIGNAL);
    if (size < 0) return errno == EAGAIN || errno == EINTR;
    sent += static_cast<std::size_t>(size);
    if (sent < answer.size()) return true;
    // Reads on, because unread bytes of the peer would turn the answer into a reset.
    ::shutdown(socket, SHUT_WR);
    std::array<char, 4096> rest;
    for (int i = 0; i < kMaxReadsAfter; ++i) {
      if (::recv(socket, rest.data(), rest.size(), 0) <= 0) break;
    }
    return false;
  }
};

HttpServer::HttpServer(int listener, Handler handler, Clock clock)
    : listener_(listener),
      hosts_(base::IsLocalHost(AddressOf(listener).host) ? HostRule::kLocal : HostRule::kAny),
      wake_(::eventfd(0, EFD_CLOEXEC)),
      handler_(std::move(handler)),
      clock_(std::move(clock)),
      thread_(base::StartThread("answering HTTP", [this] { Run(); })) {
  SLALOM_CHECK_GE(wake_, 0);
}

HttpServer::~HttpServer() {
  ::eventfd_write(wake_, 1);
  thread_.join();
  ::close(wake_);
  ::close(listener_);
}

void HttpServer::Run() {
  ::fcntl(listener_, F_SETFL, ::fcntl(listener_, F_GETFL) | O_NONBLOCK);
  std::vector<Connection> connections;
  std::vector<pollfd> polled;
  bool exhausted = false;  // No descriptor was left for a new connection. Tried again soon.
  while (true) {
    polled = {{wake_, POLLIN, 0}, {listener_, static_cast<short>(exhausted ? 0 : POLLIN), 0}};
    for (const Connection& connection : connections) {
      polled.push_back(
          {connection.socket, static_cast<short>(connection.reading() ? POLLIN : POLLOUT), 0});
    }
    ::poll(polled.data(), polled.size(), exhausted ? 100 : connections.empty() ? -1 : 1000);
    exhausted = false;
    if (polled[0].revents != 0) break;
    const auto now = clock_();
    for (std::size_t i = 0; i < connections.size(); ++i) {
      Connection& connection = connections[i];
      bool goes_on = now < connection.end;
      if (goes_on && polled[i + 2].revents != 0) {
        goes_on =
            connection.reading() ? connection.Read(hosts_, handler_, clock_) : connection.Write();
      }
      if (goes_on) continue;
      ::close(connection.socket);
      connection.socket = -1;
    }
    std::erase_if(connections, [](const Connection& c) { return c.socket < 0; });
    while (polled[1].revents != 0) {
      const int socket = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
      exhausted = socket < 0 && (errno == EMFILE || errno == ENFILE);
      if (socket < 0) break;
      if (connections.size() >= kMaxConnections) {
        // The oldest goes, so that silent strangers do not keep a health check out.
        ::close(connections.front().socket);
        connections.erase(connections.begin());
      }
      connections.push_back({socket, now + kMaxRequestTime, {}, {}, 0});
    }
  }
  for (const Connection& connection : connections) ::close(connection.socket);
}

}  // namespace slalom::metrics
