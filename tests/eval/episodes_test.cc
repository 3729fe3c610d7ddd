#include "eval/episodes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "sim/environments.h"
#include "sim/randomized_config.h"
#include "tests/support/fake_environment.h"

namespace slalom::eval {
namespace {

sim::CourseSet MakeCourses(int n, const std::string& prefix = "course-") {
  sim::CourseSet set{"made", {}};
  for (int c = 0; c < n; ++c) {
    auto course = std::make_shared<sim::Course>();
    course->name = prefix + std::to_string(c);
    course->goal_W = {10.0, 0.0};
    course->reference_path_W = {{2.0, 0.0}, {6.0, 0.0}};
    set.courses.push_back(std::move(course));
  }
  return set;
}

EvaluationConfig MakeConfig() {
  EvaluationConfig config;
  config.episodes_per_course = 6;
  config.recorded_episodes_per_course = 2;
  config.recorded_scan_courses = 2;
  config.recorded_beams = 4;
  config.seed = 42;
  return config;
}

EvaluationTask Task(const EvaluationConfig& config, int num_courses) {
  return ResolveEvaluation(config, {}, MakeCourses(num_courses));
}

Episodes RunFake(int batch_size, const EvaluationConfig& config) {
  testing::FakeEnvironment environments(batch_size, {0.1, 0.5, 0.9});
  testing::SummingAgent agent(batch_size);
  return RunEpisodes(Task(config, 3), environments, agent).value();
}

TEST(RunEpisodes, DoesNotDependOnTheBatchSize) {
  const Episodes one = RunFake(1, MakeConfig());
  ASSERT_EQ(one.records.size(), 18u);
  for (const int batch_size : {2, 5, 18, 40}) {
    const Episodes other = RunFake(batch_size, MakeConfig());
    EXPECT_EQ(other.records, one.records) << batch_size;
    EXPECT_EQ(other.tracks, one.tracks);
  }
}

TEST(RunEpisodes, RecordsWhatAPlainLoopSees) {
  const EvaluationConfig config = MakeConfig();
  const Episodes episodes = RunFake(5, config);
  const sim::CourseSet courses = MakeCourses(3);
  testing::FakeEnvironment environment(1, {0.1, 0.5, 0.9});
  int num_compared = 0;
  for (int k = 0; k < 18; ++k) {
    EpisodeRecord expected;
    expected.course = k / 6;
    expected.episode = k % 6;
    expected.seed = EvaluationSeed(42, *courses.courses[expected.course], expected.episode);
    testing::SummingAgent agent(1);
    std::vector<env::Action> action(1);
    std::vector<env::StepResult> result(1);
    sim::EpisodeTrack track{courses.courses[expected.course]->name};
    std::vector<base::Pose2>& X_WR = track.poses;
    // Of the 8 beams of the fake every second is kept.
    if (expected.course != 2) {
      track.beams = sim::TrackBeams{{0.12, 0.0}, -0.5 * 4.71238, 4.71238 / 7 * 2};
    }
    const auto look = [&] {
      X_WR.push_back(environment.robot_pose(0));
      const auto& ranges_cm = environment.observations().ranges_cm;
      if (track.beams) {
        track.scans_cm.push_back({ranges_cm[0], ranges_cm[2], ranges_cm[4], ranges_cm[6]});
      }
      for (const std::uint16_t range : environment.observations().ranges_cm) {
        expected.min_range = std::min(expected.min_range, 0.01 * range);
      }
    };
    environment.Reset(0, {expected.course, expected.seed});
    expected.min_range = 100.0;
    track.episode = expected.episode;
    track.step = 0.2;
    track.motion_start = static_cast<double>(expected.seed % 1000);
    look();
    while (!result[0].ended()) {
      agent.Act(environment.observations(), env::NumbersOf(action));
      if (agent.Intervened(0)) {
        ++expected.num_interventions;
        track.interventions.push_back(static_cast<int>(X_WR.size()) - 1);
      }
      environment.Step(env::NumbersOf(action), result);
      look();
      ++expected.num_steps;
      expected.episode_return += static_cast<double>(result[0].reward);
      expected.path_length += base::Norm(X_WR.back().p - X_WR[X_WR.size() - 2].p);
    }
    expected.agent_status = agent.Status(0);
    expected.outcome = result[0].outcome;
    track.outcome = result[0].outcome;
    expected.num_collisions = result[0].outcome == env::Outcome::kCollision ? 1 : 0;
    EXPECT_EQ(episodes.records[k], expected) << k;
    for (const sim::EpisodeTrack& kept : episodes.tracks) {
      if (kept.course != track.course || kept.episode != track.episode) continue;
      ++num_compared;
      if (!kept.beams) {
        track.beams.reset();
        track.scans_cm.clear();
      }
      EXPECT_EQ(kept, track);
    }
  }
  EXPECT_EQ(num_compared, 6);
}

TEST(RunEpisodes, EachTellsWhatWasDrawnForIt) {
  sim::EnvironmentConfig environment;
  environment.observation.speeds = true;
  environment.randomize = {{"localisation.speed_noise", {"[0.0, 0.5]", ""}}};
  const EvaluationTask task = ResolveEvaluation(MakeConfig(), environment, MakeCourses(2));
  testing::FakeEnvironment environments(5, {0.5, 0.5});
  testing::SummingAgent agent(5);
  sim::RandomizedConfig drawn(task.environment);
  const auto episodes = RunEpisodes(task, environments, agent).value();
  for (const EpisodeRecord& record : episodes.records) {
    drawn.Draw(record.seed);
    EXPECT_TRUE(std::ranges::equal(record.drawn, drawn.values())) << record.seed;
  }
}

/// The episodes of course `c` whose tracks are kept, and that with scans, or -1.
std::pair<std::vector<int>, int> KeptOf(const Episodes& episodes, int c) {
  std::pair<std::vector<int>, int> kept{{}, -1};
  for (const sim::EpisodeTrack& track : episodes.tracks) {
    if (track.course != "course-" + std::to_string(c)) continue;
    kept.first.push_back(track.episode);
    if (track.beams) kept.second = track.episode;
  }
  return kept;
}

TEST(RunEpisodes, KeepsTheTracksOfFailuresFirst) {
  EvaluationConfig config = MakeConfig();
  config.episodes_per_course = 20;
  config.recorded_scan_courses = 5;
  const std::vector<double> success_probability = {0.0, 0.5, 0.9, 0.97, 1.0};
  bool is_late_failure_seen = false;
  for (const int num_kept : {0, 1, 3, 40}) {
    config.recorded_episodes_per_course = num_kept;
    testing::FakeEnvironment environments(7, success_probability);
    testing::SummingAgent agent(7);
    const Episodes episodes = RunEpisodes(Task(config, 5), environments, agent).value();
    for (int c = 0; c < 5; ++c) {
      // Failures in order, then successes in order: the first of them, in the order of episodes.
      std::vector<int> expected;
      for (const bool wants_success : {false, true}) {
        for (int e = 0; e < 20; ++e) {
          const bool success = episodes.records[c * 20 + e].outcome == env::Outcome::kSuccess;
          if (success == wants_success) expected.push_back(e);
        }
      }
      const int best = expected.front();
      is_late_failure_seen = is_late_failure_seen || best > 0;
      expected.resize(std::min<std::size_t>(expected.size(), num_kept));
      std::ranges::sort(expected);
      const auto [kept, with_scans] = KeptOf(episodes, c);
      EXPECT_EQ(kept, expected) << "course " << c << ", " << num_kept << " kept";
      EXPECT_EQ(with_scans, num_kept == 0 ? -1 : best);
    }
  }
  EXPECT_TRUE(is_late_failure_seen);
}

TEST(RunEpisodes, ReportsProgressUpToTheEnd) {
  testing::FakeEnvironment environments(4, {0.1, 0.1});
  testing::SummingAgent agent(4);
  int last = 0;
  EpisodeCount count;
  const auto progress = [&](const EpisodeCount& now) {
    EXPECT_GE(now.ended, last);
    EXPECT_EQ(now.all, 12);
    last = now.ended;
    count = now;
  };
  const auto episodes = RunEpisodes(Task(MakeConfig(), 2), environments, agent, progress).value();
  EXPECT_EQ(last, 12);
  const auto num = [&](env::Outcome outcome) {
    return std::ranges::count(episodes.records, outcome, &EpisodeRecord::outcome);
  };
  EXPECT_EQ(count.successes, num(env::Outcome::kSuccess));
  EXPECT_EQ(count.collisions, num(env::Outcome::kCollision));
  EXPECT_GT(count.collisions, 0);
}

TEST(RunEpisodes, GivesNothingWhenStopped) {
  testing::FakeEnvironment environments(4, {0.5, 0.5});
  testing::SummingAgent agent(4);
  std::stop_source source;
  const auto progress = [&](const EpisodeCount& now) {
    if (now.ended >= 3) source.request_stop();
  };
  EXPECT_FALSE(RunEpisodes(Task(MakeConfig(), 2), environments, agent, progress, source.get_token())
                   .has_value());
  EXPECT_LT(environments.specs().size(), 12u);
}

TEST(RunEpisodes, RefusesActionsThatAreNotFinite) {
  testing::FakeEnvironment environments(2, {0.5});
  testing::ConstantAgent agent({0.0f, std::nanf("")});
  EXPECT_THROW((void)RunEpisodes(Task(MakeConfig(), 1), environments, agent), base::Error);
}

/// Drives environment 0 ahead; lets environment 1 stand for ten steps, and has no number for it
/// then.
class FadingAgent : public env::Agent {
 public:
  void Act(const env::ObservationBatch&, std::span<float> numbers) override {
    const auto actions = env::AsActions(numbers);
    actions[0] = {1.0f, 0.0f};
    actions[1] = env::ActionBounds{}.Standstill();
    if (num_steps_++ >= 10) actions[1].linear = std::nanf("");
  }

