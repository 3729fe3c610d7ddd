#include "learner/service/batch_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "replay/sample_bytes.h"

namespace slalom::learner {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

BatchStream::BatchStream(transport::Context& context, const transport::ClientOptions& replay,
                         proto::Hello hello, const env::StepShape& shape,
                         std::vector<replay::SampleSpec> specs, int prefetch, std::uint64_t cursor)
    : link_(context, replay, std::move(hello)),
      shape_(shape),
      specs_(std::move(specs)),
      prefetch_(prefetch * static_cast<int>(specs_.size())),
      cursor_(cursor),
      requested_(cursor) {
  batches_.payloads.resize(specs_.size());
  batches_.rows.resize(specs_.size());
}

void BatchStream::Request() {
  if (!link_.welcomed()) return;
  // On a new connection, answers to earlier requests never come.
  const std::uint64_t next = cursor_ + static_cast<std::uint64_t>(num_here_);
  if (link_.num_welcomes() != num_welcomes_) requested_ = next;
  num_welcomes_ = link_.num_welcomes();
  while (requested_ < next + static_cast<std::uint64_t>(prefetch_)) {
    if (!Ask(specs_[requested_ % specs_.size()])) return;
    ++requested_;
  }
}

bool BatchStream::Ask(const replay::SampleSpec& spec) {
  proto::SampleRequest request;
  request.cursor = requested_;
  request.batch = spec.batch;
  request.history = spec.history;
  request.n_step = spec.n_step;
  request.gamma = spec.gamma;
  request.prioritized = spec.prioritized;
  request.importance_exponent = spec.importance_exponent;
  return link_.Send(request);
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
  if (reply == nullptr) return false;
  if (window_spec_ && reply->history == window_spec_->history) {
    window_payload_ = std::move(received.payload);
    Parse(*reply, *window_spec_, window_payload_, &windows_);
    windows_came_ = true;
    windows_asked_ = -1;
    return false;
  }
  if (reply->cursor != cursor_ + num_here_) return false;  // It was requested twice.
  transport::Frame& payload = batches_.payloads[num_here_];
  batches_.header = *reply;
  payload = std::move(received.payload);
  Parse(*reply, specs_[num_here_], payload, &batches_.rows[num_here_]);
  ++num_here_;
  const bool complete = num_here_ == static_cast<int>(specs_.size());
  if (complete) {
    cursor_ += specs_.size();
    num_here_ = 0;
  }
  Request();
  return complete;
}

void BatchStream::Parse(const proto::SampleReply& reply, const replay::SampleSpec& spec,
                        const transport::Frame& payload, replay::SampledRows* rows) const {
  if (reply.batch != spec.batch || reply.history != spec.history) {
    throw base::Error(fmt::format(
        "batch {} of the replay server at {} is [{}, {}], expected [{}, {}]", reply.cursor,
        link_.endpoint(), reply.batch, reply.history, spec.batch, spec.history));
  }
  const auto failure = replay::ParseSample(
      payload.bytes(), {reply.batch, reply.history, shape_, reply.weighted}, rows);
  if (failure) {
    throw base::Error(fmt::format("batch {} of the replay server at {}: {}", reply.cursor,
                                  link_.endpoint(), failure->text));
  }
}

// Uses the number of the next batch, which is requested under the same number afterwards. As the
// rate limiter counts by a learner's cursor, this sample does not take a batch from the run.
void BatchStream::AskWindows(const replay::SampleSpec& spec) {
  if (!link_.welcomed() || link_.num_welcomes() != num_welcomes_) return;
  if (windows_asked_ == num_welcomes_) return;
  window_spec_ = spec;
  if (Ask(spec)) windows_asked_ = num_welcomes_;
}

const replay::SampledRows* BatchStream::TakeWindows() {
  return std::exchange(windows_came_, false) ? &windows_ : nullptr;
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
