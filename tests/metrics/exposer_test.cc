#include "metrics/exposer.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "base/error.h"
#include "metrics/catalogue.h"
#include "metrics/http_server.h"
#include "tests/metrics/http.h"

namespace slalom::metrics {
namespace {

using test::Exchange;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

std::string Get(int port, const std::string& path) {
  return Exchange(port, "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
}

std::string ErrorOf(const std::string& address) {
  const Registry registry("actor", "a1");
  try {
    const Exposer exposer(address, registry);
    return "";
  } catch (const base::Error& error) {
    return error.what();
  }
}

TEST(ExposerTest, ShowsWhatTheRegistryHolds) {
  Registry registry("actor", "a1");
  Counter steps = registry.counter(kEnvironmentSteps);
  const Exposer exposer("127.0.0.1:0", registry);
  ASSERT_GT(exposer.port(), 0);
  steps.Increment(41.0);
  const std::string answer = Get(exposer.port(), "/metrics");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(answer, HasSubstr("Content-Type: text/plain; version=0.0.4; charset=utf-8\r\n"));
  EXPECT_THAT(answer, HasSubstr("slalom_environment_steps_total{name=\"a1\",role=\"actor\","
                                "run=\"run\"} 41\n"));
  steps.Increment();
  EXPECT_THAT(Get(exposer.port(), "/metrics"), HasSubstr("run=\"run\"} 42\n"));
}

TEST(ExposerTest, ShowsOneRegistryAfterTheOther) {
  const Registry first("train", "a");
  Exposer exposer("127.0.0.1:0", first);
  auto second = std::make_shared<Registry>("train", "b");
  second->counter(kUpdates).Increment(2.0);
  exposer.Show(std::move(second));
  const std::string answer = Get(exposer.port(), "/metrics");
  EXPECT_THAT(answer, HasSubstr("slalom_updates_total{name=\"b\",role=\"train\",run=\"run\"} 2\n"));
  EXPECT_THAT(answer, Not(HasSubstr("name=\"a\"")));
}

TEST(ExposerTest, SaysWhetherTheRoleIsHealthy) {
  Registry registry("actor", "a1");
  const Exposer exposer("127.0.0.1:0", registry);
  EXPECT_THAT(Get(exposer.port(), "/healthy"),
              AllOf(StartsWith("HTTP/1.1 200 OK\r\n"), EndsWith("\r\n\r\nok\n")));
  registry.SetFault("the disk is full");
  EXPECT_THAT(Get(exposer.port(), "/healthy"),
              AllOf(StartsWith("HTTP/1.1 503 "), EndsWith("\r\n\r\nthe disk is full\n")));
  registry.SetFault("it cannot be read");
  EXPECT_THAT(Get(exposer.port(), "/healthy"), EndsWith("\r\n\r\nit cannot be read\n"));
  registry.SetFault("");
  EXPECT_THAT(Get(exposer.port(), "/healthy"), StartsWith("HTTP/1.1 200 OK\r\n"));
}

// A thread of its own answers, so it asks when the role's own loop turned last.
TEST(ExposerTest, SaysThatTheMainLoopStandsStill) {
  using namespace std::chrono_literals;
  Registry registry("actor", "a1");
  const Exposer exposer("127.0.0.1:0", registry);
  registry.Beat();
  EXPECT_THAT(Get(exposer.port(), "/healthy"), StartsWith("HTTP/1.1 200 OK\r\n"));
  const auto now = Registry::Clock::now();
  registry.Beat(now - 150s);
  EXPECT_EQ(registry.standstill(now), "the main loop has stood still for 150 s");
  EXPECT_THAT(Get(exposer.port(), "/healthy"),
              AllOf(StartsWith("HTTP/1.1 500 "), HasSubstr("the main loop has stood still for")));
  registry.Beat(now - 100s);
  EXPECT_EQ(registry.standstill(now), "");
}

TEST(ExposerTest, OtherPathsAndMethodsAreRefused) {
  const Registry registry("actor", "a1");
  const Exposer exposer("127.0.0.1:0", registry);
  for (const char* path :
       {"/", "/metrics/", "/metrics/x", "/../etc/passwd", "/%2e%2e/etc/passwd"}) {
    EXPECT_THAT(Get(exposer.port(), path), StartsWith("HTTP/1.1 404 ")) << path;
  }
  for (const std::string method : {"POST", "PUT", "DELETE", "OPTIONS"}) {
    EXPECT_THAT(
        Exchange(exposer.port(),
                 method + " /metrics HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"),
        StartsWith("HTTP/1.1 405 "))
        << method;
  }
  const std::string head =
      Exchange(exposer.port(), "HEAD /healthy HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(head, AllOf(StartsWith("HTTP/1.1 200 OK\r\n"), EndsWith("\r\n\r\n")));
}

TEST(ExposerTest, OnTheLoopbackAddressOtherHostsAreRefused) {
  const Registry registry("actor", "a1");
  const Exposer exposer("127.0.0.1:0", registry);
  const auto status = [](int port, const std::string& host) {
    return Exchange(port, "GET /healthy HTTP/1.1\r\nAccept: */*\r\n" + host + "\r\n\r\n")
        .substr(0, 12);
  };
  for (const char* host : {"Host: localhost", "host:127.0.0.1:9400 ", "HOST: [::1]:9400",
                           "Host: LocalHost:80", "Host: 127.1.2.3"}) {
    EXPECT_EQ(status(exposer.port(), host), "HTTP/1.1 200") << host;
  }
  EXPECT_EQ(Exchange(exposer.port(), "GET /healthy HTTP/1.0\r\n\r\n").substr(0, 12),
            "HTTP/1.1 200");
  for (const char* host : {"Host: example.org", "host: example.org", "HOST:\texample.org",
                           "Host: 127.0.0.1.example.org:9400", "Host: localhost.example.org",
                           "Host: 10.0.0.1:9400", "Host: [::2]", "Host: 127.example.org"}) {
    EXPECT_EQ(status(exposer.port(), host), "HTTP/1.1 421") << host;
  }
  const Exposer open("0.0.0.0:0", registry);
  EXPECT_EQ(status(open.port(), "Host: actor-1:9400"), "HTTP/1.1 200");
}

TEST(ExposerTest, ManySilentConnectionsKeepNobodyOut) {
  const Registry registry("actor", "a1");
  const Exposer exposer("127.0.0.1:0", registry);
  std::vector<int> silent;
  for (int i = 0; i < 200; ++i) silent.push_back(test::Connect(exposer.port()));
  EXPECT_THAT(Get(exposer.port(), "/healthy"), StartsWith("HTTP/1.1 200 OK\r\n"));
  for (const int socket : silent) close(socket);
}

// On a clock that stands still none of them is closed for its age.
TEST(HttpServerTest, OfManySilentConnectionsTheOldestGo) {
  const Listener listener = Listen("127.0.0.1:0", "answer");
  const HttpServer server(
      listener.socket, [](std::string_view) { return HttpAnswer{.body = "here"}; },
      [] { return std::chrono::steady_clock::time_point(); });
  std::vector<int> silent;
  for (int i = 0; i < 200; ++i) silent.push_back(test::Connect(listener.port));
  EXPECT_THAT(Get(listener.port, "/"), EndsWith("here"));
  const auto is_open = [](int socket) {
    char byte = 0;
    return ::recv(socket, &byte, 1, MSG_DONTWAIT) < 0 && errno == EAGAIN;
  };
  // 64 are kept, of which the one that asked was the last.
  for (std::size_t i = 0; i < silent.size(); ++i) {
    EXPECT_EQ(is_open(silent[i]), i + 63 >= silent.size()) << i;
  }
  for (const int socket : silent) close(socket);
}

/// Lets this process open no file or connection for as long as it lives, unless one of the first
/// few closes.
class NoDescriptors {
 public:
  NoDescriptors() {
    EXPECT_EQ(::getrlimit(RLIMIT_NOFILE, &before_), 0);
    // poll(2) takes no more of them than the limit.
    const rlimit limit{5, before_.rlim_max};
    EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  }
  ~NoDescriptors() { EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &before_), 0); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

TEST(HttpServerTest, OnceThereAreDescriptorsAgainEverybodyIsAnswered) {
  const Listener listener = Listen("127.0.0.1:0", "answer");
  const HttpServer server(
      listener.socket, [](std::string_view) { return HttpAnswer{.body = "here"}; },
      [] { return std::chrono::steady_clock::time_point(); });
  const auto ask = [](int socket) {
    const std::string_view request = "GET / HTTP/1.1\r\n\r\n";
    EXPECT_EQ(::send(socket, request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    std::string answer(1000, ' ');
    std::size_t size = 0;
    while (true) {
      const ssize_t n = ::recv(socket, answer.data() + size, answer.size() - size, 0);
      if (n <= 0) break;
      size += static_cast<std::size_t>(n);
    }
    return answer.substr(0, size);
  };
  for (int round = 0; round < 2; ++round) {
    const int first = test::Connect(listener.port), second = test::Connect(listener.port);
    EXPECT_THAT(Get(listener.port, "/"), EndsWith("here")) << "those before it are taken";
    const int late = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    {
      const NoDescriptors none;
      sockaddr_storage address{};
      socklen_t length = sizeof address;
      auto* const plain = reinterpret_cast<sockaddr*>(&address);
      ASSERT_EQ(::getsockname(listener.socket, plain, &length), 0);
      ASSERT_EQ(::connect(late, plain, length), 0);
      // It looks for connections between two answers.
      EXPECT_THAT(ask(first), EndsWith("here"));
      EXPECT_THAT(ask(second), EndsWith("here"));
    }
    EXPECT_THAT(ask(late), EndsWith("here"));
    for (const int socket : {first, second, late}) close(socket);
  }
}

// A request has a second, and its answer five more.
TEST(HttpServerTest, AnAnswerHasTimeOfItsOwn) {
  std::atomic<int> now_s = 0;
  const std::string body(32 << 20, 'x');  // More than is sent at once.
  const Listener listener = Listen("127.0.0.1:0", "answer");
  const HttpServer server(
      listener.socket,
      [&](std::string_view) {
        HttpAnswer answer;
        answer.body = body;
        now_s = 3;
        return answer;
      },
      [&] { return std::chrono::steady_clock::time_point(std::chrono::seconds(now_s)); });
  EXPECT_GT(Get(listener.port, "/").size(), body.size());
}

TEST(ExposerTest, NonsenseLeavesItStanding) {
  const Registry registry("actor", "a1");
  const Exposer exposer("127.0.0.1:0", registry);
  std::string random(1000, '\0');
  for (std::size_t i = 0; i < random.size(); ++i) random[i] = static_cast<char>(i * 131 + 7);
  const std::string nonsense[] = {random + "\r\n\r\n", "GET\r\n\r\n",
                                  "GET " + std::string(1 << 20, 'a') + " HTTP/1.1\r\n\r\n",
                                  "GET / HTTP/1.1\r\nX: " + std::string(1 << 20, 'a') + "\r\n\r\n"};
  for (const std::string& text : nonsense) {
    EXPECT_THAT(Exchange(exposer.port(), text), testing::Not(HasSubstr("200 OK")));
  }
  EXPECT_THAT(Get(exposer.port(), "/healthy"), StartsWith("HTTP/1.1 200 OK\r\n"));
}

TEST(ExposerTest, AnswersSeveralAtOnceWhileTheMetricsChange) {
  Registry registry("actor", "a1");
  Counter steps = registry.counter(kEnvironmentSteps);
  const Exposer exposer("localhost:0", registry);
  std::jthread writer([&steps](std::stop_token stop) {
    while (!stop.stop_requested()) steps.Increment();
  });
  std::vector<std::jthread> readers;
  for (int i = 0; i < 4; ++i) {
    readers.emplace_back([&exposer] {
      for (int k = 0; k < 10; ++k) {
        EXPECT_THAT(Get(exposer.port(), "/metrics"), HasSubstr("slalom_environment_steps_total{"));
      }
    });
  }
}

TEST(ExposerTest, BadAddressesAreNamedWithTheReason) {
  for (const char* address : {"", "9400", "localhost", "127.0.0.1:", ":9400", "127.0.0.1:x",
                              "127.0.0.1:70000", "127.0.0.1:-1", "::1:9400", "127.0.0.1:94 00"}) {
    EXPECT_THAT(ErrorOf(address),
                AllOf(HasSubstr(fmt::format("'{}'", address)), HasSubstr("expected HOST:PORT")))
        << address;
  }
  EXPECT_THAT(ErrorOf("no-such-host.invalid:9400"), HasSubstr("the host is not known"));
  EXPECT_THAT(ErrorOf("192.0.2.1:9400"), HasSubstr("Cannot assign requested address"));
  const Registry registry("actor", "a1");
  const Exposer first("127.0.0.1:0", registry);
  EXPECT_THAT(ErrorOf("127.0.0.1:" + std::to_string(first.port())),
              HasSubstr("Address already in use"));
}

TEST(ExposerTest, TheSameAddressCanBeTakenAgain) {
  const Registry registry("actor", "a1");
  auto first = std::make_unique<Exposer>("127.0.0.1:0", registry);
  const int port = first->port();
  EXPECT_THAT(Get(port, "/healthy"), StartsWith("HTTP/1.1 200"));
  first.reset();
  EXPECT_EQ(Get(port, "/healthy"), "");
  const Exposer second("127.0.0.1:" + std::to_string(port), registry);
  EXPECT_THAT(Get(port, "/healthy"), StartsWith("HTTP/1.1 200"));
}

}  // namespace
}  // namespace slalom::metrics
