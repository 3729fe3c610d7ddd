#include "app/sweep/cell.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "app/train/agent_run_config.h"
#include "app/train/run_identity.h"
#include "base/config.h"
#include "base/error.h"
#include "planners/planner_registry.h"
#include "policy/policy.h"
#include "tests/app/sweep/plan_files.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

const std::string kPlan = std::string(test::kSweep) + test::kTinyScore;

std::vector<std::string> Names(const Cells& cells) {
  std::vector<std::string> names;
  for (const Cell& cell : cells.cells) names.push_back(cell.name());
  return names;
}

/// Values that the field does not have, as TOML; not each is allowed.
std::vector<std::string> OtherValues(const config::Field& field) {
  const std::string value = config::PrintValue(field);
  if (value == "true") return {"false"};
  if (value == "false") return {"true"};
  if (value.starts_with('[')) return {"[3]", "[9]"};
  if (value == "{}") return {"{robot.speed_gain = [0.9, 1.0]}"};
  std::vector<std::string> others;
  for (const std::string_view choice : field.choices) {
    others.push_back(fmt::format("\"{}\"", choice));
  }
  if (value.starts_with('"') && others.empty()) others = {"\"other\""};
  if (field.range) {
    const bool is_integer = value.find_first_of(".en") == std::string::npos;
    const double number = std::stod(value);
    const double high = std::min(field.range->max, 1.0e9);
    for (const double other :
         {number + 1, number * 2, number / 2, number - 1, field.range->min, high}) {
      if (other < field.range->min || other > high) continue;
      others.push_back(is_integer ? fmt::format("{:.0f}", other) : fmt::format("{:#}", other));
    }
  }
  std::erase(others, value);
  return others;
}

/// Values by keys, as TOML.
using Values = std::map<std::string, std::string>;

/// The choices with which a field of a run is read, in a plan that has a model.
Values ChoicesFor(const config::Field& field) {
  train::RunConfig defaults;
  const std::vector<config::Field> all = config::ListFields(defaults).fields;
  Values choices;
  for (const config::ReadIf& choice : field.read_if) {
    if (choice.key == "model.kind") continue;
    const auto at = std::ranges::find(all, choice.key, &config::Field::key);
    choices[choice.key] = choice.values.empty() ? OtherValues(*at).front()
                                                : fmt::format("\"{}\"", choice.values.front());
  }
  // It may not come after the end.
  if (field.key == "imagination.schedule_begin") choices["imagination.schedule_end"] = "1000";
  return choices;
}

/// Expects that a plan's cells change with every one of these keys. `identify` names the
/// cell in which keys have these values, and throws `base::Error` where it is not allowed there.
template <class Identify>
void ExpectEachKeyCounts(const std::vector<config::Field>& fields, const std::string& base,
                         const Identify& identify) {
  std::map<std::string, std::string> seen = {{base, "the plan as it is"}};
  for (const config::Field& field : fields) {
    if (field.key.starts_with("task.")) continue;  // Cells drive courses.
    std::string why = "there is no other value";
    bool is_tried = false;
    const Values choices = ChoicesFor(field);
    if (!choices.empty()) seen.try_emplace(identify(choices), field.key + " with its default");
    for (const std::string& value : OtherValues(field)) {
      try {
        Values values = choices;
        values[field.key] = value;
        const std::string id = identify(values);
        const auto [earlier, is_new] = seen.try_emplace(id, field.key);
        EXPECT_TRUE(is_new) << field.key << " = " << value << " is as " << earlier->second;
        is_tried = true;
        break;
      } catch (const base::Error& error) {
        why = error.what();
      }
    }
    EXPECT_TRUE(is_tried) << field.key << ": " << why;
  }
}

std::set<std::string> Ids(const Cells& cells) {
  std::set<std::string> ids;
  for (const Cell& cell : cells.cells) ids.insert(cell.id);
  return ids;
}

