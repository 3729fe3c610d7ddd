#include "replay/service/insert_desk.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>

#include "tests/replay/service/fake_log.h"
#include "tests/replay/service/model_actor.h"
#include "tests/replay/service/rows_source.h"

namespace slalom::replay {
namespace {

using proto::RefusalCode;
using transport::PeerId;

constexpr int kBeams = 1;
constexpr std::int64_t kWindow = 1 << 17;
constexpr std::int64_t kRoom = 1 << 18;

/// The server's side, which can be killed.
struct Server {
  Server(FakeLog* fake_log, FakeNetwork* network, std::int64_t ahead, std::int64_t room = kRoom)
      : log(fake_log), limiter({.updates_per_step = 0.5, .max_ahead_steps = ahead}, 0) {
    Sessions sessions;
    log->Replay(&table, &sessions);
    limiter.AddSteps(sessions.accepted_steps());
    desk = std::make_unique<InsertDesk>(
        InsertDesk::Options{
            .flow = {.window_bytes = kWindow, .room_bytes = room, .chunk_bytes = 64},
            .server = 1,
            .software = "test"},
        std::move(sessions), &table, &limiter, log, network);
  }

  FakeLog* log;
  Table table{{.capacity = 2000}, kBeams};
  RateLimiter limiter;
  std::unique_ptr<InsertDesk> desk;
};

class InsertDeskModel : public testing::TestWithParam<std::uint64_t> {};

// Random kills of either side, cut connections, resent, duplicate and early chunks, a log that lags
// and a limiter that holds: every step is accounted for, once.
TEST_P(InsertDeskModel, EveryStepIsAcceptedOnceOrLostAndKnownToBe) {
  base::Random random(GetParam());
  FakeLog log;
  FakeNetwork network;
  // Every other run the limiter holds most chunks. Every third has room for a few chunks only.
  const std::int64_t ahead = GetParam() % 2 == 0 ? 0 : 40;
  const std::int64_t room = GetParam() % 3 == 0 ? 1000 : kRoom;
  auto server = std::make_unique<Server>(&log, &network, ahead, room);
  InsertDesk::Time now{};
  std::vector<ModelActor> actors;
  for (int i = 0; i < 4; ++i) actors.emplace_back(fmt::format("actor-{}", i), 1 + i, 100 + i);
  for (ModelActor& actor : actors) actor.Connect(&network);
  std::uint64_t cursor = 0;
  int kills = 0;
  for (int i = 0; i < 6000; ++i) {
    now += std::chrono::milliseconds(random.UniformInt(50));
    ModelActor& actor = actors[random.UniformInt(actors.size())];
    const double what = random.Uniform();
    if (what < 0.25) {
      actor.Make();
    } else if (what < 0.55) {
      actor.Send(server->desk.get(), now, random);
    } else if (what < 0.80) {
      actor.Receive(&network, log);
    } else if (what < 0.88) {
      log.Write(random.UniformInt(4));
    } else if (what < 0.96) {
      if (random.Uniform() < 0.5) {
        server->limiter.Ask("learner", cursor);
        if (server->limiter.MaySample("learner")) cursor += 5;
        server->limiter.Ask("learner", cursor);
      }
      server->desk->Advance(now, 3);
    } else if (what < 0.97) {
      actor.Connect(&network);
    } else if (what < 0.98) {
      actor.Goodbye(server->desk.get(), now);
    } else if (what < 0.993) {
      actor.Restart(&network);
      ++kills;
    } else {
      log.Crash(random.UniformInt(5));
      server = std::make_unique<Server>(&log, &network, ahead, room);
      for (ModelActor& other : actors) other.Connect(&network);
      ++kills;
    }
    ASSERT_LE(server->desk->unwritten_bytes(), 2 * room);
    if (testing::Test::HasFatalFailure()) FAIL() << "event " << i;
  }
  EXPECT_GT(kills, 60);

  // In the end all that is pending goes through.
  for (int i = 0; i < 2000; ++i) {
    now += std::chrono::milliseconds(50);
    for (ModelActor& actor : actors) {
      actor.Send(server->desk.get(), now, random);
      actor.Receive(&network, log);
    }
    cursor += 100;
    server->limiter.Ask("learner", cursor);
    log.WriteAll();
    server->desk->Advance(now, 100);
  }
  std::int64_t accepted = 0;
  for (ModelActor& actor : actors) {
    EXPECT_TRUE(actor.idle());
    EXPECT_TRUE(actor.settled());
    EXPECT_EQ(actor.total_made(), actor.accepted() + actor.lost());
    EXPECT_GT(actor.lost(), 0);
    const Session* const session = server->desk->sessions().FindName(actor.name());
    ASSERT_NE(session, nullptr);
    EXPECT_EQ(session->accepted_steps + session->earlier_steps, actor.accepted());
    accepted += actor.accepted();
  }
  EXPECT_EQ(server->desk->sessions().accepted_steps(), accepted);
  EXPECT_EQ(server->desk->unwritten_bytes(), 0);
  EXPECT_EQ(server->desk->num_held(), 0);
  // The log holds each session's chunks from 0 on, without gap and without duplicate.
  std::map<std::pair<std::string, std::uint64_t>, std::uint64_t> next;
  for (const auto& [name, session, sequence] : log.Chunks()) {
    EXPECT_EQ(sequence, (next[{name, session}]++));
  }
  int early = 0;
  for (ModelActor& actor : actors) early += actor.refusals(RefusalCode::kOutOfOrder);
  EXPECT_GT(early, 5);
  EXPECT_GT(server->desk->counts().chunks_accepted, 0);
}

INSTANTIATE_TEST_SUITE_P(Seeds, InsertDeskModel, testing::Range<std::uint64_t>(1, 13));

/// A desk with one actor at hand.
class InsertDeskTest : public testing::Test {
 protected:
  explicit InsertDeskTest(std::int64_t ahead = 0) : server_(&log_, &network_, ahead) {}

