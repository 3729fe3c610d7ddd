#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "base/check.h"
#include "proto/messages.h"
#include "proto/transport/context.h"
#include "proto/transport/server.h"
#include "replay/rate_limiter.h"
#include "replay/service/insert_desk.h"
#include "replay/service/reply_sender.h"
#include "replay/table.h"
#include "tests/replay/service/fake_log.h"

namespace slalom::actor {

/// A replay server's insert desk behind a real socket, in the test's own thread: it holds chunks
/// until the test lets them in, and answers in `Turn` only.
class HoldingReplay : public replay::ReplySender {
 public:
  static constexpr int kBeams = 8;

  HoldingReplay() : server_(context_, {.endpoint = "tcp://127.0.0.1:*"}) {
    logs_.emplace_back();
    Open();
  }

  const std::string& endpoint() const { return server_.endpoint(); }

  /// Takes the messages that have come, waiting for the first no longer than 1 ms.
  void Turn() {
    auto wait = std::chrono::milliseconds(1);
    while (auto received = server_.Receive(std::exchange(wait, {}))) Take(std::move(*received));
    Answer();
  }

  /// Lets in so many of the chunks that are held, and acknowledges them.
  void LetIn(int chunks) {
    limiter_->SetStarved(true);
    desk_->Advance({}, chunks);
    limiter_->SetStarved(always_);
    Answer();
  }

  /// From now on, chunks are let in when they come.
  void LetInAlways() {
    always_ = true;
    LetIn(1 << 20);
  }

  /// Is killed and started again: what it held is gone.
  void Restart() {
    logs_.back().Crash(0);
    Open();
  }

  /// Remembers what is let in so far, for `GoBack`.
  void BackUp() { logs_.push_front(logs_.back()); }
  /// Is started from the backup.
  void GoBack() {
    logs_.push_back(logs_.front());
    Open();
  }

  int num_hellos() const { return num_hellos_; }
  /// The session of the last hello, or 0 if there was none.
  std::uint64_t session() const { return session_; }
  std::int64_t num_held() const { return desk_->num_held(); }
  std::int64_t steps() const { return desk_->sessions().accepted_steps(); }

 private:
  // Beyond what may be inserted ahead of a learner that never comes.
  static constexpr std::int64_t kStepsBefore = 1000;

  void Open() {
    table_ = std::make_unique<replay::Table>(replay::ReplayConfig{.capacity = 10000}, kBeams);
    replay::Sessions sessions;
    logs_.back().Replay(table_.get(), &sessions);
    limiter_ = std::make_unique<replay::RateLimiter>(
        replay::RateLimiter::Options{.updates_per_step = 1.0, .max_ahead_steps = 1}, kStepsBefore);
    limiter_->SetStarved(always_);
    desk_ = std::make_unique<replay::InsertDesk>(
        replay::InsertDesk::Options{.server = 1, .software = "test"}, std::move(sessions),
        table_.get(), limiter_.get(), &logs_.back(), this);
  }

  void Take(transport::Server::Received received) {
    const auto header =
        proto::Decode(received.message.header.bytes(), received.message.payload.bytes());
    SLALOM_CHECK(header.ok());
    if (const auto* hello = std::get_if<proto::Hello>(&*header)) {
      ++num_hellos_;
      session_ = hello->session;
      desk_->Hello(received.peer, *hello, {});
    } else if (const auto* insert = std::get_if<proto::Insert>(&*header)) {
      desk_->Insert(received.peer, *insert, std::move(received.message.payload), {});
    } else if (const auto* goodbye = std::get_if<proto::Goodbye>(&*header)) {
      desk_->Goodbye(received.peer, *goodbye, {});
    }
  }

  void Answer() {
    logs_.back().WriteAll();
    desk_->Advance({}, 0);
  }

  Sent Send(const transport::PeerId& peer, transport::Message&& message) override {
    return server_.Send(peer, std::move(message));
  }

  transport::Context context_;
  transport::Server server_;
  std::deque<replay::FakeLog> logs_;  // The last is in use. Copies share the rows of the originals.
  std::unique_ptr<replay::Table> table_;
  std::unique_ptr<replay::RateLimiter> limiter_;
  std::unique_ptr<replay::InsertDesk> desk_;
  int num_hellos_ = 0;
  std::uint64_t session_ = 0;
  bool always_ = false;
};

}  // namespace slalom::actor
