#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <thread>

namespace slalom::metrics {

/// What is answered to a request.
struct HttpAnswer {
  int status = 200;
  std::string reason = "OK";
  std::string type = "text/plain; charset=utf-8";
  std::string body;
};

/// Answers HTTP GET and HEAD requests, each on a connection of its own, in one thread. Anything
/// else is 405 or 400.
///
/// Our own because what libraries there are start threads with small stacks, on which nothing runs
/// that links LibTorch (its thread-local storage alone is larger), or bring a TLS stack along.
/// Bounded: so many connections, so many bytes and seconds for each. No encryption, no password.
class HttpServer {
 public:
  /// The answer to a path, without what follows a `?`. Called by the server's thread.
  using Handler = std::function<HttpAnswer(std::string_view path)>;

  /// `listener`: a bound and listening TCP socket, which is the server's from here on.
  HttpServer(int listener, Handler handler);
  /// Ends all connections.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

 private:
  struct Connection;

  void Run();

  const int listener_;
  const int wake_;
  const Handler handler_;
  std::jthread thread_;
};

/// What a connection sends for the bytes of a request, which may be anything. Thread-safe as the
/// handler is.
std::string AnswerHttp(std::string_view request, const HttpServer::Handler& handler);

}  // namespace slalom::metrics
