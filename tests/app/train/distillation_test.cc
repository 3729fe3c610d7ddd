#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "app/train/course_teachers.h"
#include "app/train/inputs.h"
#include "app/train/resolved_run.h"
#include "app/train/stage_trainer.h"
#include "app/train/training_overlap.h"
#include "base/config.h"
#include "base/error.h"
#include "policy/policy.h"
#include "sim/environments.h"
#include "tests/app/train/small_run.h"
#include "tests/support/scratch_directory.h"

namespace slalom::train {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// A student of two teachers, of which each always does one thing.
class DistillationTest : public testing::Test {
 protected:
  DistillationTest() {
    config_.courses.train = "";
    config_.courses.fresh = "static+wall+static";
    config_.method.learner.algorithm = "distillation";
    config_.distillation.teachers = {{"static", {Quoted(SaveTeacher("still", 0.5f)), ""}},
                                     {"wall", {Quoted(SaveTeacher("walls", -0.5f)), ""}}};
  }

  static std::string Quoted(const std::string& text) { return "\"" + text + "\""; }

  /// A policy that always chooses `action` for both numbers.
  std::string SaveTeacher(const std::string& name, float action, nn::Metadata metadata = {}) {
    policy::PolicySnapshot snapshot = policy::ZeroSnapshot(MakePolicySpec(config_));
    snapshot.version = 1;
    auto weights = std::make_shared<std::vector<float>>(*snapshot.weights);
    for (std::size_t i = weights->size() - 2; i < weights->size(); ++i) {
      (*weights)[i] = std::atanh(action);  // The last biases, before tanh.
    }
    snapshot.weights = weights;
    const std::string file = (directory_.path() / (name + ".safetensors")).string();
    policy::SavePolicy(file, snapshot, metadata);
    return file;
  }

  std::string Refusal() const {
    try {
      (void)MakeTeachers(Resolve(config_), directory_.path());
    } catch (const base::Error& error) {
      return error.what();
    }
    return "accepted";
  }

