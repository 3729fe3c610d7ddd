#include "actor/actor.h"

#include <gtest/gtest.h>

#include <array>
#include <thread>
#include <utility>

#include "base/error.h"
#include "tests/support/fake_environment.h"

namespace slalom::actor {
namespace {

using testing::ConstantAgent;
using testing::FakeEnvironment;
using testing::SummingAgent;

constexpr int kBatch = 6;
const std::vector<double> kSuccess{0.1, 0.5, 0.9};

/// An actor with all that it stands on.
struct Fixture {
  explicit Fixture(const ActorConfig& config, std::uint64_t seed = 5, int batch_size = kBatch,
                   const SamplingConfig& sampling = {})
      : environments(batch_size, kSuccess),
        agent(batch_size),
        actor(config, environments, agent, seed, sampling) {}

  FakeEnvironment environments;
  SummingAgent agent;
  Actor actor;
};

void ExpectEqualChunks(const replay::Chunk& a, const replay::Chunk& b) {
  EXPECT_EQ(a.stream, b.stream);
  EXPECT_EQ(a.flags, b.flags);
  EXPECT_EQ(a.ranges_cm, b.ranges_cm);
  EXPECT_EQ(a.state, b.state);
  EXPECT_TRUE(std::ranges::equal(a.action, b.action));
  EXPECT_EQ(a.reward, b.reward);
  EXPECT_EQ(a.cost, b.cost);
}

TEST(Actor, WritesTheEpisodesThatAPlainLoopSees) {
  Fixture fixture({});
  replay::Chunk chunk(8);
  for (int step = 0; step < 200; ++step) fixture.actor.Step(&chunk);

  // Drive each stream's rows again, one environment alone, episode after episode.
  for (int i = 0; i < kBatch; ++i) {
    FakeEnvironment environment(1, kSuccess);
    std::vector<env::StepResult> result(1);
    bool ended = true;
    for (int r = 0; r < chunk.num_rows(); ++r) {
      const replay::RowView row = chunk.row(r);
      if (row.stream != i) continue;
      if (ended) {
        EXPECT_TRUE(row.flags & replay::kRowFirst);
        // The specs in order: the first kBatch belong to the environments in order; later ones are
        // found by their first frame.
        bool found = false;
        for (const env::EpisodeSpec& spec : fixture.environments.specs()) {
          environment.Reset(0, spec);
          if (std::ranges::equal(environment.observations().ranges_cm, row.frame.ranges_cm)) {
            found = true;
            break;
          }
        }
        ASSERT_TRUE(found);
      } else if (!(row.flags & replay::kRowFinal)) {
        EXPECT_FALSE(row.flags & replay::kRowFirst);
      }
      EXPECT_TRUE(std::ranges::equal(environment.observations().ranges_cm, row.frame.ranges_cm));
      EXPECT_TRUE(std::ranges::equal(environment.observations().state, row.frame.state));
      if (row.flags & replay::kRowFinal) {
        EXPECT_TRUE(result[0].ended());
        ended = true;
        result[0] = {};
        continue;
      }
      EXPECT_FALSE(result[0].ended()) << "a final row is missing";
      ended = false;
      environment.Step(row.action, result);
      EXPECT_EQ(row.reward, result[0].reward);
      EXPECT_EQ(row.cost, result[0].cost);
      EXPECT_EQ((row.flags & replay::kRowTerminated) != 0, result[0].terminated());
    }
  }
  const ActorStats stats = fixture.actor.stats();
  EXPECT_EQ(stats.num_steps, 200 * kBatch);
  EXPECT_EQ(chunk.num_rows(), 200 * kBatch + stats.num_episodes);
}

/// The draws of an actor of this seed, made again from the episodes that end.
class DrawsAgain {
 public:
  DrawsAgain(const SamplingConfig& sampling, std::uint64_t seed)
      : seed_(seed), sampler_(sampling, static_cast<int>(kSuccess.size()), false, 0) {
    for (int i = 0; i < kBatch; ++i) Begin(i);
  }

