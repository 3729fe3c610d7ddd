#include "app/train/trainer.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <limits>
#include <set>
#include <stop_token>
#include <string>

#include "app/train/inputs.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "learner/run/metrics_table.h"
#include "metrics/catalogue.h"
#include "tests/app/train/small_run.h"
#include "tests/support/scratch_directory.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

TEST(TrainerTest, TheSameSeedGivesTheSamePolicyAndAnotherSeedAnother) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  const run::RunDirectory a{scratch.path() / "a"};
  const run::RunDirectory b{scratch.path() / "b"};
  const run::RunDirectory c{scratch.path() / "c"};
  EXPECT_EQ(RunOnce(config, a), TrainingEnd::kFinished);
  EXPECT_EQ(RunOnce(config, b), TrainingEnd::kFinished);
  EXPECT_EQ(*Policy(a).weights, *Policy(b).weights);
  config.run.seed = 2;
  EXPECT_EQ(RunOnce(config, c), TrainingEnd::kFinished);
  EXPECT_NE(*Policy(a).weights, *Policy(c).weights);
}

/// Trains in parts, killed between them, and as a whole; expects the same policy.
void ExpectAKillChangesNothing(RunConfig config) {
  const test::ScratchDirectory scratch;
  config.run.checkpoint_steps = 1000;
  config.run.keep_checkpoints = run::KeepCheckpoints::kAll;
  const run::RunDirectory whole{scratch.path() / "whole"};
  EXPECT_EQ(RunOnce(config, whole), TrainingEnd::kFinished);

  // What a kill leaves: the checkpoints of a run that went on past them. The replay ring wraps
  // before the first of these, and each resume is from the older of two as well as from the newer.
  const run::RunDirectory killed{scratch.path() / "killed"};
  for (const std::int64_t at : {2500, 4500}) {
    RunConfig part = config;
    part.run.max_steps = at;
    EXPECT_EQ(RunOnce(part, killed, /*resume=*/at != 2500), TrainingEnd::kFinished);
    const auto checkpoints = run::CheckpointStore(killed.checkpoints()).List();
    ASSERT_EQ(checkpoints.size(), 2u);
    fs::remove_all(checkpoints[0]);  // The one that only the end of the part wrote.
  }
  EXPECT_EQ(RunOnce(config, killed, /*resume=*/true), TrainingEnd::kFinished);
  EXPECT_EQ(*Policy(whole).weights, *Policy(killed).weights);
}

TEST(TrainerTest, ARunResumedAfterAKillEndsBitIdentical) { ExpectAKillChangesNothing(SmallRun()); }

TEST(TrainerTest, ARunOnLearnableCoursesResumedAfterAKillEndsBitIdentical) {
  RunConfig config = SmallRun();
  config.courses.fresh = "static+crowds";
  config.courses.sampling.sampling = actor::Sampling::kLearnable;
  ExpectAKillChangesNothing(config);
  config.courses.train = "";
  ExpectAKillChangesNothing(config);
}

TEST(TrainerTest, AConstrainedRunWithDrawnFieldsResumedAfterAKillEndsBitIdentical) {
  RunConfig config = SmallRun();
  config.method.constraint = {.kind = learner::ConstraintKind::kLagrangian, .learning_rate = 0.1};
  config.environment.randomize = {{"lidar.offset_x", {"[-0.1, 0.1]", ""}},
                                  {"robot.command_delay", {"[0.0, 0.12]", ""}},
                                  {"robot.friction", {"['cone', 'gazebo']", ""}}};
  ExpectAKillChangesNothing(config);
}

TEST(TrainerTest, ADistilledRunResumedAfterAKillEndsBitIdentical) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory teacher{scratch.path() / "teacher"};
  RunConfig config = SmallRun();
  EXPECT_EQ(RunOnce(config, teacher), TrainingEnd::kFinished);
  config.courses.train = "";
  config.courses.fresh = "static";
  config.method.learner.algorithm = "distillation";
  config.distillation.teachers = {{"static", {"'" + teacher.policy().string() + "'", ""}}};
  ExpectAKillChangesNothing(config);
}