TEST(CellTest, AxesMultiplyAndKeysOfOneAxisGoTogether) {
  const test::ScratchDirectory scratch;
  const Cells cells =
      test::Expand(scratch.path(),
                   kPlan +
                       "[[axis]]\nname = \"rate\"\nkeys = [\"learner.tau\"]\nvalues = [0.1, 0.2]\n"
                       "[[axis]]\nkeys = [\"learner.gamma\", \"learner.n_step\"]\n"
                       "values = [[0.9, 1], [0.99, 4]]\nlabels = [\"short\", \"long\"]\n",
                   {"sweep.seeds=[5]"});
  EXPECT_THAT(Names(cells), ElementsAre("0.1 / short, seed 5", "0.1 / long, seed 5",
                                        "0.2 / short, seed 5", "0.2 / long, seed 5"));
  EXPECT_THAT(cells.axis_names, ElementsAre("rate", "learner.gamma"));
  const train::RunConfig& last = *cells.cells[3].config;
  EXPECT_EQ(last.method.learner.tau, 0.2);
  EXPECT_EQ(last.method.learner.gamma, 0.99);
  EXPECT_EQ(last.method.learner.n_step, 4);
  EXPECT_EQ(last.run.seed, 5);
  EXPECT_TRUE(last.run.deterministic);
  EXPECT_EQ(Ids(cells).size(), 4U);
}

TEST(CellTest, TheValuesOfTheAxisOfColumnsShareARowAndHaveTheirOwnScores) {
  const test::ScratchDirectory scratch;
  const std::string plan =
      std::string(test::kSweep) +
      "[[axis]]\nname = \"courses\"\nkeys = [\"courses.train\"]\ncolumns = true\n"
      "values = [\"generated:3:2\", \"generated-wall:3:2\"]\nlabels = [\"static\", \"walls\"]\n"
      "num_seeds = [2, 1]\n"
      "[[axis]]\nname = \"H\"\nkeys = [\"network.history\"]\nvalues = [1, 4]\n"
      "[[score]]\nname = \"s\"\ncolumn = \"static\"\ncourses = \"generated:4:2\"\n"
      "[[score]]\nname = \"w\"\ncolumn = \"walls\"\ncourses = \"generated-wall:4:2\"\n";
  const Cells cells = test::Expand(scratch.path(), plan);
  EXPECT_THAT(Names(cells),
              ElementsAre("1, static, seed 1", "1, static, seed 2", "1, walls, seed 1",
                          "4, static, seed 1", "4, static, seed 2", "4, walls, seed 1"));
  EXPECT_THAT(cells.axis_names, ElementsAre("H"));
  for (const Cell& cell : cells.cells) {
    SCOPED_TRACE(cell.name());
    EXPECT_EQ(cell.row_name(), std::to_string(cell.config->network.history));
    const bool is_static = cell.column == "static";
    EXPECT_EQ(cell.config->courses.train, is_static ? "generated:3:2" : "generated-wall:3:2");
    ASSERT_EQ(cell.scores.size(), 1U);
    EXPECT_EQ(cell.scores[0].name, is_static ? "s" : "w");
  }
  EXPECT_EQ(Ids(cells).size(), 6U);
  // A group that has no score of a column has no training there.
  EXPECT_THAT(Names(test::Expand(scratch.path(), plan, {"sweep.scores=[\"w\"]"})),
              ElementsAre("1, walls, seed 1", "4, walls, seed 1"));
}

TEST(CellTest, GroupsAndPlannersAreRowsOfTheirOwn) {
  const test::ScratchDirectory scratch;
  const Cells cells =
      test::Expand(scratch.path(), kPlan +
                                       "[[score]]\nname = \"own\"\ncourses = \"training\"\n"
                                       "[[group]]\nname = \"td3\"\nlabel = \"TD3\"\n"
                                       "[[group.axis]]\nkeys = [\"learner.tau\"]\nvalues = [0.1]\n"
                                       "[[group]]\nname = \"dwa\"\nplanner = \"dwa\"\n");
  EXPECT_THAT(Names(cells), ElementsAre("TD3 / 0.1, seed 1", "TD3 / 0.1, seed 2", "dwa"));
  EXPECT_EQ(cells.cells[0].scores.size(), 2U);
  EXPECT_EQ(cells.cells[0].scores[1].courses, "generated:3:2");
  EXPECT_EQ(cells.cells[2].scores.size(), 1U) << "a planner has no training courses";
  EXPECT_FALSE(cells.cells[2].config.has_value());
}