  PeerId Greet(const std::string& name, std::uint64_t session, int streams = 2) {
    const PeerId peer = network_.Connect();
    server_.desk->Hello(peer,
                        {.role = "actor",
                         .name = name,
                         .session = session,
                         .num_beams = kBeams,
                         .num_streams = streams,
                         .software = ""},
                        now_);
    return peer;
  }
  void Insert(const PeerId& peer, std::uint64_t session, std::uint64_t sequence,
              const Chunk& chunk) {
    server_.desk->Insert(peer,
                         {.session = session,
                          .sequence = sequence,
                          .num_rows = chunk.num_rows(),
                          .num_beams = kBeams,
                          .num_steps = RowsSource::NumSteps(chunk)},
                         RowsSource::Bytes(chunk), now_);
  }
  std::vector<proto::Header> TakeAll(const PeerId& peer) {
    std::vector<proto::Header> all;
    while (const auto header = network_.Take(peer)) all.push_back(*header);
    return all;
  }
  template <class T>
  T Only(const PeerId& peer) {
    const auto all = TakeAll(peer);
    EXPECT_EQ(all.size(), 1u);
    const T* const found = all.empty() ? nullptr : std::get_if<T>(&all[0]);
    EXPECT_NE(found, nullptr);
    return found == nullptr ? T{} : *found;
  }