  test::ScratchDirectory directory_;
  RunConfig config_ = SmallRun();
};

TEST_F(DistillationTest, EachKindOfCourseHasItsTeacher) {
  EXPECT_EQ(Refusal(), "accepted");
  const auto teachers = MakeTeachers(ResolveRecorded(config_), directory_.path());
  const env::StepShape shape = StepShapeOf(config_);
  env::ObservationBatch observations;
  observations.Resize(4, shape.num_beams, shape.state_size);
  std::vector<float> actions(8);
  // Courses 0 and 2 of three turns are static, and so on.
  teachers->Act(observations, std::vector<int>{0, 1, 2, 31}, actions);
  EXPECT_THAT(actions, testing::Pointwise(testing::FloatNear(1e-6f),
                                          {0.5f, 0.5f, -0.5f, -0.5f, 0.5f, 0.5f, -0.5f, -0.5f}));
  config_.method.learner.algorithm = "td3";
  EXPECT_EQ(MakeTeachers(ResolveRecorded(config_), directory_.path()), nullptr);
}

TEST_F(DistillationTest, TeachersAreReadFromTheRunsCopies) {
  const std::filesystem::path inputs = directory_.path() / "inputs";
  WriteInputs(ReadInputs(Resolve(config_)), inputs);
  for (const char* name : {"still.safetensors", "walls.safetensors"}) {
    std::filesystem::remove(directory_.path() / name);
  }
  EXPECT_THAT(Refusal(), HasSubstr("cannot open"));
  config_.courses.inputs = inputs;
  EXPECT_EQ(Refusal(), "accepted");
  const auto files = TeacherFiles(Resolve(config_), "");
  EXPECT_NE(files.at(sim::FreshKind::kStatic), files.at(sim::FreshKind::kWall));
  EXPECT_EQ(files.at(sim::FreshKind::kStatic).parent_path(), inputs);
}

TEST_F(DistillationTest, ScoresOnCoursesOfItsTeachersAreKnown) {
  const auto save = [this](const std::string& name, const std::string& courses) {
    RunConfig taught;
    taught.courses.train = courses;
    SaveTeacher(name, 0.5f, {{"config", config::ToToml(taught)}});
  };
  save("still", "generated:5:1");
  save("walls", "generated:3:2");
  const auto overlap = [this](const std::string& courses) {
    return FindTrainingOverlap(config_.courses.Resolve(courses), config_);
  };
  EXPECT_EQ(overlap("generated:3:2+generated:4:1"),
            (eval::TrainingOverlap{
                2, 3, "fresh courses (static+wall+static), generated:5:1, generated:3:2"}));
  EXPECT_EQ(overlap("generated:4:1")->num_courses, 0);
  // That of the other one is still known.
  std::filesystem::remove(directory_.path() / "still.safetensors");
  EXPECT_EQ(overlap("generated:3:2")->num_courses, 2);
  EXPECT_EQ(overlap("generated:4:1"), std::nullopt) << "unknown, not none";
}

TEST_F(DistillationTest, ATeacherMaySeeWhatItsStudentDoesNot) {
  // It turns as fast as the nearest obstacle is to the left.
  RunConfig told = config_;
  told.environment.observation.privileged = true;
  told.network = {.encoder_layers = {}, .head_layers = {}, .sectors = 72};
  policy::PolicySnapshot snapshot = policy::ZeroSnapshot(MakePolicySpec(told));
  snapshot.version = 1;
  const std::size_t features = 72 + env::kStateSize + env::kPrivilegedSize;
  auto weights = std::make_shared<std::vector<float>>(*snapshot.weights);
  ASSERT_EQ(weights->size(), 2 * features + 2);
  const std::size_t place_y = 72 + env::kStateSize + 3;
  (*weights)[features + place_y] = 1.0f;
  snapshot.weights = weights;
  const std::string file = (directory_.path() / "told.safetensors").string();
  policy::SavePolicy(file, snapshot, {});
  config_.distillation.teachers[1].value.text = Quoted(file);
  const auto teachers = MakeTeachers(ResolveRecorded(config_), directory_.path());
  // The run's environments show it, behind what the student sees.
  base::ParallelFor parallel(1);
  sim::CourseEnvironments environments = MakeTrainingEnvironments(config_, parallel);
  const env::ObservationBatch& observations = environments.observations();
  ASSERT_EQ(observations.state_size, env::kStateSize + env::kPrivilegedSize);
  std::vector<int> courses;
  for (int i = 0; i < environments.batch_size(); ++i) courses.push_back(i % 2);
  for (int i = 0; i < environments.batch_size(); ++i) environments.Reset(i, {courses[i], 7});
  std::vector<float> actions(2 * courses.size());
  teachers->Act(observations, courses, actions);
  const float y = observations.frame(1).state[env::kStateSize + 3];
  EXPECT_NE(y, 0.0f);
  EXPECT_NEAR(actions[3], std::tanh(y), 1e-5f);
  EXPECT_NEAR(actions[1], 0.5f, 1e-6f) << "the other teacher sees what the student sees";
}

TEST_F(DistillationTest, RefusesTeachersThatDoNotFit) {
  const RunConfig good = config_;
  config_.courses.fresh = "static+wall+halls";
  EXPECT_THAT(Refusal(), StartsWith("distillation: found no teacher of halls"));
  config_.courses.fresh = "static";
  EXPECT_THAT(Refusal(),
              StartsWith("distillation.teachers.wall: teaches wall, expected a kind of"));
  config_ = good;
  config_.distillation.teachers[1].key = "walls";
  EXPECT_THAT(Refusal(), StartsWith("distillation.teachers.walls: expected a kind"));
  config_ = good;
  config_.courses.train = "static-train-5";
  EXPECT_THAT(Refusal(), StartsWith("courses.train is \"static-train-5\""));
  config_ = good;
  config_.method.learner.algorithm = "td3";
  EXPECT_THAT(Refusal(), StartsWith("distillation.teachers is "));
  config_ = good;
  config_.distillation.teachers[0].value.text = "[1]";
  EXPECT_THAT(Refusal(), StartsWith("distillation.teachers.static: found [1]"));
  config_ = good;
  config_.distillation.teachers[0].value.text = "\"missing.safetensors\"";
  EXPECT_THAT(Refusal(), StartsWith("missing.safetensors: cannot open"));
  config_ = good;
  config_.environment.action.linear_max = 1.0;
  EXPECT_THAT(Refusal(), HasSubstr("still.safetensors"));
  config_ = good;
  EXPECT_THROW((void)Resolve(config_, {.serves = true}), base::Error);
}

/// A run whose teachers are stages of it.
RunConfig Staged() {
  RunConfig config = SmallRun();
  config.courses.train = "";
  config.courses.fresh = "static+box+wall";
  config.method.learner.algorithm = "distillation";
  config.run.max_steps = 3000;
  config.distillation.stages = {{"most.courses.fresh", {"'static+static+box'", ""}},
                                {"most.run.max_steps", {"2000", ""}},
                                {"walls.courses.fresh", {"'wall'", ""}},
                                {"walls.environment.reward.collision", {"1.0", ""}},
                                {"walls.learner.algorithm", {"'ddpg'", ""}}};
  return config;
}

std::string RefusalOf(const RunConfig& config) {
  try {
    (void)Resolve(config);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(StagesTest, AStageIsTheRunWithOtherKeys) {
  RunConfig config = Staged();
  config.environment.reward.collision = 4.0;
  config.run.deterministic = false;
  config.run.max_seconds = 60.0;
  EXPECT_EQ(RefusalOf(config), "accepted");
  const ResolvedRun run = Resolve(config);
  const std::vector<Stage>& stages = run.stages;
  ASSERT_EQ(stages.size(), 2u);
  EXPECT_EQ(stages[0].name, "most");
  EXPECT_EQ(stages[0].config.courses.fresh, "static+static+box");
  EXPECT_EQ(stages[0].config.run.max_steps, 2000);
  EXPECT_EQ(stages[0].config.run.max_seconds, 60.0);
  EXPECT_EQ(stages[0].config.method.learner.algorithm, "td3");
  EXPECT_EQ(stages[0].config.environment.reward.collision, 4.0);
  EXPECT_EQ(stages[1].name, "walls");
  EXPECT_EQ(stages[1].config.run.max_steps, 3000);
  EXPECT_EQ(stages[1].config.method.learner.algorithm, "ddpg");
  EXPECT_EQ(stages[1].config.environment.reward.collision, 1.0);
  EXPECT_TRUE(stages[1].config.distillation.stages.empty());
  const auto files = TeacherFiles(run, "run");
  EXPECT_EQ(files.at(sim::FreshKind::kBox), "run/stages/most/policy.safetensors");
  EXPECT_EQ(files.at(sim::FreshKind::kWall), "run/stages/walls/policy.safetensors");

  EXPECT_EQ(MaxStepsOf(run), config.run.max_steps + 2000 + 3000);
  EXPECT_EQ(RunsOf(run, "run"),
            (std::vector<std::filesystem::path>{"run/stages/most", "run/stages/walls", "run"}));

  config.run.deterministic = true;
  config.run.max_seconds = 0.0;
  config.distillation.stages.push_back({"walls.run.max_seconds", {"30.0", ""}});
  EXPECT_EQ(Resolve(config).stages[1].config.run.max_seconds, 0.0)
      << "a run in lockstep ends by steps";
}

TEST(StagesTest, RefusesStagesThatDoNotFit) {
  const auto refusal = [](const std::string& key, const std::string& value) {
    RunConfig config = Staged();
    config.distillation.stages.push_back({key, {value, ""}});
    return RefusalOf(config);
  };
  EXPECT_THAT(refusal("walls", "1"), StartsWith("distillation.stages.walls: expected STAGE.KEY"));
  EXPECT_THAT(refusal("../walls.run.max_steps", "1"), HasSubstr("expected letters, digits"));
  EXPECT_THAT(refusal("a/b.run.max_steps", "1"), HasSubstr("found the stage 'a/b'"));
  EXPECT_THAT(refusal(".run.max_steps", "1"), HasSubstr("found the stage ''"));
  EXPECT_THAT(refusal("walls.learner.gama", "0.9"),
              StartsWith("distillation.stages.walls.learner.gama: "));
  EXPECT_THAT(refusal("walls.learner.gamma", "2"),
              StartsWith("distillation.stages.walls.learner.gamma: "));
  EXPECT_THAT(refusal("walls.run.seed", "2"), HasSubstr("has no run.seed of its own"));
  EXPECT_THAT(refusal("walls.courses.train", "'static-train-5'"),
              StartsWith("distillation.stages.walls: courses.train is"));
  EXPECT_THAT(refusal("walls.courses.fresh", "'box'"),
              StartsWith("distillation.stages.walls: teaches box, which has another teacher"));
  EXPECT_THAT(refusal("walls.environment.robot.command_delay", "0.1"), testing::Eq("accepted"));
  RunConfig config = Staged();
  config.courses.fresh = "static+box+wall+halls";
  EXPECT_THAT(RefusalOf(config), StartsWith("distillation: found no teacher of halls"));
}

TEST(StagesTest, AreTrainedOnceAndTeach) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  const RunConfig config = Staged();
  const auto train = [&](std::stop_token stop) {
    return TrainStages(Resolve(config), directory, "test", nullptr, stop);
  };
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_EQ(train(stopped.get_token()), TrainingEnd::kStopped);
  EXPECT_EQ(train({}), TrainingEnd::kFinished);
  const run::RunDirectory most{StageDirectory(directory.root, "most")};
  const auto written = std::filesystem::last_write_time(most.policy());
  EXPECT_EQ(train({}), TrainingEnd::kFinished);
  EXPECT_EQ(std::filesystem::last_write_time(most.policy()), written) << "trained again";
  EXPECT_FALSE(std::filesystem::exists(most.checkpoints()));
  RunConfig longer = config;
  longer.run.max_steps *= 2;
  EXPECT_EQ(TrainStages(Resolve(longer), directory, "test", nullptr, {}), TrainingEnd::kFinished);
  EXPECT_EQ(std::filesystem::last_write_time(most.policy()), written) << "it is at its own limit";
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
}

TEST(StagesTest, OnlyAPolicyOfTheSameConfigAtItsLimitIsAFinishedStage) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  RunConfig config = Staged();
  const run::RunDirectory most{StageDirectory(directory.root, "most")};
  std::stop_source stopped;
  stopped.request_stop();
  const auto error = [&] {
    try {
      (void)TrainStages(Resolve(config), directory, "test", nullptr, stopped.get_token());
      return std::string("none");
    } catch (const base::Error& refusal) {
      return std::string(refusal.what());
    }
  };
  EXPECT_EQ(error(), "none");
  ASSERT_TRUE(std::filesystem::exists(most.policy()));
  std::filesystem::remove_all(most.checkpoints());  // As if the disk had been full.
  EXPECT_THAT(error(), HasSubstr("no checkpoint to go on from"));
  config.run.seed = 7;
  EXPECT_THAT(error(), StartsWith(most.policy().string() +
                                  " (its config): run.seed was 1 when the run began and is 7 now"));
}

TEST_F(DistillationTest, ARunEndsNearItsTeachers) {
  config_.courses.fresh = "static";
  config_.distillation.teachers.resize(1);
  config_.run.max_steps = 12000;
  config_.method.learner.mirror = false;
  config_.method.learner.actor_learning_rate = 1e-2;
  const run::RunDirectory directory{directory_.path() / "run"};
  EXPECT_EQ(RunOnce(config_, directory), TrainingEnd::kFinished);
  policy::NetworkAgent student(Policy(directory));
  const env::StepShape shape = StepShapeOf(config_);
  env::ObservationBatch observations;
  observations.Resize(1, shape.num_beams, shape.state_size);
  std::ranges::fill(observations.ranges_cm, 400);
  observations.state[0] = 5.0f;
  std::vector<float> action(2);
  student.Act(observations, action);
  EXPECT_NEAR(action[0], 0.5f, 0.1f);
  EXPECT_NEAR(action[1], 0.5f, 0.1f);
}

}  // namespace
}  // namespace slalom::train