TEST(CellTest, APlannerHasTheRobotOfItsProtocolAndItsGroupsKeys) {
  const test::ScratchDirectory scratch;
  const std::string plan =
      "[sweep]\ntitle = \"planners\"\n[[group]]\nname = \"dwa\"\nplanner = \"dwa\"\n"
      "set = {environment.robot.mass = 20.0}\n"
      "[[score]]\nname = \"paper\"\ncourses = \"generated:3:2\"\n"
      "[[score]]\nname = \"runs\"\ncourses = \"generated:3:2\"\nprotocol = \"dwa-runs\"\n";
  const Cells cells = test::Expand(scratch.path(), plan);
  const auto& scores = cells.cells[0].scores;
  EXPECT_THAT(scores[0].task, AllOf(HasSubstr("friction = \"cone\""), HasSubstr("mass = 20.0")));
  EXPECT_THAT(scores[1].task, AllOf(HasSubstr("friction = \"gazebo\""),
                                    HasSubstr("sensor_mass = 1.1"), HasSubstr("mass = 20.0")));
  EXPECT_THAT([&] { test::Expand(scratch.path(), plan + "[set]\nenvironment.robot.mass = 9.0\n"); },
              ThrowsMessage<base::Error>(HasSubstr("in the `set` of a group")));
}

TEST(CellTest, AGroupsProfilesLieOverItsPresetAndUnderItsKeys) {
  const test::ScratchDirectory scratch;
  base::WriteFileAtomically(scratch.path() / "worn.toml",
                            "[environment.robot]\nspeed_gain = 0.9\nyaw_gain = 0.8\n");
  const std::string groups =
      "[[group]]\nname = \"new\"\n[[group]]\nname = \"worn\"\nprofiles = [\"worn.toml\"]\n"
      "set = {environment.robot.yaw_gain = 0.7}\n"
      "[[group]]\nname = \"dwa\"\nplanner = \"dwa\"\nprofiles = [\"worn.toml\"]\n";
  const Cells cells = test::Expand(scratch.path(), kPlan + groups, {"sweep.seeds=[1]"});
  const auto robot = [&](std::size_t cell) { return cells.cells[cell].config->environment.robot; };
  EXPECT_EQ(robot(0).speed_gain, 1.0);
  EXPECT_EQ(robot(1).speed_gain, 0.9);
  EXPECT_EQ(robot(1).yaw_gain, 0.7);
  EXPECT_THAT(cells.cells[1].scores[0].task, HasSubstr("speed_gain = 0.9"));
  EXPECT_THAT(cells.cells[2].scores[0].task,
              AllOf(HasSubstr("speed_gain = 0.9"), HasSubstr("yaw_gain = 0.8")));
  EXPECT_EQ(Ids(cells).size(), 3U);
}

