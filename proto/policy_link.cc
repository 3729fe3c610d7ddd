#include "proto/policy_link.h"

#include <fmt/format.h>

#include <utility>

#include "base/clock.h"
#include "base/error.h"
#include "base/log.h"

namespace slalom::service {
namespace {

using std::chrono::steady_clock;

// A learner answers once it has a newer policy, but at once if it is asked again.
constexpr std::chrono::seconds kAskAgain{5};
// Unanswered requests after which the connection is dropped.
constexpr int kMaxUnansweredAsks = 2;
// Between two lines about requests that were refused.
constexpr std::chrono::minutes kSayAskRefusal{1};

}  // namespace

PolicyLink::PolicyLink(transport::Context& context, const transport::ClientOptions& learner,
                       std::string name, InstallPolicy install, PolicyKind kind)
    : client_(context, learner),
      endpoint_(learner.endpoint),
      name_(std::move(name)),
      install_(std::move(install)),
      kind_(kind) {}

bool PolicyLink::Poll() {
  bool installed = false;
  while (auto message = client_.Receive(std::chrono::milliseconds(0))) {
    const auto header = proto::Decode(message->header.bytes(), message->payload.bytes());
    if (!header) {
      spdlog::warn("learner at {}: {}", endpoint_, header.failure().text);
      continue;
    }
    installed = Take(*header, message->payload.bytes()) || installed;
  }
  const int connections = client_.connections();
  if (connections != connections_) {
    connections_ = connections;
    asked_ = false;
  }
  const auto now = steady_clock::now();
  if (connections_ > 0 && (!asked_ || now - asked_at_ > kAskAgain)) {
    unanswered_ = asked_ ? unanswered_ + 1 : 0;
    if (unanswered_ > kMaxUnansweredAsks) {
      client_.Reconnect();
      unanswered_ = 0;
      asked_at_ = now;  // It asks as soon as the new connection is there, and not before.
      return installed;
    }
    Ask();
  }
  return installed;
}

void PolicyLink::Ask() {
  const proto::SnapshotRequest request{newest_seen_, name_, kind_.shipped, kind_.without_model};
  const std::string header = proto::Encode(request, {});
  if (!client_.Send({transport::Frame::Copy(header), {}})) return;
  asked_ = true;
  asked_at_ = steady_clock::now();
}

bool PolicyLink::Take(const proto::Header& header, std::span<const std::byte> payload) {
  if (const auto* refusal = std::get_if<proto::Refusal>(&header)) {
    if (refusal->code == proto::RefusalCode::kTooFast ||
        refusal->code == proto::RefusalCode::kNotReady) {
      const auto now = steady_clock::now();
      if (!said_refusal_at_ || now - *said_refusal_at_ > kSayAskRefusal) {
        said_refusal_at_ = now;
        spdlog::warn("learner at {}: {} ({}); trying again", endpoint_, refusal->text,
                     proto::ToString(refusal->code));
      }
      return false;
    }
    throw base::Error("the learner at {} refuses this process: {} ({})", endpoint_, refusal->text,
                      proto::ToString(refusal->code));
  }
  const auto* snapshot = std::get_if<proto::Snapshot>(&header);
  if (snapshot == nullptr) return false;
  asked_ = false;
  unanswered_ = 0;
  // Any version other than the one held is taken, even an older one: the learner went back to a
  // checkpoint. Without a payload there is no newer policy; the answer only shows that the learner
  // is alive.
  if (snapshot->version == newest_seen_ || payload.empty()) return false;
  if (const auto failure = install_(payload)) {
    const std::string text = fmt::format("policy {} of the learner at {}: {}", snapshot->version,
                                         endpoint_, failure->text);
    if (!has_policy()) throw base::Error(text);
    spdlog::error("{}; policy {} stays", text, version_);
    newest_seen_ = snapshot->version;
    ++rejected_;
    return false;
  }
  version_ = newest_seen_ = snapshot->version;
  ++received_;
  published_s_ = 1e-9 * static_cast<double>(snapshot->published_ns);
  latency_s_ = base::UnixSeconds() - published_s_;
  return true;
}

}  // namespace slalom::service
