// Many actors whose chunks do not fit into the server together: nobody is refused, nothing is sent
// twice, and the server's memory is bounded.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "metrics/registry.h"
#include "replay/service/insert_desk.h"
#include "replay/service/server.h"
#include "tests/replay/service/rows_source.h"
#include "tests/replay/service/test_peer.h"
#include "tests/support/scratch_directory.h"

namespace slalom::replay {
namespace {

using transport::PeerId;

// A tenth of the default config, whose chunks do not fit into its room either.
constexpr int kActors = 200;
constexpr int kBeams = 72;
constexpr int kChunkRows = 256;
constexpr std::int64_t kRoom = 6 << 20;
constexpr std::int64_t kWindow = 400 << 10;
const auto kChunkBytes = static_cast<std::int64_t>(RowBytes::Size(kChunkRows, kBeams));

/// A chunk of one episode, which every actor may send again and again.
const Chunk& FullChunk() {
  static const Chunk chunk = [] {
    Chunk made(kBeams);
    const std::vector<std::uint16_t> ranges(kBeams, 100);
    const std::array<float, env::kStateSize> state{};
    const env::FrameView frame{ranges, state};
    for (int i = 0; i + 1 < kChunkRows; ++i) {
      made.AddStep(
          0, i == 0, frame, {},
          {.reward = 0.0f,
           .cost = 0.0f,
           .outcome = i + 2 < kChunkRows ? env::Outcome::kRunning : env::Outcome::kTimeout});
    }
    made.AddFinal(0, frame);
    return made;
  }();
  return chunk;
}

proto::Hello HelloOf(const std::string& role, const std::string& name) {
  return {.role = role,
          .name = name,
          .session = role == "actor" ? 1u : 0u,
          .num_beams = kBeams,
          .num_streams = 1,
          .software = ""};
}

/// The books of an actor that keeps to the window it was told.
class PacedActor {
 public:
  explicit PacedActor(int chunks) : chunks_(static_cast<std::uint64_t>(chunks)) {}

  /// Notes a message of the server.
  void Take(const proto::Header& header) {
    if (const auto* welcome = std::get_if<proto::Welcome>(&header)) {
      next_ = welcome->next_sequence;  // What came no further is sent again.
      Acknowledge(welcome->next_sequence, welcome->window_bytes);
    } else if (const auto* ack = std::get_if<proto::InsertAck>(&header)) {
      num_without_window_ += ack->window_bytes == 0;
      Acknowledge(ack->next_sequence, ack->window_bytes);
    } else {
      const auto* refusal = std::get_if<proto::Refusal>(&header);
      FAIL() << (refusal == nullptr ? proto::NameOf(header) : refusal->text);
    }
  }

  /// Nothing may be sent until the next welcome.
  void Disconnect() { window_ = 0; }

  bool MaySend() const {
    const auto under_way = static_cast<std::int64_t>(next_ - safe_) * kChunkBytes;
    const bool fits = under_way == 0 ? window_ > 0 : under_way + kChunkBytes <= window_;
    return next_ < chunks_ && fits;
  }
  /// The header of the next chunk, which is sent.
  proto::Insert Next() {
    return {.session = 1,
            .sequence = next_++,
            .num_rows = kChunkRows,
            .num_beams = kBeams,
            .num_steps = kChunkRows - 1};
  }

  bool done() const { return safe_ == chunks_; }
  int num_without_window() const { return num_without_window_; }

 private:
  void Acknowledge(std::uint64_t next_sequence, std::int64_t window) {
    ASSERT_GE(next_sequence, safe_);
    ASSERT_LE(next_sequence, next_) << "more than was sent";
    safe_ = next_sequence;
    window_ = window;
  }

  const std::uint64_t chunks_;
  std::uint64_t next_ = 0;
  std::uint64_t safe_ = 0;
  std::int64_t window_ = 0;
  int num_without_window_ = 0;
};

/// A log that writes what it was given before the last few records, and keeps nothing.
class LaggingLog : public RecordLog {
 public:
  std::uint64_t Append(const SessionRecord&) override { return ++appended_; }
  std::uint64_t Append(const ForgetRecord&) override { return ++appended_; }
  std::uint64_t Append(const RowsRecord& record, std::shared_ptr<const void>) override {
    sequences_[record.id].push_back(record.sequence);
    return ++appended_;
  }
  std::uint64_t written() const override { return written_; }
  void Write() { written_ = appended_; }
  /// The chunks of each session, in order.
  const std::map<std::uint32_t, std::vector<std::uint64_t>>& sequences() const {
    return sequences_;
  }

