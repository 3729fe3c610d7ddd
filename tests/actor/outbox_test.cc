#include "actor/service/outbox.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "tests/support/scratch_directory.h"

namespace slalom::actor {
namespace {

transport::Frame Payload(int size, char fill) {
  return transport::Frame::Copy(
      std::string_view(std::string(static_cast<std::size_t>(size), fill)));
}

void Add(Outbox& outbox, int steps, int bytes) {
  proto::Insert header;
  header.num_rows = header.num_steps = steps;
  header.num_beams = 1;
  outbox.Add(header, Payload(bytes, 'x'));
}

/// A server that takes chunks in order and forgets, now and then, how far it was. Against it: every
/// chunk arrives once and in order, whatever is lost on the way.
TEST(OutboxTest, EveryChunkArrivesInOrderThroughLossAndReconnection) {
  base::Random random(3);
  Outbox outbox(4000);
  outbox.Begin(9);
  std::uint64_t server_next = 0;                 // What the server expects.
  std::uint64_t acknowledged = 0;                // What the actor was told.
  std::vector<std::int64_t> added_before = {0};  // Steps, by sequence number.
  for (int i = 0; i < 20000; ++i) {
    switch (random.UniformInt(4)) {
      case 0:
        if (!outbox.full()) {
          const int steps = 1 + static_cast<int>(random.UniformInt(20));
          Add(outbox, steps, 10 * steps);
          added_before.push_back(added_before.back() + steps);
        }
        break;
      case 1:
        if (const OutgoingChunk* chunk = outbox.NextToSend(1000)) {
          EXPECT_EQ(chunk->header.session, 9u);
          const bool arrives = random.UniformInt(10) != 0;
          if (arrives && chunk->header.sequence == server_next) ++server_next;
          if (arrives) EXPECT_LE(chunk->header.sequence, server_next);
          outbox.MarkSent();
          if (!arrives) ASSERT_TRUE(outbox.Resume(acknowledged));
        }
        break;
      case 2:
        acknowledged = server_next;
        outbox.Acknowledge(acknowledged);
        break;
      case 3:  // A new connection: the server says what it expects.
        acknowledged = server_next;
        outbox.Acknowledge(acknowledged);
        ASSERT_TRUE(outbox.Resume(acknowledged));
        break;
    }
    ASSERT_EQ(outbox.steps(), added_before.back() - added_before[acknowledged]);
    ASSERT_LT(outbox.bytes(), 4000 + 200);
  }
  EXPECT_GT(server_next, 1000u);
  EXPECT_GT(outbox.resent(), 0);
}

TEST(OutboxTest, WhatTheServerHasAlreadyFillsTheWindowAfterAReconnection) {
  Outbox outbox(1 << 20);
  outbox.Begin(1);
  for (int i = 0; i < 4; ++i) Add(outbox, 1, 100);
  ASSERT_TRUE(outbox.Resume(2));
  EXPECT_EQ(outbox.NextToSend(250), nullptr) << "200 bytes are on the server, unacknowledged";
  ASSERT_NE(outbox.NextToSend(300), nullptr);
  EXPECT_EQ(outbox.NextToSend(300)->header.sequence, 2u);
}

TEST(OutboxTest, TheWindowHoldsBackAllButOneChunk) {
  Outbox outbox(1 << 20);
  outbox.Begin(1);
  for (int i = 0; i < 5; ++i) Add(outbox, 1, 100);
  int sent = 0;
  while (outbox.NextToSend(250) != nullptr) {
    outbox.MarkSent();
    ++sent;
  }
  EXPECT_EQ(sent, 2);
  outbox.Acknowledge(1);
  ASSERT_NE(outbox.NextToSend(250), nullptr);
  EXPECT_EQ(outbox.NextToSend(250)->header.sequence, 2u);
  outbox.Acknowledge(2);
  // Alone, even what is larger than the window may go, but nothing without a window.
  EXPECT_NE(outbox.NextToSend(10), nullptr);
  EXPECT_EQ(outbox.NextToSend(0), nullptr);
}

TEST(OutboxTest, ANewSessionBeginsWithNothing) {
  Outbox outbox(1 << 20);
  outbox.Begin(1);
  for (int i = 0; i < 3; ++i) {
    Add(outbox, 1, 100);
    outbox.MarkSent();
  }
  outbox.Begin(2);
  EXPECT_TRUE(outbox.empty());
  EXPECT_EQ(outbox.steps(), 0);
  EXPECT_EQ(outbox.bytes(), 0);
  for (int i = 0; i < 2; ++i) Add(outbox, 1, 100);
  for (std::uint64_t sequence = 0; sequence < 2; ++sequence) {
    const OutgoingChunk* const chunk = outbox.NextToSend(200);
    ASSERT_NE(chunk, nullptr);
    EXPECT_EQ(chunk->header.session, 2u);
    EXPECT_EQ(chunk->header.sequence, sequence);
    outbox.MarkSent();
  }
  EXPECT_EQ(outbox.resent(), 0);
}

TEST(OutboxTest, AServerThatKnowsOtherChunksIsNoticed) {
  Outbox outbox(1 << 20);
  outbox.Begin(1);
  for (int i = 0; i < 4; ++i) Add(outbox, 1, 10);
  EXPECT_EQ(outbox.Acknowledge(2), 2);
  EXPECT_EQ(outbox.Acknowledge(1), 0);
  EXPECT_FALSE(outbox.Resume(1));
  EXPECT_FALSE(outbox.Resume(5));
  EXPECT_TRUE(outbox.Resume(2));
  EXPECT_TRUE(outbox.Resume(4));
}

class SpoolTest : public testing::Test {
 protected:
  SpoolTest() {
    Outbox outbox(1 << 20);
    outbox.Begin(5);
    for (int i = 0; i < 3; ++i) Add(outbox, i + 1, 8 * (i + 1));
    outbox.Acknowledge(1);
    outbox.SaveSpool(path_, 7);
  }

