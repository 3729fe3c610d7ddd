#include "replay/service/sample_desk.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "base/random.h"
#include "replay/sample_bytes.h"

namespace slalom::replay {
namespace {

using proto::RefusalCode;
using transport::PeerId;

constexpr std::uint64_t kMaxCursor = std::uint64_t{1} << 52;
// Most times kept between two readings.
constexpr std::size_t kMaxSampleSeconds = 1 << 16;

SampleSpec SpecOf(const proto::SampleRequest& request) {
  return {.batch = request.batch,
          .history = request.history,
          .n_step = request.n_step,
          .gamma = request.gamma,
          .prioritized = request.prioritized,
          .importance_exponent = request.importance_exponent};
}

SampleShape ShapeOf(const proto::SampleRequest& request, const env::StepShape& step) {
  return {.batch = request.batch,
          .history = request.history,
          .step = step,
          .weighted = request.prioritized};
}

/// Returns why a request that passed `proto::Decode` cannot be served, or nothing if it can.
std::string FaultOf(const proto::SampleRequest& request, const env::StepShape& step,
                    std::int64_t max_bytes) {
  if (request.cursor > kMaxCursor) return fmt::format("cursor {} is too large", request.cursor);
  const auto size = SampleSize(ShapeOf(request, step));
  if (!size || *size > static_cast<std::size_t>(max_bytes)) {
    return fmt::format("a sample of {} windows of {} scans is larger than {} bytes", request.batch,
                       request.history, max_bytes);
  }
  return "";
}

}  // namespace

SampleDesk::SampleDesk(const Options& options, Table* table, RateLimiter* limiter,
                       ReplySender* replies)
    : options_(options), table_(table), limiter_(limiter), replies_(replies) {}

void SampleDesk::Ask(const PeerId& peer, const std::string& learner,
                     const proto::SampleRequest& request) {
  const std::string fault = FaultOf(request, table_->shape(), options_.max_sample_bytes);
  if (!fault.empty()) return Refuse(peer, RefusalCode::kBadMessage, fault, request.cursor);
  Line& line = lines_[peer];
  line.learner = learner;
  if (line.requests.size() >= kMaxRequests) {
    return Refuse(
        peer, RefusalCode::kOverWindow,
        fmt::format("{} requests are unanswered already; no more are accepted", kMaxRequests),
        request.cursor);
  }
  if (request.prioritized) table_->UsePriorities(options_.priority_exponent);
  line.requests.push_back(request);
  line.silent = false;
}

void SampleDesk::SetPriorities(const PeerId& peer, const proto::PriorityUpdate& update,
                               std::span<const std::byte> payload) {
  const auto view = ParsePriorities(payload, update.count);
  if (!view) return Refuse(peer, RefusalCode::kBadMessage, view.failure().text, 0);
  table_->UsePriorities(options_.priority_exponent);
  const std::int64_t set = table_->SetPriorities(view->sequence, view->priority);
  counts_.priorities_set += set;
  counts_.priorities_stale += update.count - set;
}

void SampleDesk::Gone(const PeerId& peer) {
  const auto it = lines_.find(peer);
  if (it == lines_.end()) return;
  const std::string learner = it->second.learner;
  lines_.erase(it);
  for (const auto& [other, line] : lines_) {
    if (line.learner == learner) return;
  }
  limiter_->Leave(learner);
}

void SampleDesk::Silent(const PeerId& peer) {
  const auto it = lines_.find(peer);
  if (it == lines_.end() || it->second.silent) return;
  it->second.silent = true;
  limiter_->Leave(it->second.learner);
}

bool SampleDesk::Advance(int max_replies, double acting_version) {
  starved_ = false;
  num_held_ = 0;
  int sent = 0;
  std::vector<PeerId> gone;
  // One round over all peers, beginning after the one that was answered last.
  auto it = lines_.upper_bound(last_);
  for (std::size_t turn = 0; turn < lines_.size() && sent < max_replies; ++turn, ++it) {
    if (it == lines_.end()) it = lines_.begin();
    auto& [peer, line] = *it;
    while (!line.requests.empty() && sent < max_replies) {
      const Step step = Answer(peer, &line, acting_version);
      if (step == Step::kGone) gone.push_back(peer);
      if (step == Step::kHeld) num_held_ += static_cast<std::int64_t>(line.requests.size());
      if (step != Step::kSent) break;
      last_ = peer;
      ++sent;
    }
  }
  for (const PeerId& peer : gone) Gone(peer);
  limiter_->SetStarved(starved_);
  return sent >= max_replies;
}

SampleDesk::Step SampleDesk::Answer(const PeerId& peer, Line* line, double acting_version) {
  const proto::SampleRequest& request = line->requests.front();
  if (!line->ready) {
    limiter_->Ask(line->learner, request.cursor);
    if (line->silent) limiter_->Leave(line->learner);
    if (!limiter_->MaySample(line->learner)) return Step::kHeld;
    if (!Draw(request)) {
      starved_ = true;
      return Step::kHeld;
    }
    const auto begin = std::chrono::steady_clock::now();
    line->ready = Reply(request, line, acting_version);
    if (sample_seconds_.size() < kMaxSampleSeconds) {
      const auto took = std::chrono::steady_clock::now() - begin;
      sample_seconds_.push_back(std::chrono::duration<double>(took).count());
    }
  }
  switch (replies_->Send(peer, std::move(*line->ready))) {
    case ReplySender::Sent::kGone:
      return Step::kGone;
    case ReplySender::Sent::kFull:
      return Step::kBlocked;
    case ReplySender::Sent::kYes:
      break;
  }
  ++counts_.batches;
  counts_.samples += request.batch;
  limiter_->Grant(line->learner);
  line->ready.reset();
  line->requests.pop_front();
  return Step::kSent;
}

MirroredRows* SampleDesk::MirrorOf(const proto::SampleRequest& request, Line* line) {
  const int num_beams = table_->shape().num_beams;
  const int places = request.mirror_places;
  if (request.mirror == 0 || num_beams == 0 || places < 1 || places > table_->config().capacity) {
    return nullptr;
  }
  if (line->mirror == request.mirror) {
    return line->mirrored && line->mirror_places == places ? &*line->mirrored : nullptr;
  }
  const auto others = std::ranges::count_if(lines_, [line](const auto& entry) {
    return &entry.second != line && entry.second.mirrored.has_value();
  });
  line->mirrored.reset();
  line->mirror = request.mirror;
  line->mirror_places = places;
  if (others < kMaxMirrors) line->mirrored.emplace(places);
  return line->mirrored ? &*line->mirrored : nullptr;
}

transport::Message SampleDesk::Reply(const proto::SampleRequest& request, Line* line,
                                     double acting_version) {
  const SampleShape shape = ShapeOf(request, table_->shape());
  proto::SampleReply reply{.cursor = request.cursor,
                           .batch = shape.batch,
                           .history = shape.history,
                           .num_beams = shape.step.num_beams,
                           .weighted = shape.weighted,
                           .inserted_steps = limiter_->steps(),
                           .table_steps = table_->num_steps(),
                           .acting_version = acting_version,
                           .table_weight = shape.weighted ? table_->total_weight() : 0.0};
  MirroredRows* const mirror = MirrorOf(request, line);
  if (mirror == nullptr) {
    transport::Frame payload(*SampleSize(shape));
    WriteSample(rows_, shape.weighted, payload.mutable_bytes());
    return MakeMessage(reply, std::move(payload));
  }
  scans_.places.clear();
  scans_.to_send.clear();
  for (const auto* const scans : {&rows_.ranges_cm, &rows_.next_ranges_cm}) {
    for (const std::uint16_t* const scan : *scans) {
      scans_.places.push_back(mirror->Take(table_->SequenceOf(scan)));
      if (scans_.places.back() < 0) scans_.to_send.push_back(scan);
    }
  }
  reply.mirror = request.mirror;
  reply.num_scans = static_cast<int>(scans_.to_send.size());
  transport::Frame payload(MirroredSampleSize(shape, scans_.to_send.size()));
  WriteMirroredSample(rows_, shape.weighted, scans_, payload.mutable_bytes());
  return MakeMessage(reply, std::move(payload));
}

bool SampleDesk::Draw(const proto::SampleRequest& request) {
  // If no window is complete, a draw walks over the whole table. Do not repeat that at every turn.
  if (table_->total_inserted() < retry_at_) return false;
  base::Random random(base::DeriveSeed(options_.seed, "sample", {request.cursor}));
  if (table_->SampleRows(SpecOf(request), random, &rows_)) {
    retry_at_ = 0;
    return true;
  }
  retry_at_ = table_->total_inserted() + table_->num_rows() / 16 + 1;
  return false;
}

std::int64_t SampleDesk::num_waiting() const {
  std::int64_t count = 0;
  for (const auto& [peer, line] : lines_) count += static_cast<std::int64_t>(line.requests.size());
  return count;
}

std::vector<double> SampleDesk::TakeSampleSeconds() { return std::exchange(sample_seconds_, {}); }

void SampleDesk::Refuse(const PeerId& peer, RefusalCode code, std::string_view text,
                        std::uint64_t about) {
  replies_->NoteRefusal(peer, code, text);
  const auto sent = replies_->Send(
      peer, MakeMessage(proto::Refusal{.code = code, .text = std::string(text), .about = about}));
  if (sent == ReplySender::Sent::kGone) Gone(peer);
}

}  // namespace slalom::replay
