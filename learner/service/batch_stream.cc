#include "learner/service/batch_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/log.h"
#include "replay/priority_bytes.h"
#include "replay/sample_bytes.h"

namespace slalom::learner {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

BatchStream::BatchStream(transport::Context& context, const transport::ClientOptions& replay,
                         proto::Hello hello, const replay::SampleSpec& spec, int prefetch,
                         std::uint64_t cursor)
    : link_(context, replay, std::move(hello)),
      spec_(spec),
      prefetch_(prefetch),
      cursor_(cursor),
      requested_(cursor) {}

void BatchStream::Request() {
  if (!link_.welcomed()) return;
  // On a new connection nothing that was asked for before is on its way.
  if (link_.num_welcomes() != num_welcomes_) requested_ = cursor_;
  num_welcomes_ = link_.num_welcomes();
  while (requested_ < cursor_ + static_cast<std::uint64_t>(prefetch_)) {
    proto::SampleRequest request;
    request.cursor = requested_;
    request.batch = spec_.batch;
    request.history = spec_.history;
    request.n_step = spec_.n_step;
    request.gamma = spec_.gamma;
    request.prioritized = spec_.prioritized;
    request.importance_exponent = spec_.importance_exponent;
    if (!link_.Send(request)) return;
    ++requested_;
  }
}

const RemoteBatch* BatchStream::Next(milliseconds timeout) {
  const auto give_up = steady_clock::now() + timeout;
  do {
    Request();
    const auto left = std::chrono::ceil<milliseconds>(give_up - steady_clock::now());
    auto received = link_.Receive(std::max(left, milliseconds(0)));
    if (received && Take(std::move(*received))) return &batch_;
  } while (steady_clock::now() < give_up);
  return nullptr;
}

bool BatchStream::Take(service::ReplayLink::Received received) {
  if (auto* status = std::get_if<proto::StatusReply>(&received.header)) {
    status_ = std::move(*status);
    return false;
  }
  if (const auto* refusal = std::get_if<proto::Refusal>(&received.header)) {
    // Of what was sent before the hello on a new connection; it is asked for again after it.
    if (!link_.welcomed()) return false;
    spdlog::warn("replay server at {}: {} ({})", link_.endpoint(), refusal->text,
                 proto::ToString(refusal->code));
    link_.SayHello();
    return false;
  }
  const auto* reply = std::get_if<proto::SampleReply>(&received.header);
  if (reply == nullptr || reply->cursor != cursor_) return false;  // Asked for twice.
  if (reply->batch != spec_.batch || reply->history != spec_.history) {
    throw base::Error(fmt::format(
        "batch {} of the replay server at {} is [{}, {}], expected "
        "[{}, {}]",
        cursor_, link_.endpoint(), reply->batch, reply->history, spec_.batch, spec_.history));
  }
  batch_.header = *reply;
  batch_.payload = std::move(received.payload);
  const auto failure = replay::ParseSample(
      batch_.payload.bytes(), {reply->batch, reply->history, reply->num_beams, reply->weighted},
      &batch_.rows);
  if (failure) {
    throw base::Error(fmt::format("batch {} of the replay server at {}: {}", cursor_,
                                  link_.endpoint(), failure->text));
  }
  ++cursor_;
  Request();
  return true;
}

void BatchStream::SetPriorities(std::span<const std::int64_t> sequence,
                                std::span<const float> priority) {
  if (!link_.welcomed()) return;
  const int count = static_cast<int>(sequence.size());
  transport::Frame payload(replay::PrioritySize(count));
  replay::WritePriorities(sequence, priority, payload.mutable_bytes());
  static_cast<void>(link_.Send(proto::PriorityUpdate{count}, std::move(payload)));
}

void BatchStream::AskStatus() {
  if (link_.welcomed()) static_cast<void>(link_.Send(proto::StatusRequest{}));
}

}  // namespace slalom::learner