  /// Ends the episode of environment i. Returns whether its course was drawn as a learnable one.
  bool End(int i, bool is_success) {
    const CourseSampler::Draw draw = draws_[i];
    sampler_.Report(draw, is_success);
    Begin(i);
    return draw.is_learnable;
  }

 private:
  void Begin(int i) {
    base::Random random(base::DeriveSeed(seed_, "training episode",
                                         {static_cast<std::uint64_t>(i), num_episodes_[i]++}));
    draws_[i] = sampler_.Next(random);
  }

  const std::uint64_t seed_;
  CourseSampler sampler_;
  std::array<std::uint64_t, kBatch> num_episodes_{};
  std::array<CourseSampler::Draw, kBatch> draws_{};
};

TEST(Actor, AveragesTheLastEpisodes) {
  for (const Sampling kind : {Sampling::kUniform, Sampling::kLearnable}) {
    ActorConfig config;
    config.stats_episodes = 25;
    const SamplingConfig sampling{.sampling = kind};
    Fixture fixture(config, 5, kBatch, sampling);
    replay::Chunk chunk(8);
    for (int step = 0; step < 300; ++step) fixture.actor.Step(&chunk);

    // Those on courses that were drawn because they are hard do not count.
    DrawsAgain draws(sampling, 5);
    std::vector<EpisodeSummary> episodes;
    std::vector<EpisodeSummary> running(kBatch);
    std::int64_t num_learnable = 0;
    std::array<std::int64_t, env::kNumOutcomes> num_outcomes{};
    for (int r = 0; r < chunk.num_rows(); ++r) {
      const replay::RowView row = chunk.row(r);
      EpisodeSummary& episode = running[row.stream];
      if (row.flags & replay::kRowFinal) {
        const EpisodeSummary ended = std::exchange(episode, {});
        ++num_outcomes[static_cast<int>(ended.outcome)];
        if (draws.End(row.stream, ended.outcome == env::Outcome::kSuccess)) {
          ++num_learnable;
        } else {
          episodes.push_back(ended);
        }
        continue;
      }
      ++episode.num_steps;
      episode.episode_return += row.reward;
      episode.episode_cost += row.cost;
      episode.outcome = row.cost > 0.0f                        ? env::Outcome::kCollision
                        : (row.flags & replay::kRowTerminated) ? env::Outcome::kSuccess
                                                               : env::Outcome::kTimeout;
    }
    ASSERT_GT(episodes.size(), 35u);
    if (kind == Sampling::kLearnable) ASSERT_GT(num_learnable, 20);
    const ActorStats stats = fixture.actor.stats();
    EXPECT_EQ(stats.num_episodes, static_cast<std::int64_t>(episodes.size()) + num_learnable);
    EXPECT_EQ(stats.num_recent, 25);
    EXPECT_EQ(stats.num_outcomes, num_outcomes);
    ActorStats expected;
    for (auto it = episodes.end() - 25; it != episodes.end(); ++it) {
      expected.success_rate += it->outcome == env::Outcome::kSuccess ? 0.04 : 0.0;
      expected.collision_rate += it->outcome == env::Outcome::kCollision ? 0.04 : 0.0;
      expected.timeout_rate += it->outcome == env::Outcome::kTimeout ? 0.04 : 0.0;
      expected.mean_return += 0.04 * static_cast<double>(it->episode_return);
      expected.mean_cost += 0.04 * static_cast<double>(it->episode_cost);
      expected.mean_length += 0.04 * it->num_steps;
    }
    EXPECT_NEAR(stats.success_rate, expected.success_rate, 1e-12);
    EXPECT_NEAR(stats.collision_rate, expected.collision_rate, 1e-12);
    EXPECT_NEAR(stats.timeout_rate, expected.timeout_rate, 1e-12);
    EXPECT_NEAR(stats.mean_return, expected.mean_return, 1e-12);
    EXPECT_NEAR(stats.mean_cost, expected.mean_cost, 1e-12);
    EXPECT_EQ(stats.mean_cost, stats.collision_rate) << "a collision costs 1";
    EXPECT_NEAR(stats.mean_length, expected.mean_length, 1e-12);
  }
}

/// Environments in which every step costs something, whatever ends the episode.
class CostlyEnvironment : public FakeEnvironment {
 public:
  using FakeEnvironment::FakeEnvironment;
  void Step(std::span<const float> actions, std::span<env::StepResult> results) override {
    FakeEnvironment::Step(actions, results);
    for (env::StepResult& result : results) result.cost = 0.5f;
  }
};

TEST(Actor, TheCostOfAnEpisodeIsTheSumOfItsStepsOverARestartToo) {
  CostlyEnvironment environments(kBatch, kSuccess), others(kBatch, kSuccess);
  SummingAgent agent(kBatch), other_agent(kBatch);
  Actor actor({}, environments, agent, 5), restored({}, others, other_agent, 5);
  replay::Chunk chunk(8);
  for (int step = 0; step < 100; ++step) actor.Step(&chunk);
  restored.Restore(actor.Save());
  for (int step = 0; step < 100; ++step) restored.Step(&chunk);
  const ActorStats stats = restored.stats();
  EXPECT_GT(stats.num_episodes, 3 * kBatch);
  EXPECT_EQ(stats.num_recent, stats.num_episodes);
  EXPECT_NEAR(stats.mean_cost, 0.5 * stats.mean_length, 1e-12);
}

TEST(Actor, RestoredGoesOnBitForBit) {
  ActorConfig config;
  config.warmup_steps = 30;  // The first save falls into the warm-up.
  config.stats_episodes = 10;
  for (const int steps_before : {0, 3, 50, 137}) {
    Fixture whole(config);
    replay::Chunk ignored(8);
    for (int step = 0; step < steps_before; ++step) whole.actor.Step(&ignored);
    const std::string bytes = whole.actor.Save().Serialize();

    Fixture restored(config);
    for (int step = 0; step < 7; ++step) restored.actor.Step(&ignored);  // Whatever went before.
    restored.actor.Restore(ActorState::Parse(bytes, "state"));
    EXPECT_EQ(restored.actor.Save().Serialize(), bytes);

    replay::Chunk expected(8);
    replay::Chunk found(8);
    for (int step = 0; step < 100; ++step) {
      whole.actor.Step(&expected);
      restored.actor.Step(&found);
    }
    ExpectEqualChunks(found, expected);
    EXPECT_EQ(restored.actor.Save().Serialize(), whole.actor.Save().Serialize());
    EXPECT_EQ(restored.actor.stats().mean_return, whole.actor.stats().mean_return);
  }
}

TEST(Actor, RefusesAStateThatDoesNotFit) {
  Fixture saved({});
  replay::Chunk chunk(8);
  for (int step = 0; step < 20; ++step) saved.actor.Step(&chunk);
  const ActorState state = saved.actor.Save();

  EXPECT_THROW(Fixture({}, 6).actor.Restore(state), base::Error);
  EXPECT_THROW(Fixture({}, 5, kBatch + 1).actor.Restore(state), base::Error);

  FakeEnvironment fewer_courses(kBatch, {0.5});
  SummingAgent agent(kBatch);
  EXPECT_THROW(Actor({}, fewer_courses, agent, 5).Restore(state), base::Error);

  ActorState altered = state;
  for (OpenEpisode& open : altered.open) {
    for (float& number : open.actions) number += 0.01f;
  }
  EXPECT_THROW(Fixture({}).actor.Restore(altered), base::Error);
}

TEST(Actor, DrawsOneEnvironmentWithoutRegardToTheOthers) {
  // Environment 0 of a batch of 1 and of a batch of 6 with the same noise lives the same life.
  Fixture alone({}, 5, 1);
  Fixture among({});
  replay::Chunk a(8);
  replay::Chunk b(8);
  for (int step = 0; step < 100; ++step) {
    alone.actor.Step(&a);
    among.actor.Step(&b);
  }
  int r = 0;
  for (int s = 0; s < b.num_rows(); ++s) {
    if (b.stream[s] != 0) continue;
    ASSERT_LT(r, a.num_rows());
    EXPECT_TRUE(std::ranges::equal(a.row(r).action, b.row(s).action));
    EXPECT_EQ(a.flags[r], b.flags[s]);
    ++r;
  }
  EXPECT_EQ(r, a.num_rows());
}

/// Pearson's statistic of counts against equal shares.
double ChiSquare(const std::vector<int>& counts) {
  double total = 0.0;
  for (const int count : counts) total += count;
  const double expected = total / static_cast<double>(counts.size());
  double sum = 0.0;
  for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

// Chi-square with 19 degrees of freedom exceeds 19 + 2 sqrt(19 x) + 2 x with a probability below
// exp(-x) (Laurent and Massart 2000); here x = 12.7, so 3e-6.
constexpr int kNumCourses = 20;
constexpr double kChiSquareBound = 19.0 + 31.1 + 25.4;

TEST(Actor, DrawsCoursesUniformly) {
  FakeEnvironment environments(kBatch, std::vector<double>(kNumCourses, 0.5), 3);
  SummingAgent agent(kBatch);
  Actor actor({}, environments, agent, 99);
  replay::Chunk chunk(8);
  for (int step = 0; step < 10000; ++step) {
    chunk.Clear();
    actor.Step(&chunk);
  }
  std::vector<int> counts(kNumCourses);
  for (const env::EpisodeSpec& spec : environments.specs()) ++counts[spec.course];
  ASSERT_GT(environments.specs().size(), 20000u);
  EXPECT_LT(ChiSquare(counts), kChiSquareBound);
}

TEST(ChiSquare, FindsAPlantedBias) {
  // The same test on a sampler that draws course 0 in 13 of 213 cases, the others in 10.
  base::Random random(3);
  std::vector<int> counts(kNumCourses);
  for (int k = 0; k < 30000; ++k) {
    const auto drawn = random.UniformInt(10 * kNumCourses + 3);
    ++counts[drawn < 10 * kNumCourses ? drawn % kNumCourses : 0];
  }
  EXPECT_GT(ChiSquare(counts), kChiSquareBound);
}

TEST(Actor, RefusesActionsThatAreNotFinite) {
  FakeEnvironment environments(kBatch, kSuccess);
  ConstantAgent agent({std::nanf(""), 0.0f});
  Actor actor({}, environments, agent, 1);
  const std::string before = actor.Save().Serialize();
  replay::Chunk chunk(8);
  EXPECT_THROW(actor.Step(&chunk), base::Error);
  EXPECT_EQ(chunk.num_rows(), 0);
  EXPECT_EQ(actor.Save().Serialize(), before);
}

TEST(Actor, StoresTimeLimitsAsTerminalOnlyWhereAskedTo) {
  const auto count = [](bool terminates) {
    ActorConfig config;
    config.time_limit_terminates = terminates;
    Fixture fixture(config);
    replay::Chunk chunk(8);
    for (int step = 0; step < 400; ++step) fixture.actor.Step(&chunk);
    int episodes = 0, terminated = 0;
    for (const std::uint8_t flags : chunk.flags) {
      episodes += (flags & replay::kRowFinal) != 0;
      terminated += (flags & replay::kRowTerminated) != 0;
    }
    EXPECT_GT(fixture.actor.stats().num_outcomes[static_cast<int>(env::Outcome::kTimeout)], 0);
    return std::pair(episodes, terminated);
  };
  const auto [episodes, terminated] = count(false);
  EXPECT_LT(terminated, episodes);
  EXPECT_EQ(count(true), std::pair(episodes, episodes));
}

TEST(Actor, StatsMayBeReadByAnotherThread) {
  Fixture fixture({});
  std::jthread reader([&](std::stop_token stop) {
    std::int64_t last = 0;
    while (!stop.stop_requested()) {
      const ActorStats stats = fixture.actor.stats();
      EXPECT_GE(stats.num_steps, last);
      EXPECT_LE(stats.success_rate + stats.collision_rate + stats.timeout_rate, 1.0 + 1e-9);
      last = stats.num_steps;
    }
  });
  replay::Chunk chunk(8);
  for (int step = 0; step < 500; ++step) {
    chunk.Clear();
    fixture.actor.Step(&chunk);
  }
}

}  // namespace
}  // namespace slalom::actor
