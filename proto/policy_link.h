#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "base/result.h"
#include "proto/messages.h"
#include "proto/transport/client.h"

namespace slalom::service {

/// Installs a received policy, given as the bytes of its file. Fails, and changes nothing, if it is
/// damaged or of another spec.
using InstallPolicy =
    std::function<std::optional<base::Failure>(std::span<const std::byte> policy)>;

/// The policy that a process asks the learner for: the acting one or, if it is `shipped`, the one
/// that the run would save.
struct PolicyKind {
  bool shipped = false;
  bool without_model = false;  ///< The acting one without what only planning needs.
};

/// Keeps an actor or evaluator at the learner's newest policy. It asks for a policy newer than the
/// one held, and asks again when one has come, after a reconnect, and after seconds without an
/// answer. A policy that cannot be installed is passed over, and the one held stays. Confined to
/// one thread.
class PolicyLink {
 public:
  PolicyLink(transport::Context& context, const transport::ClientOptions& learner, std::string name,
             InstallPolicy install, PolicyKind kind = {});

  /// Handles the messages that have come, without waiting, and asks for more. Returns whether a new
  /// policy was installed. Throws `base::Error` if the learner refuses this process for good, or
  /// its first policy cannot be installed.
  bool Poll();

  /// The version of the policy held, or -1 if there is none yet.
  std::int64_t version() const { return version_; }
  bool has_policy() const { return version_ >= 0; }
  std::int64_t received() const { return received_; }
  std::int64_t rejected() const { return rejected_; }
  /// Time at which the policy held was published, and the time from then until it was installed,
  /// [s]. The two moments are measured by the clocks of two machines.
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
  const PolicyKind kind_;
  std::int64_t version_ = -1;
  std::int64_t newest_seen_ = -1;  ///< The version held, or one that could not be installed.
  std::int64_t received_ = 0;
  std::int64_t rejected_ = 0;
  double published_s_ = 0.0;
  double latency_s_ = 0.0;
  int connections_ = 0;
  bool asked_ = false;
  int unanswered_ = 0;
  std::chrono::steady_clock::time_point asked_at_;
  std::optional<std::chrono::steady_clock::time_point> said_refusal_at_;
};

}  // namespace slalom::service
