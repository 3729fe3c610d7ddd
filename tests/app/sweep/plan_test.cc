#include "app/sweep/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/error.h"
#include "tests/app/sweep/plan_files.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

namespace fs = std::filesystem;

const std::string kPlan = std::string(test::kSweep) + test::kTinyScore;

/// What reading and expanding a plan throws; empty: nothing.
std::string ErrorOf(const std::string& text, const std::vector<std::string>& overrides = {}) {
  const test::ScratchDirectory scratch;
  try {
    (void)test::Expand(scratch.path(), text, overrides);
    return "";
  } catch (const base::Error& error) {
    return error.what();
  }
}

TEST(PlanTest, TheFileGivesTheNameAndGroupsTheirLabels) {
  const test::ScratchDirectory scratch;
  const Plan plan = ReadPlan(test::WritePlan(scratch.path(), kPlan), {});
  EXPECT_EQ(plan.sweep.name, "plan");
  EXPECT_EQ(plan.sweep.title, "plan");
  ASSERT_EQ(plan.groups.size(), 1U);
  EXPECT_EQ(plan.groups[0].label, "plan");
}

TEST(PlanTest, OverridesOfThePlanAndOfTheTrainingsAreToldApart) {
  const test::ScratchDirectory scratch;
  const Plan plan = ReadPlan(test::WritePlan(scratch.path(), kPlan),
                             std::vector<std::string>{"sweep.seeds=[7]", "run.max_steps=9000"});
  EXPECT_EQ(plan.sweep.seeds, std::vector<int>{7});
  ASSERT_EQ(plan.overrides.size(), 1U);
  EXPECT_EQ(plan.overrides[0].key, "run.max_steps");
}

TEST(PlanTest, AServiceIsNotInLockstepUnlessThePlanSaysOtherwise) {
  const test::ScratchDirectory scratch;
  const auto lockstep = [&](const std::vector<std::string>& overrides) {
    return ReadPlan(test::WritePlan(scratch.path(), kPlan), overrides).sweep.lockstep;
  };
  EXPECT_TRUE(lockstep({}));
  EXPECT_TRUE(lockstep({"sweep.trainer=process"}));
  EXPECT_FALSE(lockstep({"sweep.trainer=service"}));
  EXPECT_FALSE(lockstep({"sweep.trainer=service", "sweep.lockstep=false"}));
}

TEST(PlanTest, AFileMayNamePlansInPlaceOfBeingOne) {
  const test::ScratchDirectory scratch;
  const fs::path plan = test::WritePlan(scratch.path(), kPlan);
  const fs::path list = scratch.path() / "list.toml";
  const auto write = [&](const std::string& text) { base::WriteFileAtomically(list, text); };
  const auto files = [&] { return PlanFiles(list); };
  EXPECT_THAT(PlanFiles(plan), ElementsAre(plan));
  write("[sweep]\nplans = [\"plan.toml\", \"plan.toml\"]\n");
  EXPECT_THAT(files(), ElementsAre(plan, plan));
  EXPECT_THAT([&] { ReadPlan(list, {}); },
              ThrowsMessage<base::Error>(HasSubstr("list.toml: is a list of plans, expected one")));
  write("[sweep]\nplans = [\"plan.toml\"]\nseeds = [1]\n");
  EXPECT_THAT(files, ThrowsMessage<base::Error>(HasSubstr("nothing but the list of plans")));
  write("[sweep]\nplans = [\"list.toml\"]\n");
  EXPECT_THAT(files, ThrowsMessage<base::Error>(HasSubstr("list.toml, which is a list of plans")));
  write("[sweep]\nplans = [\"gone.toml\"]\n");
  EXPECT_THAT(files, ThrowsMessage<base::Error>(HasSubstr("gone.toml")));
}

TEST(PlanTest, WhatIsPrintedReadsBack) {
  const test::ScratchDirectory scratch;
  const std::string text = kPlan +
                           "[set]\nlearner.gamma = 0.9\n"
                           "[[axis]]\nkeys = [\"learner.tau\"]\nvalues = [0.1, 0.2]\n"
                           "[[group]]\nname = \"a\"\nset = {actor.noise_min = 0.1}\n"
                           "[[group.axis]]\nkeys = [\"network.kind\", \"run.seed\"]\n"
                           "values = [[\"mlp\", 1], [\"gru\", 2]]\nlabels = [\"x\", \"y\"]\n"
                           "[[group]]\nname = \"b\"\n"
                           "[[reference]]\nsource = \"s\"\nscore = \"test\"\n";
  Plan plan = ReadPlan(test::WritePlan(scratch.path(), text), {});
  const std::string printed = config::PrintToml(config::ListFields(plan));
  base::WriteFileAtomically(scratch.path() / "printed.toml", printed);
  Plan back = ReadPlan(scratch.path() / "printed.toml", {});
  back.sweep.name = plan.sweep.name;
  EXPECT_EQ(config::PrintToml(config::ListFields(back)), printed);
  EXPECT_EQ(back.groups[0].axes[0].values, plan.groups[0].axes[0].values);
  EXPECT_EQ(back.set, plan.set);
}