TEST(CellTest, TheIdDependsOnAllThatDecidesTheResultAndOnNothingElse) {
  const test::ScratchDirectory scratch;
  const auto ids = [&](const std::string& text, const std::vector<std::string>& overrides = {},
                       const train::Platform& platform = {.blas_kernel = "k", .processor = "p"}) {
    return Ids(test::Expand(scratch.path(), text, overrides, platform));
  };
  const auto base = ids(kPlan);
  EXPECT_EQ(base.size(), 2U) << "one for each seed";
  EXPECT_EQ(ids(kPlan), base);
  // What changes nothing in the result: names, labels, other scores, how often it is logged.
  EXPECT_EQ(ids(kPlan, {"sweep.name=other", "sweep.title=other"}), base);
  EXPECT_EQ(ids(kPlan + "label = \"x\"\n[[score]]\nname = \"more\"\ncourses = \"generated:9:1\"\n"),
            base);
  EXPECT_EQ(ids(kPlan, {"run.log_interval=5", "run.checkpoint_steps=1000", "courses.test=\"\""}),
            base);
  // What changes it.
  for (const std::string set :
       {"learner.tau=0.01", "run.max_steps=5000", "courses.train=generated:3:3",
        "courses.train=generated:5:2", "environment.robot.command_delay=0.04",
        "run.snapshot_steps=[1000]", "network.head_layers=[9]"}) {
    const auto other = ids(kPlan, {set});
    EXPECT_EQ(other.size(), 2U);
    EXPECT_TRUE(std::ranges::none_of(other, [&](const auto& id) { return base.contains(id); }))
        << set;
  }
  EXPECT_NE(ids(kPlan, {}, {.blas_kernel = "k2", .processor = "p"}), base);
  EXPECT_NE(ids(kPlan, {}, {.blas_kernel = "k", .processor = "p2"}), base);
  EXPECT_NE(ids(kPlan, {}, {.numerics = 99, .blas_kernel = "k", .processor = "p"}), base);
  EXPECT_EQ(ids(kPlan, {"sweep.mixed_platforms=true"}, {.blas_kernel = "a", .processor = "b"}),
            ids(kPlan, {"sweep.mixed_platforms=true"}, {.blas_kernel = "c", .processor = "d"}));
  EXPECT_NE(ids(kPlan, {"sweep.mixed_platforms=true"},
                {.numerics = 1, .blas_kernel = "a", .processor = "b"}),
            ids(kPlan, {"sweep.mixed_platforms=true"},
                {.numerics = 2, .blas_kernel = "a", .processor = "b"}));
}

TEST(CellTest, EveryKeyThatDecidesATrainingIsPartOfItsId) {
  const test::ScratchDirectory scratch;
  const fs::path plan = test::WritePlan(scratch.path(), kPlan);
  const auto cell = [&](const Values& values, const char* lockstep = "sweep.lockstep=false") {
    std::vector<std::string> sets = {lockstep};
    const auto algorithm = values.find("learner.algorithm");
    const bool is_tqc = algorithm != values.end() && algorithm->second == "\"tqc\"";
    if (!is_tqc && !values.contains("model.kind")) sets.push_back("model.kind=probabilistic");
    for (const auto& [key, value] : values) sets.push_back(key + "=" + value);
    return ExpandPlan(ReadPlan(plan, sets), {}).cells.at(0);
  };
  const Cell base = cell({});
  train::RunConfig config = base.config.value();
  std::vector<config::Field> fields = config::ListFields(config).fields;
  std::erase_if(fields, [&](const config::Field& field) {
    const std::string& key = field.key;
    const bool is_of_sweep = key == "run.name" || key == "run.seed" || key == "run.deterministic";
    const bool is_how_long = key == "run.max_steps" || key == "run.max_seconds" ||
                             key == "run.snapshot_steps" || key == "run.snapshot_seconds";
    return is_of_sweep || key == "learner.from" || key.starts_with("courses.") ||
           key.starts_with("distillation.") || (!train::DecidesRun(config, key) && !is_how_long);
  });
  EXPECT_GT(fields.size(), 100U);
  ExpectEachKeyCounts(fields, base.id, [&](const Values& values) { return cell(values).id; });
  EXPECT_NE(cell({}, "sweep.lockstep=true").id, base.id);
}

