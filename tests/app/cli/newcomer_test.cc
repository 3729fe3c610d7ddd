#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

/// What a newcomer does without knowing better: mistyped words, files for another purpose, scores
/// on courses that were trained on.

namespace slalom::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class NewcomerTest : public ::testing::Test {
 protected:
  NewcomerTest() { WriteTinyConfig(scratch_.path(), 1500); }

  ProgramResult Run(const std::vector<std::string>& arguments) {
    return RunProgram(arguments, scratch_.path());
  }

  /// One short episode of dwa or of the policy, which `Train` made.
  ProgramResult Evaluate(const std::string& driver, const std::string& courses,
                         const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {
        "evaluate", "--episodes", "1", "--set", "evaluation.time_limit=1", "--courses", courses};
    if (driver == "dwa") {
      arguments.insert(arguments.end(), {"--agent", "dwa"});
    } else {
      arguments.insert(arguments.end(), {"--policy", driver});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }

  void Train() {
    const ProgramResult result = Run({"train", "tiny.toml", "--no-evaluation"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  static constexpr char kPolicy[] = "runs/tiny/policy.safetensors";
  ScratchDirectory scratch_;
};

TEST_F(NewcomerTest, MistypedWordsGetASuggestion) {
  const auto expect = [&](const std::vector<std::string>& arguments, const char* message,
                          int exit_code) {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code);
    EXPECT_THAT(result.err, HasSubstr(message));
  };
  expect({"trian", "tiny.toml"}, "no command 'slalom trian'; did you mean 'train'?", 2);
  expect({"courses", "rendr"}, "no command 'slalom courses rendr'; did you mean 'render'?", 2);
  expect({"fly"}, "no command 'slalom fly'; slalom --help lists them", 2);
  expect({"evaluate", "--agent", "dwa", "--corses=static-test"},
         "slalom: no option '--corses' of 'slalom evaluate'; did you mean '--courses'?\n", 2);
  expect({"evaluate", "--polcy", "p", "--courses", "c"}, "did you mean '--policy'?", 2);
  expect({"train", "tini.toml"}, "tini.toml: there is no such file; did you mean 'tiny.toml'?", 1);
  expect({"train", "tiny.toml", "--set", "courses.train=static-trian-50"},
         "courses.train: \"static-trian-50\" is neither a course set nor a file; did you mean "
         "'static-train-50'?",
         1);
  expect({"train", "tiny.toml", "--set", "courses.test=static-tset"},
         "courses.test: \"static-tset\" is neither", 1);
}

TEST_F(NewcomerTest, AnOptionOfTheCommandIsNotCalledUnknown) {
  const ProgramResult result = Run({"evaluate", "--agent", "dwa", "--corses", "static-test"});
  EXPECT_THAT(result.err, Not(HasSubstr("'--agent'")));
}

TEST_F(NewcomerTest, ScoresOnTrainingCoursesAreCalledThat) {
  const ProgramResult trained = Run({"train", "tiny.toml", "--set", "courses.test=static-train-10",
                                     "--set", "evaluation.time_limit=1"});
  ASSERT_EQ(trained.exit_code, 0) << trained.err;
  constexpr char kWarning[] =
      "5 of the 10 courses are among those that the policy was trained on (static-train-5)";
  EXPECT_THAT(trained.err,
              HasSubstr(std::string("policies will be scored on static-train-10: ") + kWarning));
  EXPECT_THAT(trained.out, HasSubstr(kWarning));
  const auto overlap_in = [](const std::string& text) {
    return nlohmann::json::parse(text).at("provenance").at("training_overlap");
  };
  const nlohmann::json expected = {{"courses", 5}, {"of", 10}, {"trained_on", "static-train-5"}};
  EXPECT_EQ(overlap_in(base::ReadFile(scratch_.path() / "runs/tiny/evaluation.json")), expected);

  const ProgramResult scored = Evaluate(kPolicy, "static-train-10");
  EXPECT_THAT(scored.err, HasSubstr(kWarning));
  EXPECT_THAT(scored.out, HasSubstr(kWarning));
  // By content: the same courses under another name, and with another collection's start.
  ASSERT_EQ(Run({"courses", "generate", "--courses", "static-train-10", "--output", "mine.courses"})
                .exit_code,
            0);
  EXPECT_EQ(overlap_in(Evaluate(kPolicy, "mine.courses", {"--json"}).out), expected);
  EXPECT_EQ(
      overlap_in(Evaluate(kPolicy, "mine.courses", {"--json", "--protocol", "barn-challenge"}).out),
      expected);
  // The policy's own courses count, not those of a config that is given in their place.
  base::WriteFileAtomically(scratch_.path() / "other.toml",
                            "base = \"tiny.toml\"\n[courses]\ntrain = \"generated:9:3\"\n");
  EXPECT_EQ(
      overlap_in(Evaluate(kPolicy, "static-train-10", {"--json", "--config", "other.toml"}).out),
      expected);

  const ProgramResult fresh = Evaluate(kPolicy, "generated:3:2", {"--json"});
  EXPECT_THAT(fresh.err, Not(HasSubstr("warning")));
  EXPECT_EQ(overlap_in(fresh.out),
            (nlohmann::json{{"courses", 0}, {"of", 2}, {"trained_on", "static-train-5"}}));
  EXPECT_TRUE(overlap_in(Evaluate("dwa", "generated:3:2", {"--json"}).out).is_null());
}

TEST_F(NewcomerTest, ATrainingSetThatIsGoneIsSaid) {
  ASSERT_EQ(Run({"courses", "generate", "--courses", "generated:5:2", "--output", "mine.courses"})
                .exit_code,
            0);
  ASSERT_EQ(Run({"train", "tiny.toml", "--no-evaluation", "--set", "courses.train=mine.courses"})
                .exit_code,
            0);
  std::filesystem::remove(scratch_.path() / "mine.courses");
  // The run has a copy of it, which a policy alone has not.
  EXPECT_THAT(Evaluate(kPolicy, "generated:5:2").err, HasSubstr("2 of the 2 courses are among"));
  std::filesystem::copy(scratch_.path() / kPolicy, scratch_.path() / "alone.safetensors");
  const ProgramResult result = Evaluate("alone.safetensors", "generated:3:2");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, AllOf(HasSubstr("trained on these courses: courses.train"),
                                HasSubstr("mine.courses")));
}

TEST_F(NewcomerTest, APlannerAndAPolicyShareATaskFile) {
  Train();
  base::WriteFileAtomically(scratch_.path() / "task.toml",
                            "base = \"tiny.toml\"\n[environment.robot]\nmass = 40.0\n[navigation]\n"
                            "planner_rate = 4.0\n");
  for (const std::string driver : {"dwa", kPolicy}) {
    for (const std::string option : {"--config", "--profile"}) {
      const ProgramResult result =
          Evaluate(driver, "generated:3:1", {option, "task.toml", "--json"});
      ASSERT_EQ(result.exit_code, 0) << driver << " " << option << ": " << result.err;
      EXPECT_THAT(result.out, HasSubstr("mass = 40.0"));
      EXPECT_THAT(result.err, HasSubstr("info task.toml: ")) << "what is passed over is said";
    }
  }
  EXPECT_THAT(Evaluate("dwa", "generated:3:1", {"--config", "runs/tiny/config.toml"}).err,
              AllOf(HasSubstr("a planner does not read"), HasSubstr("courses.train")));
  EXPECT_EQ(Run({"config", "print", "task.toml", "--agent"}).exit_code, 0);
  // What does nothing is still refused where it is asked for.
  EXPECT_THAT(Evaluate("dwa", "generated:3:1", {"--set", "learner.gamma=0.9"}).err,
              HasSubstr("--set learner.gamma=0.9: a planner does not read this key"));
  EXPECT_THAT(Evaluate(kPolicy, "generated:3:1", {"--set", "navigation.planner_rate=4"}).err,
              HasSubstr("a policy does not read this key"));
  // And what no program reads, everywhere.
  base::WriteFileAtomically(scratch_.path() / "typo.toml", "[learner]\ngama = 0.9\n");
  for (const std::string option : {"--config", "--profile"}) {
    EXPECT_THAT(Evaluate("dwa", "generated:3:1", {option, "typo.toml"}).err,
                AllOf(HasSubstr("typo.toml:2"), HasSubstr("did you mean 'learner.gamma'?")));
  }
}

TEST_F(NewcomerTest, ARunInThePlaceOfItsPolicyIsPointedOut) {
  Train();
  const ProgramResult result = Evaluate("runs/tiny", "generated:3:1");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("did you mean 'runs/tiny/policy.safetensors'?"));
}

TEST_F(NewcomerTest, ACollectionThatIsNotThereIsSaidThoughNoSetOfItIsAskedFor) {
  const ProgramResult result = Evaluate("dwa", "generated:3:1", {"--collection", "none"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("--collection none: is not a directory"));
  EXPECT_EQ(Evaluate("dwa", "generated:3:1", {"--collection", ""}).exit_code, 2);
}

TEST_F(NewcomerTest, AnotherFieldOfViewThanThePolicysIsRefused) {
  Train();
  const auto expect_refused = [&](const std::vector<std::string>& more) {
    const ProgramResult result = Evaluate(kPolicy, "generated:3:1", more);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err,
                AllOf(HasSubstr(kPolicy), HasSubstr("environment.lidar.field_of_view is 3 rad"),
                      HasSubstr("expected 4.71238")));
  };
  expect_refused({"--set", "environment.lidar.field_of_view=3.0"});
  base::WriteFileAtomically(scratch_.path() / "sensor.toml",
                            "[environment.lidar]\nfield_of_view = 3.0\n");
  expect_refused({"--profile", "sensor.toml"});
  base::WriteFileAtomically(scratch_.path() / "task.toml",
                            "base = \"tiny.toml\"\n[environment.lidar]\nfield_of_view = 3.0\n");
  expect_refused({"--config", "task.toml"});
  EXPECT_EQ(Evaluate("dwa", "generated:3:1", {"--profile", "sensor.toml"}).exit_code, 0);
}

}  // namespace
}  // namespace slalom::test