 private:
  int num_steps_ = 0;
};

// The clock of this protocol starts when the robot has moved, so the robot that stands is through
// first, and is simulated until the other one is.
TEST(RunEpisodes, RefusesThemAfterTheTimeLimitToo) {
  EvaluationConfig config;
  config.protocol = "barn-challenge";
  config.time_limit = 2.0;
  config.episodes_per_course = 2;
  const EvaluationTask task = Task(config, 1);
  sim::CourseEnvironments environments(task.environment, sim::MakeScenes(task.courses), 2, nullptr);
  FadingAgent agent;
  EXPECT_THROW((void)RunEpisodes(task, environments, agent), base::Error);
}

/// One course; the robot goes along x as the script says, which also holds contacts. Never ends by
/// itself.
class ScriptedEnvironment : public testing::FakeEnvironment {
 public:
  struct StepScript {
    double x = 0.0;
    bool contact = false;
  };
  explicit ScriptedEnvironment(std::vector<StepScript> script)
      : FakeEnvironment(1, {1.0}, 1), script_(std::move(script)) {}

  void Reset(int i, const env::EpisodeSpec& spec) override {
    FakeEnvironment::Reset(i, spec);
    num_steps_ = 0;
  }
  void Step(std::span<const float>, std::span<env::StepResult> results) override {
    ++num_steps_;
    results[0] = {0.0f, now().contact ? 1.0f : 0.0f, env::Outcome::kRunning};
  }
  base::Pose2 robot_pose(int) const override { return {{now().x, 0.0}, 0.0}; }

