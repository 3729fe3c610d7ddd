#include "actor/actor_state.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/file.h"

namespace slalom::actor {
namespace {

ActorState MakeState() {
  ActorState state;
  state.seed = 0xFEDCBA9876543210ull;
  state.num_steps = 123456789012;
  state.num_episodes = 4711;
  state.recent = {{env::Outcome::kSuccess, 30, 29.5f, 0.0f},
                  {env::Outcome::kCollision, 400, -0.25f, 1.0f}};
  state.open = {{7, {3, 99}, true, {1, 2, 3, 4}, 1.5f, 0.0f, 55, {0.5f, -0.5f, 1.0f, 0.25f}},
                {8, {0, 100}, false, {5, 6, 7, 8}, -7.5f, 0.0f, 56, {}}};
  state.sampler = {.num_fresh_draws = 12,
                   .named = {{0, 0.5f, 1.0f}},
                   .candidates = {{9, 1.0f, 0.0f}, {10, 0.0f, 0.0f}},
                   .learnable = {{8, 1.0f, 3.0f}},
                   .recent = {{7, 4.0f, 0.0f}, {8, 1.0f, 3.0f}}};
  return state;
}

std::string ErrorOf(std::string_view bytes) {
  try {
    (void)ActorState::Parse(bytes, "actor.bin");
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

TEST(ActorState, ReadsBackWhatItWrote) {
  ActorState state = MakeState();
  state.recent[0].episode_cost = 2.5f;
  state.open[1].episode_cost = 0.75f;
  const ActorState read = ActorState::Parse(state.Serialize(), "actor.bin");
  EXPECT_EQ(read.seed, state.seed);
  EXPECT_EQ(read.num_steps, state.num_steps);
  EXPECT_EQ(read.num_episodes, state.num_episodes);
  EXPECT_EQ(read.recent, state.recent);
  ASSERT_EQ(read.open.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read.open[i].number, state.open[i].number);
    EXPECT_EQ(read.open[i].spec.course, state.open[i].spec.course);
    EXPECT_EQ(read.open[i].spec.seed, state.open[i].spec.seed);
    EXPECT_EQ(read.open[i].is_learnable, state.open[i].is_learnable);
    EXPECT_EQ(read.open[i].noise, state.open[i].noise);
    EXPECT_EQ(read.open[i].episode_return, state.open[i].episode_return);
    EXPECT_EQ(read.open[i].episode_cost, state.open[i].episode_cost);
    EXPECT_EQ(read.open[i].frame_checksum, state.open[i].frame_checksum);
    EXPECT_EQ(read.open[i].actions, state.open[i].actions);
  }
  EXPECT_EQ(read.sampler.num_fresh_draws, state.sampler.num_fresh_draws);
  EXPECT_EQ(read.sampler.named, state.sampler.named);
  EXPECT_EQ(read.sampler.candidates, state.sampler.candidates);
  EXPECT_EQ(read.sampler.learnable, state.sampler.learnable);
  EXPECT_EQ(read.sampler.recent, state.sampler.recent);
  EXPECT_EQ(read.Serialize(), state.Serialize());
}

TEST(ActorState, RefusesEveryCutAndEveryFlippedBit) {
  const std::string bytes = MakeState().Serialize();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THAT(ErrorOf(std::string_view(bytes).substr(0, size)),
                ::testing::StartsWith("actor.bin: "))
        << size;
  }
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    EXPECT_NE(ErrorOf(damaged), "") << bit;
  }
}

TEST(ActorState, RefusesSoundBytesOfNoState) {
  ActorState state = MakeState();
  state.recent[0].outcome = env::Outcome::kRunning;
  EXPECT_THAT(ErrorOf(state.Serialize()), ::testing::HasSubstr("outcome 0"));
  state.recent[0].outcome = static_cast<env::Outcome>(9);
  EXPECT_THAT(ErrorOf(state.Serialize()), ::testing::HasSubstr("outcome 9"));
}

}  // namespace
}  // namespace slalom::actor
