#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "base/result.h"
#include "proto/messages.h"
#include "transport/client.h"

namespace slalom::service {

/// Takes over a policy that came, as the bytes of its file. Fails where it is damaged or of another
/// spec.
using InstallPolicy =
    std::function<std::optional<base::Failure>(std::span<const std::byte> policy)>;

/// Keeps up with the learner's policies: asks for one newer than that held, and asks again when one
/// came, when the connection was made anew, or when there was no answer for seconds. Confined to
/// one thread.
class PolicyLink {
 public:
  PolicyLink(transport::Context& context, const transport::ClientOptions& learner, std::string name,
             InstallPolicy install);

  /// Takes what came, without waiting, and asks for more. True: a new policy was installed.
  /// Throws `base::Error` where the learner refuses for good, or the policy is of another spec.
  bool Poll();

  /// -1: none yet.
  std::int64_t version() const { return version_; }
  bool has_policy() const { return version_ >= 0; }
  std::int64_t received() const { return received_; }
  /// Of the policy held: when it was published, and how long after that it was installed, [s], by
  /// the clocks of both machines.
  double published_s() const { return published_s_; }
  double latency_s() const { return latency_s_; }
  int connections() { return client_.connections(); }
  transport::Client& client() { return client_; }

 private:
  void Ask();
  bool Take(const proto::Header& header, std::span<const std::byte> payload);

  transport::Client client_;
  const std::string endpoint_;
  const std::string name_;
  const InstallPolicy install_;
  std::int64_t version_ = -1;
  std::int64_t received_ = 0;
  double published_s_ = 0.0;
  double latency_s_ = 0.0;
  int connections_ = 0;
  bool asked_ = false;
  int unanswered_ = 0;
  std::chrono::steady_clock::time_point asked_at_;
};

}  // namespace slalom::service