TEST(CellTest, ThePolicyThatATrainingStartsFromIsPartOfItsId) {
  const test::ScratchDirectory scratch;
  const fs::path plan = test::WritePlan(scratch.path(), kPlan);
  const auto cell = [&](const fs::path& from) {
    const std::vector<std::string> sets = {"learner.from=" + from.string()};
    return ExpandPlan(ReadPlan(plan, sets), {}).cells.at(0);
  };
  policy::PolicySnapshot first = policy::ZeroSnapshot(
      train::MakePolicySpec(ExpandPlan(ReadPlan(plan, {}), {}).cells[0].config.value()));
  first.version = 1;
  const auto save = [&](const std::string& name) {
    policy::SavePolicy(scratch.path() / name, first, {});
    return scratch.path() / name;
  };
  const std::string id = cell(save("a.safetensors")).id;
  EXPECT_NE(id, cell("").id);
  EXPECT_EQ(id, cell(save("b.safetensors")).id) << "the same policy elsewhere";
  auto weights = std::make_shared<std::vector<float>>(*first.weights);
  weights->front() = 1.0f;
  first.weights = weights;
  EXPECT_NE(id, cell(save("a.safetensors")).id);
  first.spec.network.head_layers = {9};
  first.weights = policy::ZeroSnapshot(first.spec).weights;
  const fs::path other = save("c.safetensors");
  EXPECT_THAT([&] { (void)cell(other); },
              ThrowsMessage<base::Error>(AllOf(HasSubstr("learner.from: " + other.string()),
                                               HasSubstr("head_layers"), HasSubstr("[9]"),
                                               HasSubstr("[8]"))));
  EXPECT_THAT([&] { (void)cell(scratch.path() / "none"); },
              ThrowsMessage<base::Error>(HasSubstr("none")));
}

TEST(CellTest, AStagesKeysArePartOfTheId) {
  const test::ScratchDirectory scratch;
  const fs::path plan = test::WritePlan(scratch.path(), kPlan);
  const auto id = [&](const std::string& steps, const std::string& gamma) {
    const std::vector<std::string> sets = {"learner.algorithm=distillation",
                                           "courses.train=",
                                           "courses.fresh=static",
                                           "distillation.stages.a.courses.fresh=static",
                                           "distillation.stages.a.run.max_steps=" + steps,
                                           "distillation.stages.a.learner.gamma=" + gamma};
    return ExpandPlan(ReadPlan(plan, sets), {}).cells.at(0).id;
  };
  EXPECT_EQ(id("50000", "0.99"), id("50000", "0.99"));
  EXPECT_NE(id("50000", "0.99"), id("60000", "0.99"));
  EXPECT_NE(id("50000", "0.99"), id("50000", "0.98"));
}

TEST(CellTest, TheActorsOfAServiceArePartOfTheIdAndProcessesAreAsBefore) {
  const test::ScratchDirectory scratch;
  const auto cell = [&](const std::vector<std::string>& overrides) {
    return test::Expand(scratch.path(), kPlan, overrides).cells.at(0);
  };
  const Cell process = cell({"sweep.lockstep=false"});
  EXPECT_EQ(process.num_actors, 0);
  EXPECT_EQ(cell({"sweep.lockstep=false", "sweep.trainer=process", "sweep.actors=7"}).id,
            process.id);
  EXPECT_EQ(cell({"sweep.trainer=service"}).num_actors, 2);
  EXPECT_EQ(cell({"sweep.trainer=service", "sweep.actors=7"}).num_actors, 7);
  const std::set<std::string> ids = {process.id, cell({"sweep.trainer=service"}).id,
                                     cell({"sweep.trainer=service", "sweep.actors=7"}).id};
  EXPECT_EQ(ids.size(), 3U);
  EXPECT_EQ(config::ToToml(cell({"sweep.trainer=service"}).config.value()),
            config::ToToml(process.config.value()));
}

