#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <optional>
#include <string>

#include "replay/service/insert_desk.h"
#include "tests/replay/service/fake_log.h"
#include "tests/replay/service/rows_source.h"

namespace slalom::replay {

/// Connections that a test cuts.
class FakeNetwork : public ReplySender {
 public:
  Sent Send(const transport::PeerId& peer, transport::Message&& message) override {
    const auto it = queues_.find(peer);
    if (it == queues_.end()) return Sent::kGone;
    if (it->second.size() >= 20) return Sent::kFull;
    const auto header = proto::Decode(message.header.bytes(), message.payload.bytes());
    SLALOM_CHECK(header.ok());
    it->second.push_back(*header);
    return Sent::kYes;
  }

  transport::PeerId Connect() {
    const transport::PeerId peer = fmt::format("peer-{}", next_++);
    queues_[peer];
    return peer;
  }
  void Cut(const transport::PeerId& peer) { queues_.erase(peer); }
  std::optional<proto::Header> Take(const transport::PeerId& peer) {
    auto& queue = queues_.at(peer);
    if (queue.empty()) return std::nullopt;
    const proto::Header header = queue.front();
    queue.pop_front();
    return header;
  }

 private:
  std::map<transport::PeerId, std::deque<proto::Header>> queues_;
  int next_ = 0;
};

/// An actor as the protocol wants it, with its books: made = accepted + lost + pending.
class ModelActor {
 public:
  ModelActor(std::string name, int streams, std::uint64_t seed)
      : name_(std::move(name)), streams_(streams), source_(1, streams, seed) {}

  void Connect(FakeNetwork* network) {
    if (peer_) network->Cut(*peer_);
    peer_ = network->Connect();
    greeted_ = false;
    hello_sent_ = false;
  }

  /// It is killed and starts anew: what was not acknowledged is lost with it.
  void Restart(FakeNetwork* network) {
    unsettled_[session_] = made_;
    ++session_;
    made_ = 0;
    next_ = first_ = 0;
    chunks_.clear();
    source_.Reset();
    ended_ = false;
    Connect(network);
  }

  void Make() {
    if (ended_ || chunks_.size() >= 12) return;
    Chunk chunk = source_.Next();
    made_ += RowsSource::NumSteps(chunk);
    total_made_ += RowsSource::NumSteps(chunk);
    chunks_.push_back(std::move(chunk));
  }

  void Send(InsertDesk* desk, InsertDesk::Time now, base::Random& random) {
    if (!greeted_) {
      if (!hello_sent_ || random.Uniform() < 0.1) {
        desk->Hello(*peer_,
                    {.role = "actor",
                     .name = name_,
                     .session = session_,
                     .num_beams = source_.num_beams(),
                     .num_streams = streams_,
                     .software = ""},
                    now);
        hello_sent_ = true;
      }
      return;
    }
    std::uint64_t sequence = next_;
    const double what = random.Uniform();
    if (what < 0.1 && next_ > first_) sequence = first_ + random.UniformInt(next_ - first_);
    if (what > 0.95 && next_ + 1 < first_ + chunks_.size()) sequence = next_ + 1;
    if (sequence >= first_ + chunks_.size()) return;
    const Chunk& chunk = chunks_[sequence - first_];
    // Now and then it minds no window.
    if (sequence == next_ && !KeepsToWindow() && random.Uniform() > 0.02) return;
    desk->Insert(*peer_,
                 {.session = session_,
                  .sequence = sequence,
                  .num_rows = chunk.num_rows(),
                  .num_beams = source_.num_beams(),
                  .num_steps = RowsSource::NumSteps(chunk)},
                 RowsSource::Bytes(chunk), now);
    if (sequence == next_) ++next_;
  }

  void Goodbye(InsertDesk* desk, InsertDesk::Time now) {
    if (!greeted_ || !chunks_.empty() || ended_) return;
    desk->Goodbye(*peer_, {.session = session_}, now);
    ended_ = true;
  }