TEST(TrainerTest, APrioritizedRunResumedAfterAKillEndsBitIdentical) {
  RunConfig config = SmallRun();
  config.method.learner.prioritized = true;
  ExpectAKillChangesNothing(config);
}

TEST(TrainerTest, PrioritiesAreThoseOfTheCheckpointAfterAResume) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.method.learner.prioritized = true;
  config.run.max_steps = 2500;
  const run::RunDirectory directory{scratch.path() / "run"};
  const auto newest = [&] {
    return run::CheckpointStore(directory.checkpoints()).List().at(0) / "priorities";
  };
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  const std::string before = base::ReadFile(newest());
  config.run.max_steps = 5000;
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_EQ(RunOnce(config, directory, true, stopped.get_token()), TrainingEnd::kStopped);
  EXPECT_EQ(base::ReadFile(newest()), before);
  base::WriteFileAtomically(newest(), before.substr(0, before.size() / 2));
  EXPECT_THAT([&] { RunOnce(config, directory, true); },
              testing::ThrowsMessage<base::Error>(testing::HasSubstr("priorities: damaged")));
}

TEST(TrainerTest, ARunStartsFromAPolicyOfWhichItKeepsACopy) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory first{scratch.path() / "first"}, begun{scratch.path() / "begun"};
  RunConfig config = SmallRun();
  config.run.max_steps = 2000;
  ASSERT_EQ(RunOnce(config, first), TrainingEnd::kFinished);
  config.run.seed = 2;
  config.method.learner.from = first.policy();
  config.method.learner.algorithm = "ddpg";
  std::stop_source stopped;
  stopped.request_stop();
  ASSERT_EQ(RunOnce(config, begun, false, stopped.get_token()), TrainingEnd::kStopped);
  EXPECT_EQ(*Policy(begun).weights, *Policy(first).weights);

  // As a kill before the first checkpoint leaves it.
  fs::remove_all(begun.checkpoints());
  fs::remove(begun.policy());
  // The same run in the place of the one that it starts from, which is moved aside.
  ASSERT_EQ(RunOnce(config, first), TrainingEnd::kFinished);
  EXPECT_EQ(base::ReadFile(FindPolicy(first.inputs(), first.policy())),
            base::ReadFile(scratch.path() / "first.1/policy.safetensors"));
  config.courses.inputs = begun.inputs();
  ASSERT_EQ(RunOnce(config, begun, true), TrainingEnd::kFinished);
  EXPECT_EQ(*Policy(begun).weights, *Policy(first).weights);

  config.method.learner.from = begun.policy();
  config.run.max_steps = 3000;
  try {
    RunOnce(config, begun, true);
    ADD_FAILURE() << "it went on from another policy";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("learner.from was"));
  }
}

TEST(TrainerTest, ThreadsOverlapAndTheRatioHolds) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.deterministic = false;
  config.run.simulation_threads = 2;
  config.run.checkpoint_steps = 2000;
  const run::RunDirectory directory{scratch.path() / "run"};
  metrics::Registry registry("train", "test");
  Trainer trainer(ResolveForTraining(config), directory, "test", false, registry);
  EXPECT_EQ(trainer.Run({}), TrainingEnd::kFinished);
  // The actor may end up to its queue, the chunk in hand and the one free ahead of the learner.
  const double ahead = 8.0 * (config.run.queue_length + 3);
  const double earned = config.run.updates_per_step *
                        static_cast<double>(trainer.steps() - config.run.learning_starts);
  EXPECT_LE(static_cast<double>(trainer.updates()), earned);
  EXPECT_GE(static_cast<double>(trainer.updates()),
            earned - 1.0 - config.run.updates_per_step * ahead);
}