  FakeLog log_;
  FakeNetwork network_;
  Server server_;
  InsertDesk::Time now_{};
  RowsSource source_{kBeams, 2, 1};
};

TEST_F(InsertDeskTest, WelcomeAndAcknowledgementWaitForTheLog) {
  const PeerId peer = Greet("a", 1);
  server_.desk->Advance(now_, 10);
  EXPECT_TRUE(TakeAll(peer).empty());
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  EXPECT_EQ(Only<proto::Welcome>(peer).next_sequence, 0u);
  Insert(peer, 1, 0, source_.Next());
  Insert(peer, 1, 1, source_.Next());
  server_.desk->Advance(now_, 10);
  EXPECT_TRUE(TakeAll(peer).empty());
  log_.Write(1);
  server_.desk->Advance(now_, 10);
  EXPECT_EQ(Only<proto::InsertAck>(peer).next_sequence, 1u);
  // A hello of the same session tells what is safe, not what has come.
  const PeerId again = Greet("a", 1);
  EXPECT_EQ(Only<proto::Welcome>(again).next_sequence, 1u);
}

/// The limiter holds all but the first chunks.
class HeldInsertDeskTest : public InsertDeskTest {
 protected:
  HeldInsertDeskTest() : InsertDeskTest(2) {}
};

TEST_F(HeldInsertDeskTest, AGoodbyeLosesNothingThatIsHeld) {
  const PeerId peer = Greet("a", 1);
  for (std::uint64_t k = 0; k < 4; ++k) Insert(peer, 1, k, source_.Next());
  ASSERT_GT(server_.desk->num_held(), 0);
  server_.desk->Goodbye(peer, {.session = 1}, now_);
  EXPECT_EQ(server_.desk->num_held(), 0);
  EXPECT_EQ(server_.desk->counts().chunks_accepted, 4);
  EXPECT_TRUE(server_.desk->sessions().FindName("a")->ended);
}

TEST_F(InsertDeskTest, WhoeverIsSilentHasNoShareOfTheWindow) {
  const PeerId peer = Greet("a", 1);
  Greet("b", 1);
  for (const int present : {2, 1, 0}) {
    EXPECT_EQ(server_.desk->num_present(now_), present);
    now_ += std::chrono::minutes(1);
    if (present == 2) server_.desk->Heard(peer, now_);
  }
}

TEST_F(InsertDeskTest, AChunkThatBreaksItsEpisodesIsRefusedAsAWhole) {
  const PeerId peer = Greet("a", 1);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  Only<proto::Welcome>(peer);
  Chunk bad(kBeams);
  const std::vector<std::uint16_t> ranges(kBeams, 1);
  const std::vector<float> state(env::kStateSize, 0.0f);
  bad.AddStep(0, true, {ranges, state}, {}, {});
  bad.AddStep(1, false, {ranges, state}, {}, {});
  Insert(peer, 1, 0, bad);
  EXPECT_EQ(Only<proto::Refusal>(peer).code, RefusalCode::kBadMessage);
  EXPECT_EQ(server_.table.total_inserted(), 0);
  EXPECT_EQ(server_.desk->unwritten_bytes(), 0);
  Insert(peer, 1, 0, RowsSource(kBeams, 2, 4).Next());
  EXPECT_GT(server_.table.total_inserted(), 0);
}

// However much the sessions before left in it.
TEST_F(InsertDeskTest, NothingBeyondTheWindowIsKept) {
  constexpr std::uint64_t kLast = 4;
  PeerId peer;
  for (std::uint64_t session = 1; session <= kLast; ++session) {
    peer = Greet("a", session);
    log_.WriteAll();
    server_.desk->Advance(now_, 10);
    EXPECT_EQ(Only<proto::Welcome>(peer).window_bytes, kWindow);
    source_.Reset();
    if (session < kLast) Insert(peer, session, 0, source_.Next(50));
  }
  const std::int64_t window = kWindow;
  std::int64_t sent = 0;
  std::uint64_t sequence = 0;
  for (std::vector<proto::Header> answers; answers.empty(); answers = TakeAll(peer)) {
    const Chunk chunk = source_.Next(50);
    const auto size = static_cast<std::int64_t>(RowBytes::Size(chunk.num_rows(), kBeams));
    Insert(peer, kLast, sequence++, chunk);
    if (sent + size > window) {
      EXPECT_EQ(Only<proto::Refusal>(peer).code, RefusalCode::kOverWindow);
      break;
    }
    sent += size;
  }
  EXPECT_EQ(server_.desk->unwritten_bytes(), sent);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  EXPECT_EQ(server_.desk->unwritten_bytes(), 0);
  EXPECT_EQ(Only<proto::InsertAck>(peer).next_sequence, sequence - 1);
}

// An actor that hears nothing for long would say hello and send again what is held.
TEST_F(InsertDeskTest, ASessionThatWaitsIsToldItsWindow) {
  const PeerId peer = Greet("a", 1);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  Only<proto::Welcome>(peer);
  const auto acks_within = [&](int seconds) {
    int acks = 0;
    for (int i = 0; i < 10 * seconds; ++i) {
      now_ += std::chrono::milliseconds(100);
      server_.desk->Advance(now_, 10);
      for (const proto::Header& header : TakeAll(peer)) {
        const auto* const ack = std::get_if<proto::InsertAck>(&header);
        EXPECT_NE(ack, nullptr);
        if (ack != nullptr) EXPECT_EQ(ack->next_sequence, 0u);
        ++acks;
      }
    }
    return acks;
  };
  EXPECT_EQ(acks_within(10), 0);  // It may send and has nothing to wait for.
  Insert(peer, 1, 0, source_.Next());
  const int num_acks = acks_within(10);
  EXPECT_GE(num_acks, 3);
  EXPECT_LE(num_acks, 5) << "every two seconds";
}

TEST_F(InsertDeskTest, FiguresAreOfTheNewestChunksAndEachTimeIsToldOnce) {
  const PeerId peer = Greet("a", 1);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  for (std::uint64_t k = 0; k < 100; ++k) {
    const Chunk chunk = source_.Next(2);
    server_.desk->Insert(peer,
                         {.session = 1,
                          .sequence = k,
                          .num_rows = chunk.num_rows(),
                          .num_beams = kBeams,
                          .num_steps = RowsSource::NumSteps(chunk),
                          .oldest_version = static_cast<std::int64_t>(k),
                          .newest_version = static_cast<std::int64_t>(k) + 1},
                         RowsSource::Bytes(chunk), now_);
    log_.WriteAll();
    server_.desk->Advance(now_, 10);
    TakeAll(peer);
  }
  EXPECT_EQ(server_.desk->counts().chunks_accepted, 100);
  EXPECT_DOUBLE_EQ(server_.desk->acting_version(), 68.0) << "of the last 64: 36.5 to 99.5";
  EXPECT_EQ(server_.desk->TakeInsertSeconds().size(), 100u);
  EXPECT_TRUE(server_.desk->TakeInsertSeconds().empty());
}

// A refusal that finds no room in the peer's queue is sent later, or its actor would wait for ever.
TEST_F(InsertDeskTest, ARefusalThatCannotBeSentIsSentLater) {
  const PeerId peer = Greet("a", 1);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  Only<proto::Welcome>(peer);
  for (int i = 0; i < 100; ++i) Insert(peer, 1, 7, source_.Next());
  EXPECT_LT(TakeAll(peer).size(), 100u);
  for (const int num_refusals : {1, 0}) {  // Once.
    now_ += std::chrono::seconds(1);
    server_.desk->Advance(now_, 10);
    const auto answers = TakeAll(peer);
    ASSERT_EQ(answers.size(), static_cast<std::size_t>(num_refusals));
    if (num_refusals > 0) {
      EXPECT_EQ(std::get<proto::Refusal>(answers[0]).code, RefusalCode::kOutOfOrder);
    }
  }
}

TEST_F(InsertDeskTest, NamesComeAndGoWithinBounds) {
  for (int i = 0; i < Sessions::kMaxNames + 100; ++i) {
    now_ += std::chrono::seconds(1);
    const PeerId peer = Greet(fmt::format("actor-{}", i), 1);
    log_.WriteAll();
    server_.desk->Advance(now_, 10);
    Only<proto::Welcome>(peer);
    Insert(peer, 1, 0, RowsSource(kBeams, 2, 4).Next());
    log_.WriteAll();
    server_.desk->Advance(now_, 10);
    network_.Cut(peer);
    server_.desk->Gone(peer);
  }
  const Sessions& sessions = server_.desk->sessions();
  EXPECT_EQ(sessions.all().size(), static_cast<std::size_t>(Sessions::kMaxNames));
  EXPECT_EQ(sessions.FindName("actor-99"), nullptr);
  EXPECT_NE(sessions.FindName("actor-100"), nullptr);
  EXPECT_EQ(sessions.accepted_steps(), 2 * (Sessions::kMaxNames + 100));
  // Streams are used again.
  EXPECT_LE(server_.table.num_streams(), 2 * Sessions::kMaxNames);
}

// What protobuf makes of a field that is left out.
TEST_F(InsertDeskTest, AHelloWithoutSessionOrStreamsIsRefused) {
  const PeerId nowhere = Greet("a", 0);
  EXPECT_EQ(Only<proto::Refusal>(nowhere).code, RefusalCode::kBadMessage);
  const PeerId nothing = Greet("a", 7, 0);
  const auto refusal = Only<proto::Refusal>(nothing);
  EXPECT_EQ(refusal.code, RefusalCode::kBadMessage);
  EXPECT_THAT(refusal.text, testing::HasSubstr("streams"));
  EXPECT_EQ(refusal.about, 7u);
  EXPECT_TRUE(server_.desk->sessions().all().empty());
  // Nor in the place of one that has some.
  const PeerId sound = Greet("a", 7);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  Only<proto::Welcome>(sound);
  const PeerId again = Greet("a", 8, 0);
  EXPECT_EQ(Only<proto::Refusal>(again).code, RefusalCode::kBadMessage);
  Insert(sound, 7, 0, source_.Next());
  EXPECT_GT(server_.table.total_inserted(), 0);
}

// Sessions only rise, so such a number would lock its name for ever.
TEST_F(InsertDeskTest, ASessionThatNoActorReachesIsRefused) {
  const std::uint64_t jump = std::uint64_t{1} << 32;
  for (const std::uint64_t session : {~std::uint64_t{0}, std::uint64_t{1} << 63, jump + 1}) {
    const auto refusal = Only<proto::Refusal>(Greet("a", session));
    EXPECT_EQ(refusal.code, RefusalCode::kBadMessage);
    EXPECT_EQ(refusal.about, session);
  }
  for (const std::uint64_t session : {jump, 2 * jump, 2 * jump + 1}) {
    const PeerId peer = Greet("a", session);
    log_.WriteAll();
    server_.desk->Advance(now_, 10);
    EXPECT_EQ(Only<proto::Welcome>(peer).session, session);
  }
}

// Each is a record that stays in the journal.
TEST_F(InsertDeskTest, SessionsOfANameAreBoundedPerMinute) {
  std::uint64_t session = 1;
  for (; session <= 1000; ++session) {
    const PeerId peer = Greet("a", session);
    log_.WriteAll();
    server_.desk->Advance(now_, 10);
    const auto all = TakeAll(peer);
    ASSERT_EQ(all.size(), 1u);
    if (const auto* refusal = std::get_if<proto::Refusal>(&all[0])) {
      EXPECT_EQ(refusal->code, RefusalCode::kNotReady);
      EXPECT_THAT(refusal->text, testing::HasSubstr("sessions of a"));
      break;
    }
  }
  EXPECT_GT(session, 10u);
  EXPECT_LT(session, 100u);
  const std::uint64_t appended = log_.appended();
  for (int i = 0; i < 100; ++i) Greet("a", ++session);
  EXPECT_EQ(log_.appended(), appended);
  // Others are served, and after a minute this one is, too.
  const PeerId other = Greet("b", 1);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  Only<proto::Welcome>(other);
  now_ += std::chrono::minutes(1);
  const PeerId again = Greet("a", ++session);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  Only<proto::Welcome>(again);
  // And bounded again.
  const std::uint64_t in_second = log_.appended();
  for (int i = 0; i < 1000; ++i) Greet("a", ++session);
  EXPECT_LT(log_.appended(), in_second + 100);
}

TEST_F(InsertDeskTest, ALowerSessionAndAForeignOneAreRefused) {
  const PeerId first = Greet("a", 5);
  const PeerId old = Greet("a", 4);
  const auto replaced = Only<proto::Refusal>(old);
  EXPECT_EQ(replaced.code, RefusalCode::kReplaced);
  EXPECT_EQ(replaced.about, 5u);
  log_.WriteAll();
  server_.desk->Advance(now_, 10);
  Only<proto::Welcome>(first);
  Insert(first, 4, 0, source_.Next());
  EXPECT_EQ(Only<proto::Refusal>(first).code, RefusalCode::kNoSession);
  const PeerId nobody = network_.Connect();
  Insert(nobody, 5, 0, source_.Next());
  EXPECT_EQ(Only<proto::Refusal>(nobody).code, RefusalCode::kNoSession);
  EXPECT_EQ(server_.table.total_inserted(), 0);
}

}  // namespace
}  // namespace slalom::replay
