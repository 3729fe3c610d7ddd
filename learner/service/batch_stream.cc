#include "learner/service/batch_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "replay/priority_bytes.h"
#include "replay/sample_bytes.h"

namespace slalom::learner {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

BatchStream::BatchStream(transport::Context& context, const transport::ClientOptions& replay,
                         proto::Hello hello, std::vector<replay::SampleSpec> specs, int prefetch,
                         std::uint64_t cursor)
    : link_(context, replay, std::move(hello)),
      specs_(std::move(specs)),
      prefetch_(prefetch * static_cast<int>(specs_.size())),
      cursor_(cursor),
      requested_(cursor) {
  batches_.payloads.resize(specs_.size());
  batches_.rows.resize(specs_.size());
}

void BatchStream::Request() {
  if (!link_.welcomed()) return;
  // On a new connection nothing that was asked for before is on its way.
  const std::uint64_t next = cursor_ + static_cast<std::uint64_t>(num_here_);
  if (link_.num_welcomes() != num_welcomes_) requested_ = next;
  num_welcomes_ = link_.num_welcomes();
  while (requested_ < next + static_cast<std::uint64_t>(prefetch_)) {
    const replay::SampleSpec& spec = specs_[requested_ % specs_.size()];
    proto::SampleRequest request;
    request.cursor = requested_;
    request.batch = spec.batch;
    request.history = spec.history;
    request.n_step = spec.n_step;
    request.gamma = spec.gamma;
    request.prioritized = spec.prioritized;
    request.importance_exponent = spec.importance_exponent;
    if (!link_.Send(request)) return;
    ++requested_;
  }
}

const RemoteBatches* BatchStream::Next(milliseconds timeout) {
  const auto give_up = steady_clock::now() + timeout;
  do {
    Request();
    const auto left = std::chrono::ceil<milliseconds>(give_up - steady_clock::now());
    auto received = link_.Receive(std::max(left, milliseconds(0)));
    if (received && Take(std::move(*received))) return &batches_;
  } while (steady_clock::now() < give_up);
  return nullptr;
}

bool BatchStream::Take(service::ReplayLink::Received received) {
  if (auto* status = std::get_if<proto::StatusReply>(&received.header)) {
    status_ = std::move(*status);
    return false;
  }
  const auto* reply = std::get_if<proto::SampleReply>(&received.header);
  if (reply == nullptr || reply->cursor != cursor_ + num_here_) return false;  // Asked for twice.
  const replay::SampleSpec& spec = specs_[num_here_];
  if (reply->batch != spec.batch || reply->history != spec.history) {
    throw base::Error(fmt::format(
        "batch {} of the replay server at {} is [{}, {}], expected "
        "[{}, {}]",
        reply->cursor, link_.endpoint(), reply->batch, reply->history, spec.batch, spec.history));
  }
  transport::Frame& payload = batches_.payloads[num_here_];
  batches_.header = *reply;
  payload = std::move(received.payload);
  const auto failure = replay::ParseSample(
      payload.bytes(), {reply->batch, reply->history, reply->num_beams, reply->weighted},
      &batches_.rows[num_here_]);
  if (failure) {
    throw base::Error(fmt::format("batch {} of the replay server at {}: {}", reply->cursor,
                                  link_.endpoint(), failure->text));
  }
  ++num_here_;
  const bool complete = num_here_ == static_cast<int>(specs_.size());
  if (complete) {
    cursor_ += specs_.size();
    num_here_ = 0;
  }
  Request();
  return complete;
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