// Whoever scrapes a training sees what metrics.csv says, and no metric that the catalogue does not
// list for it.
TEST(TrainerTest, ShowsItsMetrics) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.method.model.kind = nn::ModelKind::kDeterministic;
  config.method.model.encoder_layers = {};
  config.method.model.head_layers = {16};
  config.run.checkpoint_steps = 2000;
  const run::RunDirectory directory{scratch.path() / "run"};
  metrics::Registry registry("train", "test");
  Trainer trainer(ResolveForTraining(config), directory, "test", false, registry);
  EXPECT_EQ(trainer.Run({}), TrainingEnd::kFinished);
  const auto log = run::ParseMetrics(base::ReadFile(directory.metrics()), 0);
  EXPECT_EQ(registry.counter(metrics::kEnvironmentSteps).value(), log.Last("steps"));
  EXPECT_EQ(registry.counter(metrics::kUpdates).value(), log.Last("updates"));
  EXPECT_EQ(registry.counter(metrics::kBatches).value(), 2.0 * log.Last("updates"));
  EXPECT_EQ(registry.counter(metrics::kCheckpoints).value(), 3.0);
  EXPECT_EQ(registry.gauge(metrics::kCheckpointUpdates).value(), log.Last("updates"));
  EXPECT_EQ(registry.gauge(metrics::kTableRows).value(), 2000.0);
  EXPECT_NEAR(registry.gauge(metrics::kSuccessRate).value(), log.Last("success_rate"), 1e-6);
  EXPECT_GT(log.Last("model_steps_error"), 0.0);
  EXPECT_THAT(registry.Text(), testing::HasSubstr("slalom_model_steps_error"));
  EXPECT_EQ(registry.gauge(metrics::kRunFinished).value(), 1.0);
  const std::string text = registry.Text();
  for (const metrics::CatalogueSection& section : metrics::Catalogue()) {
    for (const metrics::Spec* spec : section.specs) {
      const bool listed = spec->roles == "all" || spec->roles.ends_with("train");
      const bool shown = text.find(fmt::format("# TYPE {} ", spec->name)) != std::string::npos;
      EXPECT_EQ(shown, listed) << spec->name;
    }
  }
}

TEST(TrainerTest, DivergingTrainingStopsAndKeepsTheLastGoodCheckpoint) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  const run::RunDirectory directory{scratch.path() / "run"};
  config.run.checkpoint_steps = 1000;
  config.run.learning_starts = 1500;
  config.run.log_interval = 0.0;
  config.method.learner.critic_learning_rate = 1.0;
  config.method.learner.actor_learning_rate = 1.0;
  config.method.learner.divergence_limit = 1.0;
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kDiverged);
  EXPECT_FALSE(fs::exists(directory.policy()));
  const auto checkpoints = run::CheckpointStore(directory.checkpoints()).List();
  ASSERT_EQ(checkpoints.size(), 1u);
  EXPECT_EQ(checkpoints[0].filename(), "step-1000");
}

TEST(TrainerTest, ANetworkThatDivergesBetweenTwoLooksIsFoundOut) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.log_interval = 3600.0;
  config.method.learner.actor_learning_rate = std::numeric_limits<double>::infinity();
  EXPECT_EQ(RunOnce(config, {scratch.path() / "run"}), TrainingEnd::kDiverged);
}

TEST(TrainerTest, ADeterministicRunMustNotEndByTheClock) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.max_seconds = 1.0;
  EXPECT_THROW(RunOnce(config, {scratch.path() / "run"}), base::Error);
}

TEST(TrainerTest, AConstraintsLimitIsLessThanAnEpisodeMayCost) {
  RunConfig config = SmallRun();
  config.method.constraint.kind = learner::ConstraintKind::kLagrangian;
  EXPECT_NO_THROW((void)Resolve(config));
  config.method.constraint.limit = 1.0;
  EXPECT_THROW((void)Resolve(config), base::Error);
  RunConfig goes_on = config, own = config;
  goes_on.environment.episode.collision_ends = false;
  EXPECT_NO_THROW((void)Resolve(goes_on));
  own.task = {.observation_size = 3, .action_low = {-1.0}, .action_high = {1.0}};
  own.network.sectors = 0;
  own.method.learner.mirror = false;
  EXPECT_NO_THROW((void)Resolve(own));
}