  void Receive(FakeNetwork* network, const FakeLog& log) {
    const auto header = network->Take(*peer_);
    if (!header) return;
    if (const auto* welcome = std::get_if<proto::Welcome>(&*header)) {
      ASSERT_EQ(welcome->session, session_);
      Settle(*welcome);
      Acknowledge(welcome->next_sequence, log);
      next_ = first_;
      window_ = welcome->window_bytes;
      greeted_ = true;
    } else if (const auto* ack = std::get_if<proto::InsertAck>(&*header)) {
      ASSERT_EQ(ack->session, session_);
      Acknowledge(ack->next_sequence, log);
      window_ = ack->window_bytes;
    } else if (const auto* refusal = std::get_if<proto::Refusal>(&*header)) {
      ASSERT_NE(refusal->code, proto::RefusalCode::kBadMessage) << refusal->text;
      ++refusals_[refusal->code];
      greeted_ = hello_sent_ = false;
    } else {
      FAIL() << proto::NameOf(*header);
    }
  }

  bool idle() const { return greeted_ && (chunks_.empty() || ended_); }
  const std::string& name() const { return name_; }
  std::uint64_t session() const { return session_; }
  std::int64_t total_made() const { return total_made_; }
  std::int64_t accepted() const { return accepted_; }
  std::int64_t lost() const { return lost_; }
  bool settled() const { return unsettled_.empty(); }
  int refusals(proto::RefusalCode code) { return refusals_[code]; }

 private:
  /// Whether the chunk `next_` may be sent now.
  bool KeepsToWindow() const {
    if (next_ == first_) return window_ > 0;
    std::int64_t bytes = 0;
    for (std::uint64_t i = first_; i <= next_; ++i) {
      const Chunk& chunk = chunks_[i - first_];
      bytes += static_cast<std::int64_t>(RowBytes::Size(chunk.num_rows(), source_.num_beams()));
    }
    return bytes <= window_;
  }

  void Settle(const proto::Welcome& welcome) {
    for (const auto& [number, made] : unsettled_) {
      const bool known = number == welcome.previous_session;
      const std::int64_t accepted = known ? welcome.previous_accepted_steps : 0;
      ASSERT_LE(accepted, made);
      ASSERT_GE(accepted, acknowledged_[number]) << "less than was acknowledged";
      accepted_ += accepted - acknowledged_[number];
      lost_ += made - accepted;
    }
    unsettled_.clear();
  }

  void Acknowledge(std::uint64_t next_sequence, const FakeLog& log) {
    ASSERT_GE(next_sequence, first_) << "something acknowledged is gone";
    ASSERT_LE(next_sequence, first_ + chunks_.size());
    if (next_sequence > first_) {
      // What is acknowledged survives a kill at this moment.
      FakeLog copy = log;
      copy.Crash(0);
      ASSERT_TRUE(copy.Chunks().contains({name_, session_, next_sequence - 1}));
    }
    for (; first_ < next_sequence; ++first_) {
      const std::int64_t steps = RowsSource::NumSteps(chunks_.front());
      acknowledged_[session_] += steps;
      accepted_ += steps;
      chunks_.pop_front();
    }
    next_ = std::max(next_, first_);
  }

  const std::string name_;
  const int streams_;
  RowsSource source_;
  std::optional<transport::PeerId> peer_;
  bool greeted_ = false;
  bool hello_sent_ = false;
  bool ended_ = false;
  std::uint64_t session_ = 1;
  std::deque<Chunk> chunks_;  ///< Not acknowledged.
  std::uint64_t first_ = 0;   ///< Sequence of the first of them.
  std::uint64_t next_ = 0;    ///< To be sent.
  std::int64_t window_ = 0;
  std::int64_t made_ = 0;  ///< Steps in this session.
  std::int64_t total_made_ = 0;
  std::int64_t accepted_ = 0;
  std::int64_t lost_ = 0;
  std::map<std::uint64_t, std::int64_t> acknowledged_;
  std::map<std::uint64_t, std::int64_t> unsettled_;
  std::map<proto::RefusalCode, int> refusals_;
};

}  // namespace slalom::replay