TEST(PlanTest, BadPlansAreOneErrorThatNamesWhatIsWrong) {
  EXPECT_EQ(ErrorOf(kPlan), "");
  EXPECT_THAT(ErrorOf(kPlan + "[swep]\n"), AllOf(HasSubstr("plan.toml:8"), HasSubstr("'swep'")));
  EXPECT_THAT(ErrorOf(kPlan + "[[axis]]\nkey = \"a\"\n"),
              AllOf(HasSubstr("plan.toml:9"), HasSubstr("did you mean 'keys'")));
  const auto concluding = [](const std::string& keys) {
    return ErrorOf(kPlan + "[[conclusion]]\n" + keys);
  };
  const std::string sound = "text = \"a\"\nscore = \"test\"\nrows = [\"plan\"]\n";
  EXPECT_EQ(concluding(sound), "");
  EXPECT_THAT(concluding(""), HasSubstr("[[conclusion]] has no text"));
  EXPECT_THAT(concluding("text = \"a\"\nscore = \"b\"\n"),
              HasSubstr("[[conclusion]] 'a' names the score 'b'"));
  EXPECT_THAT(concluding("text = \"a\"\nscore = \"test\"\n"), HasSubstr("has no rows"));
  EXPECT_THAT(concluding(sound + "than = [\"b\"]\n"), HasSubstr("there is no row 'b'"));
  EXPECT_THAT(concluding(sound + "than = [\"b\", \"c\"]\n"), HasSubstr("1 rows and 2"));
  EXPECT_THAT(concluding(sound + "than_score = \"test\"\n"), HasSubstr("without conclusion.than"));
  EXPECT_THAT(concluding(sound + "kind = \"within\"\n"), HasSubstr("limit = 0"));
  EXPECT_THAT(concluding(sound + "kind = \"over\"\n"), HasSubstr("above"));
  EXPECT_THAT(ErrorOf(test::kSweep), HasSubstr("no [[score]]"));
  EXPECT_THAT(ErrorOf(kPlan + "[[axis]]\nkeys = [\"learner.tau\"]\nvalues = []\n"),
              HasSubstr("[[axis]] 'learner.tau' is empty"));
  EXPECT_THAT(ErrorOf(kPlan + "[[axis]]\nvalues = [1]\n"), HasSubstr("has no keys"));
  EXPECT_THAT(
      ErrorOf(kPlan +
              "[[axis]]\nkeys = [\"learner.tau\"]\nvalues = [0.1]\nlabels = [\"a\", \"b\"]\n"),
      HasSubstr("2 labels and 1 values"));
  const std::string axis = "[[axis]]\nkeys = [\"learner.tau\"]\nvalues = [0.1, 0.2]\n";
  EXPECT_THAT(ErrorOf(kPlan + axis + "num_seeds = [1]\n"), HasSubstr("1 num_seeds and 2 values"));
  EXPECT_THAT(ErrorOf(kPlan + "column = \"0.1\"\n" + axis),
              HasSubstr("has the column '0.1', but no [[axis]] has columns = true"));
  EXPECT_THAT(ErrorOf(kPlan + axis + "columns = true\n"),
              HasSubstr("has the column '', expected a label of the axis 'learner.tau': 0.1, 0.2"));
  EXPECT_EQ(ErrorOf(kPlan + "column = \"0.1\"\n" + axis + "columns = true\n"), "");
  EXPECT_THAT(ErrorOf(kPlan + axis +
                      "columns = true\n[[axis]]\nkeys = [\"learner.gamma\"]\n"
                      "values = [0.9]\ncolumns = true\n"),
              HasSubstr("two axes have columns = true"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a\"\n[[group.axis]]\nkeys = [\"learner.tau\"]\n"
                              "values = [0.1]\ncolumns = true\n"),
              HasSubstr("expected that of an [[axis]] of the plan only"));
  EXPECT_THAT(ErrorOf(kPlan + "[[axis]]\nkeys = [\"learner.tua\"]\nvalues = [0.1]\n"),
              AllOf(HasSubstr("plan.toml:10"), HasSubstr("did you mean 'learner.tau'")));
  EXPECT_THAT(ErrorOf(kPlan + "[[axis]]\nkeys = [\"learner.tau\"]\nvalues = [7]\n"),
              AllOf(HasSubstr("plan.toml:10"), HasSubstr("learner.tau is 7")));
  EXPECT_THAT(ErrorOf(kPlan + "[set]\nlearner.gama = 0.9\n"),
              AllOf(HasSubstr("plan.toml:9"), HasSubstr("did you mean 'learner.gamma'")));
  EXPECT_THAT(ErrorOf(kPlan, {"learner.gama=0.9"}), HasSubstr("did you mean 'learner.gamma'"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.sed=1"}), HasSubstr("did you mean 'sweep.seeds'"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.seeds=[]"}), HasSubstr("sweep.seeds is empty"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.seeds=[1, 1]"}), HasSubstr("a seed twice"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.quantities=[\"succes\"]"}),
              HasSubstr("sweep.quantities names 'succes', expected one of success_rate"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.scores=[\"x\"]"}), HasSubstr("sweep.scores names 'x'"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.preset=gone.toml"}), HasSubstr("gone.toml: there is no such"));
  EXPECT_THAT(ErrorOf(kPlan, {"budget.seconds=5"}), HasSubstr("sweep.lockstep = false"));
  EXPECT_EQ(ErrorOf(kPlan, {"sweep.trainer=service"}), "");
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.trainer=services"}),
              HasSubstr("sweep.trainer is 'services', expected one of 'process', 'service'"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.trainer=service", "sweep.actors=0"}),
              HasSubstr("sweep.actors is 0, expected"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.trainer=service", "sweep.lockstep=true"}),
              HasSubstr("plan.toml: sweep.trainer = \"service\" and sweep.lockstep = true"));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.trainer=service", "service.replay=tcp://127.0.0.1:5550"}),
              AllOf(HasSubstr("--set service.replay"), HasSubstr("the sweep's to decide")));
  EXPECT_THAT(ErrorOf(kPlan, {"sweep.trainer=service", "replay_server.max_message_bytes=65536",
                              "actor_service.chunk_rows=16384"}),
              HasSubstr("replay_server.max_message_bytes"));
  EXPECT_THAT(ErrorOf(kPlan, {"budget.steps=5000", "budget.updates=5"}),
              HasSubstr("more than one limit"));
  EXPECT_THAT(ErrorOf(kPlan, {"budget.steps=200"}), HasSubstr("nothing is learned"));
  EXPECT_THAT(ErrorOf(kPlan, {"run.max_seconds=5"}), HasSubstr("use budget.steps"));
  EXPECT_THAT(ErrorOf(kPlan, {"run.seed=5"}), HasSubstr("use sweep.seeds"));
  EXPECT_THAT(ErrorOf(kPlan + "[[axis]]\nkeys = [\"learner.tau\"]\nvalues = [0.1, 0.2]\n"
                              "labels = [\"a\", \"a\"]\n"),
              HasSubstr("two trainings are called 'a, seed 1'"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a\"\nlabel = \"x\"\n[[group]]\nname = \"b\"\n"
                              "label = \"x\"\nset = {learner.tau = 0.1}\n"),
              HasSubstr("two trainings are called 'x"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a\"\nbase = \"tiny.toml\"\n"),
              AllOf(HasSubstr("plan.toml:10"), HasSubstr("unknown key 'base'")));
  EXPECT_THAT(ErrorOf(kPlan + "set = {environment.lidar.field_of_view = 3.0}\n"),
              HasSubstr("which the policy is trained with"));
  EXPECT_THAT(ErrorOf(kPlan + "set = {environment.lidar.num_beams = 360}\n"),
              HasSubstr("the policy"));
  EXPECT_THAT(ErrorOf(kPlan + "set = {environment.randomize.lidar.num_beams = [360, 720]}\n"),
              AllOf(HasSubstr("plan.toml:8"), HasSubstr("it is the shape of an observation")));
  EXPECT_THAT(ErrorOf(kPlan + "[[axis]]\nkeys = ['environment.randomize.robot.command_delay']\n"
                              "values = [[0.0, 0.1], [0.0, 2.0]]\n"),
              AllOf(HasSubstr("plan.toml"), HasSubstr("two numbers in [0, 1] s")));
  EXPECT_THAT(ErrorOf(kPlan, {"courses.train=static-trian-5"}), HasSubstr("static-trian-5"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a b\"\n"), HasSubstr("'a b'"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a\"\n[[group]]\nname = \"a\"\n"),
              HasSubstr("two groups"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a\"\nplanner = \"dwb\"\n"),
              HasSubstr("no planner 'dwb'"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a\"\nscores = [\"x\"]\n"),
              HasSubstr("names the score 'x'"));
  EXPECT_THAT(ErrorOf(kPlan + "[[group]]\nname = \"a\"\n[[group]]\nname = \"b\"\n"),
              HasSubstr("are the same training"));
  EXPECT_THAT(ErrorOf(kPlan + "profiles = [\"gone.toml\"]\n"), HasSubstr("gone.toml"));
  EXPECT_THAT(ErrorOf(kPlan + "planning = true\n"), HasSubstr("needs a transition model"));
  EXPECT_THAT(ErrorOf(kPlan + "set = {learner.gamma = 0.9}\n"), HasSubstr("expected a key of"));
  EXPECT_THAT(ErrorOf(kPlan + "protocol = \"papre\"\n"), HasSubstr("papre"));
  EXPECT_THAT(ErrorOf(kPlan + "[[reference]]\nsource = \"s\"\nscore = \"test\"\nrows = [\"x\"]\n"
                              "values = [0.5]\n"),
              HasSubstr("there is no row 'x', expected one of: plan"));
  EXPECT_THAT(ErrorOf(kPlan + "[[reference]]\nsource = \"s\"\nscore = \"test\"\nrows = [\"x\"]\n"),
              HasSubstr("1 rows, 0 values"));
}

}  // namespace
}  // namespace slalom::sweep