  const test::ScratchDirectory scratch_;
  const std::filesystem::path path_ = scratch_.path() / "spool";
};

TEST_F(SpoolTest, GoesOnWhereItWasLeft) {
  Outbox outbox(1 << 20);
  EXPECT_EQ(outbox.LoadSpool(path_), 7);
  EXPECT_EQ(outbox.session(), 5u);
  EXPECT_EQ(outbox.steps(), 2 + 3);
  EXPECT_EQ(outbox.bytes(), 16 + 24);
  EXPECT_FALSE(outbox.Resume(0));
  ASSERT_TRUE(outbox.Resume(2));
  const OutgoingChunk* chunk = outbox.NextToSend(1000);
  ASSERT_NE(chunk, nullptr);
  EXPECT_EQ(chunk->header.sequence, 2u);
  EXPECT_EQ(chunk->header.num_steps, 3);
  EXPECT_TRUE(std::ranges::equal(chunk->payload.bytes(), Payload(24, 'x').bytes()));
  Add(outbox, 1, 1);
  outbox.MarkSent();
  EXPECT_EQ(outbox.NextToSend(1000)->header.sequence, 3u);
}

TEST_F(SpoolTest, IsRemovedWhenThereIsNothingToKeep) {
  Outbox outbox(1 << 20);
  outbox.Begin(6);
  outbox.SaveSpool(path_, 7);
  EXPECT_FALSE(std::filesystem::exists(path_));
  EXPECT_EQ(outbox.LoadSpool(path_), std::nullopt);
}

TEST_F(SpoolTest, DamageAtAnyByteIsRefusedByName) {
  const std::string bytes = base::ReadFile(path_);
  const auto refused = [&](const std::string& damaged) {
    std::ofstream(path_, std::ios::binary) << damaged;
    Outbox outbox(1 << 20);
    try {
      outbox.LoadSpool(path_);
    } catch (const base::Error& error) {
      return std::string(error.what()).find(path_.string()) != std::string::npos;
    }
    return false;
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x20);
    ASSERT_TRUE(refused(damaged)) << "byte " << i << " changed";
    ASSERT_TRUE(refused(bytes.substr(0, i))) << "cut at " << i;
  }
}

}  // namespace
}  // namespace slalom::actor