 private:
  std::uint64_t appended_ = 0;
  std::uint64_t written_ = 0;
  std::map<std::uint32_t, std::vector<std::uint64_t>> sequences_;
};

/// A desk and its actors, in one thread and on a clock of their own.
class Crowd : public ReplySender {
 public:
  Crowd(std::int64_t room, int chunks_of_each)
      : desk_({.flow = {.window_bytes = kWindow, .room_bytes = room, .chunk_bytes = kChunkBytes},
               .server = 1,
               .software = ""},
              {}, &table_, &limiter_, &log_, this),
        actors_(kActors, PacedActor(chunks_of_each)),
        replies_(kActors),
        bytes_(RowsSource::Bytes(FullChunk())) {
    for (int i = 0; i < kActors; ++i)
      desk_.Hello(std::to_string(i), HelloOf("actor", Name(i)), now_);
  }

  Sent Send(const PeerId& peer, transport::Message&& message) override {
    const auto header = proto::Decode(message.header.bytes(), message.payload.bytes());
    SLALOM_CHECK(header.ok());
    replies_[std::stoul(peer)].push_back(*header);
    return Sent::kYes;
  }

  /// 10 ms: actors [first, last) read, and send what they may. Returns the number of chunks sent.
  int Turn(int first, int last) {
    now_ += std::chrono::milliseconds(10);
    int sent = 0;
    for (int i = 0; i < kActors; ++i) {
      PacedActor& actor = actors_[i];
      for (; !replies_[i].empty(); replies_[i].pop_front()) actor.Take(replies_[i].front());
      if (i < first || i >= last || !actor.MaySend()) continue;
      desk_.Insert(std::to_string(i), actor.Next(), bytes_.Share(), now_);
      ++sent;
    }
    most_bytes_ = std::max(most_bytes_, desk_.unwritten_bytes());
    desk_.Advance(now_, kActors);
    log_.Write();
    desk_.Advance(now_, kActors);
    return sent;
  }

  /// Lets in as many chunks as come from now on.
  void LetIn() { limiter_.Ask("learner", 1'000'000); }

  const PacedActor& actor(int i) const { return actors_[i]; }
  const InsertDesk& desk() const { return desk_; }
  const LaggingLog& log() const { return log_; }
  std::int64_t most_bytes() const { return most_bytes_; }

 private:
  static std::string Name(int i) { return "actor-" + std::to_string(i); }

  Table table_{{.capacity = 2000}, kBeams};
  RateLimiter limiter_{{.updates_per_step = 0.25, .learning_starts = 8, .max_ahead_steps = 4096},
                       0};
  LaggingLog log_;
  InsertDesk desk_;
  std::vector<PacedActor> actors_;
  std::vector<std::deque<proto::Header>> replies_;
  const transport::Frame bytes_;
  InsertDesk::Time now_{};
  std::int64_t most_bytes_ = 0;
};

TEST(CrowdTest, HeldActorsAreGrantedRoomInTurnAndNeverRefused) {
  constexpr int kChunks = 4;
  Crowd crowd(kRoom, kChunks);
  // The rate limiter lets few chunks in. Then the room is full and stays so for a minute.
  for (int i = 0; i < 6000; ++i) {
    const int sent = crowd.Turn(0, kActors);
    if (i > 1000) ASSERT_EQ(sent, 0);
    ASSERT_FALSE(HasFatalFailure());
  }
  EXPECT_GT(crowd.desk().unwritten_bytes(), kRoom - 2 * kChunkBytes);
  int without_window = 0;
  for (int i = 0; i < kActors; ++i) without_window += crowd.actor(i).num_without_window() > 0;
  EXPECT_GT(without_window, 0);
  crowd.LetIn();
  for (int i = 0; i < 200; ++i) {
    crowd.Turn(0, kActors);
    ASSERT_FALSE(HasFatalFailure());
  }
  for (int i = 0; i < kActors; ++i) EXPECT_TRUE(crowd.actor(i).done()) << i;
  const InsertDesk::Counts& counts = crowd.desk().counts();
  EXPECT_EQ(counts.chunks_accepted, kActors * kChunks);
  EXPECT_EQ(counts.chunks_duplicate, 0);
  EXPECT_EQ(counts.reconnections, 0);
  for (const std::int64_t rejected : counts.chunks_rejected) EXPECT_EQ(rejected, 0);
  for (const auto& [id, sequences] : crowd.log().sequences()) {
    EXPECT_EQ(sequences, (std::vector<std::uint64_t>{0, 1, 2, 3})) << id;
  }
  EXPECT_EQ(crowd.log().sequences().size(), static_cast<std::size_t>(kActors));
  EXPECT_EQ(crowd.desk().unwritten_bytes(), 0);
  EXPECT_LE(crowd.most_bytes(), kRoom);
}

// Actors that have nothing to send, such as those that wait for a policy, keep no room from others.
TEST(CrowdTest, IdleActorsKeepNobodyOut) {
  constexpr int kChunks = 5;
  constexpr int kIdle = 100;
  Crowd crowd(4 * kChunkBytes, kChunks);
  crowd.LetIn();
  for (int i = 0; i < 100 * kChunks * kIdle; ++i) {
    crowd.Turn(kIdle, kActors);
    ASSERT_FALSE(HasFatalFailure());
    if (crowd.desk().counts().chunks_accepted == kChunks * (kActors - kIdle)) break;
  }
  EXPECT_EQ(crowd.desk().counts().chunks_accepted, kChunks * (kActors - kIdle));
  // Then they have something.
  for (int i = 0; i < 100 * kChunks * kIdle; ++i) {
    crowd.Turn(0, kActors);
    ASSERT_FALSE(HasFatalFailure());
    if (crowd.desk().counts().chunks_accepted == kChunks * kActors) break;
  }
  EXPECT_EQ(crowd.desk().counts().chunks_accepted, kChunks * kActors);
  for (const std::int64_t rejected : crowd.desk().counts().chunks_rejected) EXPECT_EQ(rejected, 0);
  EXPECT_LE(crowd.most_bytes(), 4 * kChunkBytes);
}

/// Actors of one thread, each with a connection of its own to a server that runs.
class ActorsOfAThread {
 public:
  ActorsOfAThread(const std::string& endpoint, int first, int count, int chunks)
      : bytes_(RowsSource::Bytes(FullChunk())) {
    for (int i = 0; i < count; ++i) {
      peers_.push_back(std::make_unique<TestPeer>(context_, endpoint));
      hellos_.push_back(HelloOf("actor", "actor-" + std::to_string(first + i)));
      actors_.emplace_back(chunks);
    }
  }

