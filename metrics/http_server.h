#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <thread>

namespace slalom::metrics {

/// A TCP socket that listens.
struct Listener {
  int socket = -1;  ///< The caller closes it.
  int port = 0;     ///< The port in use, which the system chose if port 0 was asked for.
};

/// Listens at `address`: HOST:PORT, such as "127.0.0.1:9400", "[::1]:9400", "0.0.0.0:9400" (every
/// IPv4 interface) or "localhost:9400". Port 0 stands for any free port. Throws `base::Error`
/// ("cannot PURPOSE on 'ADDRESS': ...") with the reason if the address has another form, its host
/// is not known, or it cannot be listened on.
Listener Listen(const std::string& address, std::string_view purpose);

/// Which names of its host a server answers to.
enum class HostRule {
  kAny,
  kLocal,  ///< Those of this machine alone, "localhost" and 127.0.0.1.
};

/// The answer to a request.
struct HttpAnswer {
  int status = 200;
  std::string reason = "OK";
  std::string type = "text/plain; charset=utf-8";
  std::string body;
};

/// Answers HTTP GET and HEAD requests, each on its own connection, in one thread. It answers
/// anything else with 405 or 400.
///
/// No library is used because those available either bring a TLS stack along or start threads with
/// small stacks. A program that links LibTorch cannot run on small stacks, because LibTorch's
/// thread-local storage alone is larger. Connections, and the bytes and seconds of each, are
/// bounded; if there are too many, the oldest ends. There is no encryption and no password. At an
/// address that only this machine reaches, requests for other hosts are refused: they come from a
/// page of another site in somebody's browser (DNS rebinding).
class HttpServer {
 public:
  /// Returns the answer to a path, which excludes `?` and all that follows it. Called by the
  /// server's thread.
  using Handler = std::function<HttpAnswer(std::string_view path)>;
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  /// `listener`: a bound and listening TCP socket, which the server takes over. `clock` measures
  /// the times of connections; tests give their own.
  HttpServer(int listener, Handler handler, Clock clock = std::chrono::steady_clock::now);
  /// Ends all connections.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

 private:
  struct Connection;

  void Run();

  const int listener_;
  const HostRule hosts_;
  const int wake_;
  const Handler handler_;
  const Clock clock_;
  std::jthread thread_;
};

/// Returns the bytes of the response to `request`, which is untrusted. As thread-safe as the
/// handler.
std::string AnswerHttp(std::string_view request, HostRule hosts,
                       const HttpServer::Handler& handler);

}  // namespace slalom::metrics