/// What resuming a run says whose own config.toml was edited after its checkpoints were written.
std::string RefusalAfterAnEdit(void (*edit)(RunConfig&)) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  RunConfig config = SmallRun();
  config.run.max_steps = 1000;
  config.method.constraint.kind = learner::ConstraintKind::kLagrangian;
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  edit(config);
  base::WriteFileAtomically(directory.config(), config::ToToml(config));
  try {
    RunOnce(config, directory, /*resume=*/true);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

TEST(TrainerTest, ACheckpointOfAnotherConfigIsRefused) {
  using testing::AllOf;
  using testing::HasSubstr;
  EXPECT_EQ(RefusalAfterAnEdit([](RunConfig& config) { config.run.max_steps = 1200; }), "");
  EXPECT_THAT(
      RefusalAfterAnEdit([](RunConfig& config) { config.network.sectors = 36; }),
      AllOf(HasSubstr("acting.safetensors"), HasSubstr("network.sectors is 72, expected 36")));
  EXPECT_THAT(RefusalAfterAnEdit([](RunConfig& config) { config.network.history = 4; }),
              HasSubstr("network.history is 1, expected 4"));
  EXPECT_THAT(RefusalAfterAnEdit(
                  [](RunConfig& config) { config.environment.observation.range_clip = 6.0; }),
              HasSubstr("observation.range_clip is 5.0, expected 6.0"));
  EXPECT_THAT(
      RefusalAfterAnEdit([](RunConfig& config) { config.method.learner.algorithm = "sac"; }),
      HasSubstr("distribution.kind is \"deterministic\", expected \"gaussian\""));
  EXPECT_THAT(
      RefusalAfterAnEdit([](RunConfig& config) { config.method.constraint = {}; }),
      AllOf(
          HasSubstr("acting.safetensors"),
          HasSubstr("constraint.kind was \"lagrangian\" when the run began and is \"none\" now")));
}

TEST(TrainerTest, AFinishedRunWithoutCheckpointsIsNotOverwritten) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  RunConfig config = SmallRun();
  config.run.max_steps = 1000;
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  const std::string policy = base::ReadFile(directory.policy());
  fs::remove_all(directory.checkpoints());
  EXPECT_THROW(RunOnce(config, directory, /*resume=*/true), base::Error);
  EXPECT_EQ(base::ReadFile(directory.policy()), policy);
}

TEST(TrainerTest, ADamagedCheckpointIsPassedOverForTheOneBefore) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.checkpoint_steps = 2000;
  config.run.keep_checkpoints = run::KeepCheckpoints::kAll;
  const run::RunDirectory directory{scratch.path() / "run"};
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  const std::vector<float> weights = *Policy(directory).weights;
  std::set<std::string> names;
  for (const auto& file :
       fs::directory_iterator(run::CheckpointStore(directory.checkpoints()).List()[0])) {
    names.insert(file.path().filename().string());
  }
  EXPECT_GE(names.size(), 5u);
  for (const std::string& name : names) {
    const auto checkpoints = run::CheckpointStore(directory.checkpoints()).List();
    ASSERT_EQ(checkpoints.size(), 2u) << name;
    const fs::path damaged = checkpoints[0] / name;
    fs::resize_file(damaged, fs::file_size(damaged) / 2);
    EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kFinished) << name;
    EXPECT_EQ(*Policy(directory).weights, weights) << name;
    EXPECT_TRUE(fs::exists(checkpoints[0].string() + ".damaged")) << name;
    fs::remove_all(checkpoints[0].string() + ".damaged");
  }
  // One that is passed over must not stand in the way of those written after it.
  fs::remove(run::CheckpointStore(directory.checkpoints()).List()[0] / "replay.manifest");
  RunConfig shorter = config;
  shorter.run.max_steps = 5000;
  EXPECT_EQ(RunOnce(shorter, directory, true), TrainingEnd::kFinished);
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kFinished);
  // None left that is whole.
  for (const auto& checkpoint : run::CheckpointStore(directory.checkpoints()).List()) {
    fs::resize_file(checkpoint / "learner.safetensors", 10);
  }
  EXPECT_THAT([&] { RunOnce(config, directory, true); },
              testing::ThrowsMessage<base::Error>(testing::HasSubstr("learner.safetensors")));
}

}  // namespace
}  // namespace slalom::train