TEST(CellTest, EveryKeyThatDecidesAScoreIsPartOfItsDigest) {
  const test::ScratchDirectory scratch;
  const fs::path plan = test::WritePlan(scratch.path(), kPlan);
  const auto digest = [&](const Values& values) {
    std::vector<std::string> sets = {"model.kind=probabilistic", "mpc.enabled=true"};
    for (const auto& [key, value] : values) sets.push_back(key + "=" + value);
    return ExpandPlan(ReadPlan(plan, sets), {}).cells.at(0).scores.at(0).digest;
  };
  train::RunConfig config;
  std::vector<config::Field> fields = config::ListFields(config).fields;
  std::erase_if(fields, [](const config::Field& field) {
    const std::string& key = field.key;
    // The plan's score sets the episodes, and the number of environments changes the speed alone.
    return key == "mpc.enabled" || key == "evaluation.num_environments" ||
           key == "evaluation.episodes_per_course" ||
           (!key.starts_with("environment.") && !key.starts_with("evaluation.") &&
            !key.starts_with("mpc."));
  });
  ExpectEachKeyCounts(fields, digest({}), digest);
}

TEST(CellTest, EveryKeyOfAPlannerIsPartOfItsIdAndOfItsScore) {
  const test::ScratchDirectory scratch;
  const std::vector<std::string> names = planners::PlannerNames();
  const auto is_planners = [&](const std::string& key) {
    return std::ranges::find(names, key.substr(0, key.find('.'))) != names.end();
  };
  for (const std::string& planner : names) {
    const auto cell = [&](const Values& values) {
      std::vector<std::string> sets;
      for (const auto& [key, value] : values) sets.push_back(key + " = " + value);
      const fs::path plan = scratch.path() / "plan.toml";
      std::ofstream(plan) << "[sweep]\ntitle = \"t\"\n"
                          << test::kTinyScore
                          << fmt::format(
                                 "[[group]]\nname = \"x\"\nplanner = \"{}\"\nset = {{{}}}\n",
                                 planner, fmt::join(sets, ", "));
      return ExpandPlan(ReadPlan(plan, {}), {}).cells.at(0);
    };
    train::AgentRunConfig config;
    std::vector<config::Field> fields = config::ListFields(config).fields;
    std::erase_if(fields, [&](const config::Field& field) {
      if (is_planners(field.key)) return !field.key.starts_with(planner + ".");
      // The first one has the keys that all share, too.
      return planner != names.front() || field.key.starts_with("courses.") ||
             field.key.starts_with("evaluation.");
    });
    EXPECT_FALSE(fields.empty());
    const Cell base = cell({});
    std::map<std::string, std::string> ids = {{base.scores.at(0).digest, base.id}};
    ExpectEachKeyCounts(fields, base.id, [&](const Values& values) {
      const Cell other = cell(values);
      EXPECT_EQ(ids.emplace(other.scores.at(0).digest, other.id).first->second, other.id)
          << values.begin()->first;
      return other.id;
    });
  }
}

TEST(CellTest, AKeyThatACellDoesNotReadIsRefused) {
  const test::ScratchDirectory scratch;
  const std::string groups =
      "[[group]]\nname = \"td3\"\n[[group]]\nname = \"sac\"\nset = {learner.algorithm = "
      "\"sac\"}\n";
  EXPECT_EQ(test::Expand(scratch.path(), kPlan + groups, {"sweep.seeds=[1]"}).cells.size(), 2U);
  EXPECT_THAT(
      [&] { test::Expand(scratch.path(), "[set]\nlearner.temperature = 0.1\n" + kPlan + groups); },
      ThrowsMessage<base::Error>(
          AllOf(HasSubstr("td3, seed 1: learner.temperature is 0.1"), HasSubstr("\"sac\""))));
  EXPECT_THAT(
      [&] {
        test::Expand(scratch.path(), kPlan +
                                         "[[group]]\nname = \"dwa\"\nplanner = \"dwa\"\nset = "
                                         "{teb.robot.max_linear = 1.0}\n");
      },
      ThrowsMessage<base::Error>(HasSubstr("dwa does not read teb.robot.max_linear")));
}

