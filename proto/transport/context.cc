#include "proto/transport/context.h"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/machine.h"
#include "base/mutex.h"
#include "proto/transport/event_fd.h"

namespace slalom::transport {
namespace {

constexpr std::chrono::seconds kWarningInterval{10};
constexpr char kZapEndpoint[] = "inproc://zeromq.zap.01";

/// A request for authentication, RFC 27: its parts in order.
enum ZapPart { kVersion, kRequestId, kDomain, kAddress, kIdentity, kMechanism, kCredentials };

std::string Z85(std::string_view key) {
  std::array<char, 41> text{};
  if (key.size() != 32) return "";
  zmq_z85_encode(text.data(), reinterpret_cast<const std::uint8_t*>(key.data()), key.size());
  return text.data();
}

/// Throws `base::Error` unless so many threads can be started. ZeroMQ starts one more than its I/O
/// threads with the first socket, and aborts the process if it cannot.
void RequireThreads(int num_threads) {
  base::Mutex at_once;
  std::vector<std::jthread> threads;
  threads.reserve(static_cast<std::size_t>(num_threads));
  const base::MutexLock lock(at_once);
  for (int i = 0; i < num_threads; ++i) {
    threads.push_back(
        base::StartThread("ZeroMQ", [&at_once] { const base::MutexLock wait(at_once); }));
  }
}

}  // namespace

/// Decides for ZeroMQ, in its own thread, which connections are allowed.
class Context::Authenticator {
 public:
  explicit Authenticator(zmq::context_t& context) : socket_(context, zmq::socket_type::rep) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.bind(kZapEndpoint);
    thread_ = base::StartThread("authentication", [this] { Run(); });
  }
  ~Authenticator() {
    stop_.Set();
    thread_.join();
  }

  void Set(const std::string& domain, std::optional<AllowList> allowed) EXCLUDES(mutex_) {
    base::MutexLock lock(mutex_);
    domains_[domain] = std::move(allowed);
  }
  void Forget(const std::string& domain) EXCLUDES(mutex_) {
    base::MutexLock lock(mutex_);
    domains_.erase(domain);
  }

 private:
  void Run() {
    std::array<zmq::pollitem_t, 2> items{
        {{socket_.handle(), 0, ZMQ_POLLIN, 0}, {nullptr, stop_.fd(), ZMQ_POLLIN, 0}}};
    for (;;) {
      if (zmq_poll(items.data(), static_cast<int>(items.size()), -1) < 0) continue;
      if (items[1].revents != 0) return;
      Answer();
    }
  }

  void Answer() {
    std::vector<std::string> request;
    for (bool more = true; more;) {
      zmq::message_t part;
      if (zmq_msg_recv(part.handle(), socket_.handle(), 0) < 0) return;
      request.push_back(part.to_string());
      more = part.more();
    }
    request.resize(kCredentials + 1);
    const std::optional<std::string> user = UserOf(request);
    const std::array<std::string, 6> reply = {request[kVersion],    request[kRequestId],
                                              user ? "200" : "400", user ? "" : "no",
                                              user.value_or(""),    ""};
    for (std::size_t i = 0; i < reply.size(); ++i) {
      const bool more = i + 1 < reply.size();
      zmq_send(socket_.handle(), reply[i].data(), reply[i].size(), more ? ZMQ_SNDMORE : 0);
    }
  }

  /// The role of a peer and its names, as text, or "" for plaintext. Returns nothing if it may not
  /// connect.
  std::optional<std::string> UserOf(const std::vector<std::string>& request) EXCLUDES(mutex_) {
    const bool is_curve = request[kMechanism] == "CURVE";
    const std::string key = is_curve ? Z85(request[kCredentials]) : "";
    {
      base::MutexLock lock(mutex_);
      const auto domain = domains_.find(request[kDomain]);
      if (domain == domains_.end()) return std::nullopt;
      const std::optional<AllowList>& allowed = domain->second;
      if (!allowed && request[kMechanism] == "NULL") return "";
      if (allowed && is_curve) {
        const auto found = allowed->find(key);
        if (found != allowed->end()) {
          const Allowed& peer = found->second;
          return std::string(ToString(peer.role)) + (peer.names.empty() ? "" : " " + peer.names);
        }
      }
    }
    Warn(request[kAddress], key);
    return std::nullopt;
  }

  /// Logs who was refused, but only now and then, because refused peers try again and again.
  void Warn(const std::string& address, const std::string& key) {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_warning_) {
      ++num_unsaid_;
      return;
    }
    spdlog::warn(
        "a connection from {} was refused: its key '{}' is not on the allow list ({} more were "
        "since the last such line)",
        address, key, num_unsaid_);
    num_unsaid_ = 0;
    next_warning_ = now + kWarningInterval;
  }

  base::Mutex mutex_;
  std::map<std::string, std::optional<AllowList>> domains_ GUARDED_BY(mutex_);
  // Used by the thread alone once it runs:
  zmq::socket_t socket_;
  std::chrono::steady_clock::time_point next_warning_;
  std::int64_t num_unsaid_ = 0;
  EventFd stop_;
  std::jthread thread_;
};

Context::Context(int io_threads) : context_(io_threads) {
  RequireThreads(io_threads + 1);
  authenticator_ = std::make_unique<Authenticator>(context_);
}

Context::~Context() = default;

void Context::Authenticate(const std::string& domain, std::optional<AllowList> allowed) {
  authenticator_->Set(domain, std::move(allowed));
}

void Context::Forget(const std::string& domain) { authenticator_->Forget(domain); }

std::string Context::NewName(const std::string& prefix) {
  return fmt::format("{}-{}", prefix, num_names_++);
}

}  // namespace slalom::transport