  /// Sends what is allowed until all of it is acknowledged.
  void Run() {
    for (std::size_t num_done = 0; num_done < actors_.size();) {
      num_done = 0;
      for (std::size_t i = 0; i < actors_.size(); ++i) {
        transport::Client& client = peers_[i]->client();
        while (const auto message = client.Receive(std::chrono::milliseconds(0))) {
          const auto header = proto::Decode(message->header.bytes(), message->payload.bytes());
          ASSERT_TRUE(header.ok());
          actors_[i].Take(*header);
          ASSERT_FALSE(testing::Test::HasFatalFailure());
        }
        // A busy machine may break a connection.
        if (std::exchange(connections_[i], client.connections()) != client.connections()) {
          actors_[i].Disconnect();
          peers_[i]->Send(hellos_[i]);
        }
        if (actors_[i].MaySend()) peers_[i]->Send(actors_[i].Next(), bytes_.Share());
        num_done += actors_[i].done();
      }
    }
  }

 private:
  transport::Context context_;
  const transport::Frame bytes_;
  std::vector<std::unique_ptr<TestPeer>> peers_;
  std::vector<proto::Hello> hellos_;
  std::vector<PacedActor> actors_;
  std::vector<int> connections_ = std::vector<int>(kActors, 0);
};

TEST(CrowdTest, TwoHundredConnectionsAreServedFromAJournal) {
#ifdef __SANITIZE_THREAD__
  // It reports, and suppresses, a race with ZeroMQ's thread for each byte of 28 MB.
  GTEST_SKIP() << "too slow under ThreadSanitizer";
#endif
  constexpr int kThreads = 2;
  constexpr int kChunks = 3;
  test::ScratchDirectory scratch;
  ReplayServerConfig config;
  config.directory = (scratch.path() / "replay").string();
  config.max_ahead_steps = 0;
  config.window_bytes = kWindow;
  config.unwritten_bytes = config.max_message_bytes = kRoom;
  config.silence = 3600.0;
  metrics::Registry registry("replay", "replay");
  {
    transport::Context context;
    ReplayServer server(config,
                        {.endpoint = "tcp://127.0.0.1:*",
                         .table = {.capacity = 2000},
                         .shape = kBeams,
                         .chunk_bytes = kChunkBytes},
                        context, registry);
    const std::jthread serving([&](std::stop_token stop) { server.Run(stop); });
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&, i] {
        constexpr int kOfEach = kActors / kThreads;
        ActorsOfAThread(server.endpoint(), i * kOfEach, kOfEach, kChunks).Run();
      });
    }
  }
  const Recovered recovered =
      RecoverJournal({.directory = config.directory, .shape = kBeams}, {.capacity = 2000});
  EXPECT_EQ(recovered.sessions.accepted_steps(),
            std::int64_t{kActors} * kChunks * (kChunkRows - 1));
}

}  // namespace
}  // namespace slalom::replay
