#include "train/trainer.h"

#include <gmock/gmock.h>

#include <limits>

#include "base/error.h"
#include "base/file.h"
#include "config/config.h"
#include "tests/support/scratch_directory.h"
#include "tests/train/small_run.h"

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

TEST(TrainerTest, ARunResumedAfterAKillEndsBitIdentical) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.checkpoint_steps = 1000;
  config.run.keep_checkpoints = "all";
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

TEST(TrainerTest, AStoppedRunIsSavedAndGoesOn) {
  const test::ScratchDirectory scratch;
  const RunConfig config = SmallRun();
  const run::RunDirectory directory{scratch.path() / "run"};
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_EQ(RunOnce(config, directory, false, stopped.get_token()), TrainingEnd::kStopped);
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kFinished);
}

TEST(TrainerTest, ThreadsOverlapAndTheRatioHolds) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.deterministic = false;
  config.run.simulation_threads = 2;
  config.run.checkpoint_steps = 2000;
  const run::RunDirectory directory{scratch.path() / "run"};
  Trainer trainer(config, directory, "test", false);
  EXPECT_EQ(trainer.Run({}), TrainingEnd::kFinished);
  // The actor may end up to its queue, the chunk in hand and the one free ahead of the learner.
  const double ahead = 8.0 * (config.run.queue_length + 3);
  const double earned = config.run.updates_per_step *
                        static_cast<double>(trainer.steps() - config.run.learning_starts);
  EXPECT_LE(static_cast<double>(trainer.updates()), earned);
  EXPECT_GE(static_cast<double>(trainer.updates()),
            earned - 1.0 - config.run.updates_per_step * ahead);
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

TEST(TrainerTest, AConstraintNeedsCollisionsThatEndEpisodes) {
  RunConfig config = SmallRun();
  config.method.constraint.kind = "lagrangian";
  EXPECT_NO_THROW(RequireCombination(config));
  config.environment.episode.collision_ends = false;
  EXPECT_THROW(RequireCombination(config), base::Error);
}

TEST(TrainerTest, AChangedDigitInTheStateIsNoticed) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.max_steps = 1000;
  const run::RunDirectory directory{scratch.path() / "run"};
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  const fs::path state = run::CheckpointStore(directory.checkpoints()).List()[0] / "state.json";
  std::string text = base::ReadFile(state);
  const auto digit = text.find("\"steps\": 1");
  ASSERT_NE(digit, std::string::npos);
  text[digit + 9] = '2';
  base::WriteFileAtomically(state, text);
  EXPECT_THAT([&] { RunOnce(config, directory, true); },
              testing::ThrowsMessage<base::Error>(testing::HasSubstr("state.json")));
}

/// What resuming a run says whose own config.toml was edited after its checkpoints were written.
std::string RefusalAfterAnEdit(void (*edit)(RunConfig&)) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  RunConfig config = SmallRun();
  config.run.max_steps = 1000;
  config.method.constraint.kind = "lagrangian";
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
  config.run.keep_checkpoints = "all";
  const run::RunDirectory directory{scratch.path() / "run"};
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  const std::vector<float> weights = *Policy(directory).weights;
  for (const char* name : {"state.json", "actor.bin", "learner.safetensors", "replay.manifest"}) {
    const auto checkpoints = run::CheckpointStore(directory.checkpoints()).List();
    ASSERT_EQ(checkpoints.size(), 2u) << name;
    const fs::path damaged = checkpoints[0] / name;
    fs::resize_file(damaged, fs::file_size(damaged) / 2);
    EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kFinished) << name;
    EXPECT_EQ(*Policy(directory).weights, weights) << name;
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