 private:
  StepScript now() const {
    return num_steps_ == 0 ? StepScript{} : script_[std::min(num_steps_, script_.size()) - 1];
  }
  const std::vector<StepScript> script_;
  std::size_t num_steps_ = 0;
};

EpisodeRecord RunScript(const std::string& protocol,
                        std::vector<ScriptedEnvironment::StepScript> script) {
  ScriptedEnvironment environment(std::move(script));
  testing::ConstantAgent agent({0.0f, 0.0f});
  EvaluationConfig config;
  config.protocol = protocol;
  config.episodes_per_course = 1;
  return RunEpisodes(Task(config, 1), environment, agent).value().records.front();
}

TEST(RunEpisodes, CountsEachContactOnce) {
  const EpisodeRecord record = RunScript("dwa-runs", {{0.0, true},
                                                      {0.0, true},
                                                      {0.0, false},
                                                      {0.0, true},
                                                      {0.0, false},
                                                      {0.0, true},
                                                      {0.0, true}});
  EXPECT_EQ(record.num_collisions, 3);
  EXPECT_EQ(record.outcome, env::Outcome::kTimeout);
  EXPECT_EQ(record.num_steps, 565);
}

TEST(RunEpisodes, StartsTheChallengesClockWhenTheRobotHasMoved) {
  const EpisodeRecord late = RunScript("barn-challenge", {{0.0}, {0.05}, {0.099}, {0.11}});
  EXPECT_EQ(late.clock_start_step, 4);
  EXPECT_EQ(late.num_steps, 504);
  EXPECT_NEAR(late.time(0.2), 100.0, 1e-9);
  const EpisodeRecord never = RunScript("barn-challenge", {{0.0}});
  EXPECT_EQ(never.num_steps, 500);
  EXPECT_EQ(never.outcome, env::Outcome::kTimeout);
  EXPECT_NEAR(never.time(0.2), 100.0, 1e-9);
  EXPECT_EQ(RunScript("paper", {{0.0}, {0.3}}).clock_start_step, 0);
}

TEST(RunEpisodes, KeepsScansOfCoursesSpreadOverTheSet) {
  testing::FakeEnvironment environments(3, std::vector(10, 0.5));
  testing::SummingAgent agent(3);
  EvaluationConfig config = MakeConfig();
  for (const auto& [kept, courses] :
       {std::pair{0, std::vector<int>{}}, {1, {0}}, {3, {0, 3, 6}}, {5, {0, 2, 4, 6, 8}}}) {
    config.recorded_scan_courses = kept;
    const Episodes episodes = RunEpisodes(Task(config, 10), environments, agent).value();
    std::vector<int> with_scans;
    for (std::size_t t = 0; t < episodes.tracks.size(); ++t) {
      const sim::EpisodeTrack& track = episodes.tracks[t];
      if (!track.beams) continue;
      with_scans.push_back(static_cast<int>(t / 2));
      EXPECT_EQ(track.scans_cm.size(), track.poses.size());
    }
    EXPECT_EQ(with_scans, courses);
  }
}

TEST(EvaluationSeed, IsTheSameForACourseInAnySet) {
  const sim::CourseSet all = MakeCourses(5);
  sim::Course copy = *all.courses[3];
  EXPECT_EQ(EvaluationSeed(1, copy, 7), EvaluationSeed(1, *all.courses[3], 7));
}

TEST(EvaluationSeed, DiffersByCourseEpisodeAndRoot) {
  std::set<std::uint64_t> seeds;
  const sim::CourseSet courses = MakeCourses(20);
  for (const std::int64_t root : {1, 2, 3}) {
    for (const auto& course : courses.courses) {
      for (int episode = 0; episode < 10; ++episode) {
        seeds.insert(EvaluationSeed(root, *course, episode));
      }
    }
  }
  EXPECT_EQ(seeds.size(), 600u);
}

}  // namespace
}  // namespace slalom::eval
