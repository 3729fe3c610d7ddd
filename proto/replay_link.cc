#include "proto/replay_link.h"

#include <fmt/format.h>

#include <utility>

#include "base/clock.h"
#include "base/error.h"
#include "base/log.h"

namespace slalom::service {
namespace {

using std::chrono::steady_clock;

// A hello also serves to ask whether the server is still there.
constexpr std::chrono::seconds kSilence{5};
constexpr std::chrono::seconds kAnswerWithin{5};
// Unanswered hellos after which the connection is dropped.
constexpr int kMaxUnanswered = 2;
constexpr std::chrono::seconds kReportInterval{1};
// Between two lines about hellos that were refused.
constexpr std::chrono::minutes kSayRefusal{1};

bool IsForGood(proto::RefusalCode code) {
  return code == proto::RefusalCode::kWrongVersion || code == proto::RefusalCode::kNotAllowed ||
         code == proto::RefusalCode::kWrongSpec;
}

/// The hello of a process, whose session is its start if its role does not count sessions, [us].
proto::Hello WithSession(proto::Hello hello) {
  if (hello.session == 0) hello.session = static_cast<std::uint64_t>(1e6 * base::UnixSeconds());
  return hello;
}

}  // namespace

ReplayLink::ReplayLink(transport::Context& context, const transport::ClientOptions& replay,
                       proto::Hello hello)
    : client_(context, replay), endpoint_(replay.endpoint), hello_(WithSession(std::move(hello))) {}

void ReplayLink::SetHello(proto::Hello hello) {
  hello_ = std::move(hello);
  SayHello();
}

void ReplayLink::SayHello() {
  welcomed_ = false;
  is_new_ = true;
  said_hello_ = false;
  Watch();
}

std::optional<ReplayLink::Received> ReplayLink::Receive(std::chrono::milliseconds timeout) {
  Watch();
  auto message = client_.Receive(timeout);
  if (!message) return std::nullopt;
  auto header = proto::Decode(message->header.bytes(), message->payload.bytes());
  if (!header) {
    spdlog::warn("replay server at {}: {}", endpoint_, header.failure().text);
    return std::nullopt;
  }
  heard_at_ = steady_clock::now();
  unanswered_ = 0;
  if (const auto* refusal = std::get_if<proto::Refusal>(&*header)) {
    const bool is_replaced = refusal->code == proto::RefusalCode::kReplaced;
    if (IsForGood(refusal->code) || (is_replaced && hello_.role != "actor")) {
      throw base::Error("the replay server at {} refuses this process: {} ({})", endpoint_,
                        refusal->text, proto::ToString(refusal->code));
    }
    if (!is_replaced) {
      if (!welcomed_) {
        NoteRefusal(*refusal);
        return std::nullopt;
      }
      spdlog::warn("replay server at {}: {} ({})", endpoint_, refusal->text,
                   proto::ToString(refusal->code));
      SayHello();
    }
  }
  if (const auto* welcome = std::get_if<proto::Welcome>(&*header)) {
    // This answers an earlier hello, not the last one.
    if (welcome->session != hello_.session) return std::nullopt;
    welcomed_ = true;
    refusal_.clear();
    num_welcomes_ += is_new_ ? 1 : 0;
    is_new_ = false;
  }
  return Received{std::move(*header), std::move(message->payload)};
}

void ReplayLink::NoteRefusal(const proto::Refusal& refusal) {
  // It answers a message from before the hello, which was meant for an earlier connection.
  if (refusal.code == proto::RefusalCode::kNoSession) return;
  refusal_ = fmt::format("{} ({})", refusal.text, proto::ToString(refusal.code));
  const auto now = steady_clock::now();
  if (said_refusal_at_ && now - *said_refusal_at_ < kSayRefusal) return;
  said_refusal_at_ = now;
  spdlog::warn("replay server at {}: {}; trying again", endpoint_, refusal_);
}

std::string ReplayLink::trouble() {
  if (welcomed_) return "";
  return refusal_.empty() ? client_.trouble() : refusal_;
}

bool ReplayLink::Send(const proto::Header& header, transport::Frame payload) {
  const std::string encoded = proto::Encode(header, payload.bytes());
  return client_.Send({transport::Frame::Copy(encoded), std::move(payload)});
}

void ReplayLink::Watch() {
  const auto now = steady_clock::now();
  if (const int connections = client_.connections(); connections != connections_) {
    connections_ = connections;
    welcomed_ = false;
    is_new_ = true;
    said_hello_ = false;
    heard_at_ = now;
  }
  if (connections_ == 0) return;
  const auto since_hello = hello_at_ ? now - *hello_at_ : steady_clock::duration::max();
  const bool ask = said_hello_ ? now - heard_at_ > kSilence && since_hello > kAnswerWithin
                               : since_hello > std::chrono::milliseconds(200);
  if (!ask) return;
  if (said_hello_ && ++unanswered_ > kMaxUnanswered) {
    spdlog::warn("replay server at {}: no answer, reconnecting", endpoint_);
    client_.Reconnect();
    unanswered_ = 0;
    said_hello_ = false;
    welcomed_ = false;
    return;
  }
  if (Send(hello_)) {
    said_hello_ = true;
    hello_at_ = now;
  }
}

bool ReplayLink::report_due() const {
  return welcomed_ && (!reported_at_ || steady_clock::now() - *reported_at_ >= kReportInterval);
}

void ReplayLink::SendReport(const proto::Report& report) {
  reported_at_ = steady_clock::now();
  // A report that cannot be sent now is dropped; the next one replaces it.
  static_cast<void>(Send(report));
}

}  // namespace slalom::service