TEST(CellTest, CoursesCountByWhatTheyAreNotByWhereTheyLie) {
  const test::ScratchDirectory scratch;
  const auto write = [&](const std::string& name, const std::string& content) {
    fs::create_directories((scratch.path() / name).parent_path());
    base::WriteFileAtomically(scratch.path() / name, content);
    return "courses.train=" + (scratch.path() / name).string();
  };
  const std::string text =
      base::ReadFile(fs::path(SLALOM_SOURCE_DIR) / "configs/courses/dynabarn-like.courses");
  const auto here = Ids(test::Expand(scratch.path(), kPlan, {write("a/x.courses", text)}));
  EXPECT_EQ(here, Ids(test::Expand(scratch.path(), kPlan, {write("b/x.courses", text)})));
  EXPECT_EQ(here, Ids(test::Expand(scratch.path(), kPlan, {write("b/renamed.courses", text)})));
}

TEST(CellTest, AScoreIsNamedByAllThatDecidesIt) {
  const test::ScratchDirectory scratch;
  const auto digest = [&](const std::string& more) {
    return test::Expand(scratch.path(), kPlan + more).cells[0].scores[0].digest;
  };
  const std::string base = digest("");
  EXPECT_EQ(digest("label = \"other\"\n"), base);
  EXPECT_EQ(digest("physics = \"slalom\"\n"), base);
  EXPECT_EQ(digest("set = {evaluation.num_environments = 3}\n"), base) << "changes the speed alone";
  std::set<std::string> different = {base};
  for (const std::string more :
       {"protocol = \"dwa-runs\"\n", "set = {evaluation.seed = 9}\n", "physics = \"ode\"\n",
        "physics = \"mujoco\"\n", "set = {environment.robot.command_delay = 0.04}\n"}) {
    EXPECT_TRUE(different.insert(digest(more)).second) << more;
  }
}

TEST(CellTest, SnapshotsAreScoredOnTheirOwnAsFarAsTheTrainingGoes) {
  const test::ScratchDirectory scratch;
  const Cells cells = test::Expand(scratch.path(), kPlan + "snapshots = true\n",
                                   {"run.snapshot_steps=[1000, 2000, 9000]"});
  const auto& scores = cells.cells[0].scores;
  ASSERT_EQ(scores.size(), 3U);
  EXPECT_EQ(scores[0].snapshot_steps, 0);
  EXPECT_EQ(scores[1].snapshot_steps, 1000);
  EXPECT_EQ(scores[2].snapshot_steps, 2000);
  EXPECT_NE(scores[1].digest, scores[2].digest);
}

TEST(CellTest, ABudgetOfUpdatesBecomesSteps) {
  const test::ScratchDirectory scratch;
  const Cells cells = test::Expand(scratch.path(), kPlan, {"budget.updates=100"});
  EXPECT_EQ(cells.cells[0].config->run.max_steps, 500 + 100 * 100);
}

TEST(CellTest, ABudgetOfUpdatesCountsWithWhatTheCommandLineSays) {
  const test::ScratchDirectory scratch;
  const Cells cells =
      test::Expand(scratch.path(), kPlan, {"budget.updates=100", "run.updates_per_step=0.1"});
  EXPECT_EQ(cells.cells[0].config->run.max_steps, 500 + 100 * 10);
}

TEST(CellTest, PrioritiesDecideTheResultWhereTheyAreUsed) {
  const test::ScratchDirectory scratch;
  const std::string exponent = "replay_server.priority_exponent=0.9";
  EXPECT_THROW((void)test::Expand(scratch.path(), kPlan, {exponent}), base::Error);
  const std::string used = "learner.prioritized=true";
  EXPECT_NE(Ids(test::Expand(scratch.path(), kPlan, {used})),
            Ids(test::Expand(scratch.path(), kPlan, {used, exponent})));
}

TEST(CellTest, AnOverrideMustNotUndoAnAxis) {
  const test::ScratchDirectory scratch;
  try {
    (void)test::Expand(scratch.path(),
                       kPlan + "[[axis]]\nkeys = [\"learner.tau\"]\nvalues = [0.1]\n",
                       {"learner.tau=0.2"});
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("--set learner.tau=0.2: the key is an axis"));
  }
}

}  // namespace
}  // namespace slalom::sweep
