#include "sim/engines/physics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

/// `slalom evaluate --physics`, as a user calls it.

namespace slalom::test {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

class PhysicsTest : public ::testing::Test {
 protected:
  ProgramResult Evaluate(std::vector<std::string> more) const {
    more.insert(more.begin(), {"evaluate", "--agent", "dwa", "--courses", "generated:1:2",
                               "--episodes", "1", "--set", "evaluation.time_limit=4"});
    return RunProgram(more, scratch_.path());
  }

  void ExpectError(const std::vector<std::string>& more,
                   const ::testing::Matcher<std::string>& message) const {
    const ProgramResult result = Evaluate(more);
    EXPECT_EQ(result.exit_code, 1) << result.err;
    EXPECT_THAT(result.err, message);
  }

  bool Exists(const std::string& path) const {
    return std::filesystem::exists(scratch_.path() / path);
  }

  const ScratchDirectory scratch_;
};

/// Why the engines cannot be tested here; empty: they can.
std::string ReasonToSkip() {
  for (const engines::PhysicsInfo& info : engines::KnownPhysics()) {
    if (!info.is_built_in) {
      return std::string(info.package) + " was not installed when this was built";
    }
  }
  return "";
}

TEST_F(PhysicsTest, BadInputIsRefused) {
  ExpectError({"--physics", "bullet"},
              AllOf(HasSubstr("--physics 'bullet'"), HasSubstr("slalom, ode, mujoco")));
  ExpectError({"--physics", "slalom,slalom"}, HasSubstr("names slalom twice"));
  for (const engines::PhysicsInfo& info : engines::KnownPhysics()) {
    if (info.package.empty()) continue;
    const std::string name(info.name);
    if (!info.is_built_in) {
      ExpectError({"--physics", name, "--output", "all"},
                  HasSubstr("apt-get install " + std::string(info.package)));
      EXPECT_FALSE(Exists("all"));
      continue;
    }
    ExpectError({"--physics", name, "--set", "environment.robot.drive=ideal"},
                AllOf(HasSubstr("environment.robot.drive"), HasSubstr("physics " + name)));
    // Before anything was driven in another physics.
    ExpectError({"--physics", "slalom," + name, "--output", "refused", "--set",
                 "environment.robot.drive=ideal"},
                HasSubstr("physics " + name));
    EXPECT_FALSE(Exists("refused/slalom"));
    ExpectError({"--physics", name, "--set", "environment.robot.mass=1"},
                AllOf(HasSubstr("environment.robot.mass is 1 kg"), HasSubstr("physics " + name)));
  }
}

TEST_F(PhysicsTest, OnlySlalomsOwnIsAsWithoutTheOption) {
  const ProgramResult plain = Evaluate({"--json"});
  const ProgramResult named = Evaluate({"--json", "--physics", "slalom"});
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  EXPECT_EQ(plain.out, named.out);
  EXPECT_EQ(json::parse(plain.out)["physics"]["name"], "slalom");
}

TEST_F(PhysicsTest, SeveralAreComparedInTheSameEpisodes) {
  if (const std::string reason = ReasonToSkip(); !reason.empty()) GTEST_SKIP() << reason;
  const ProgramResult result = Evaluate({"--physics", "all", "--output", "all"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("| dwa in ode | – | 2 |"), HasSubstr("| dwa | dwa in ode |"),
                    HasSubstr("Physics: slalom, ode ")));
  EXPECT_THAT(result.out, HasSubstr(base::ReadFile(scratch_.path() / "all/physics.md")));
  for (const char* name : {"slalom", "ode", "mujoco"}) {
    const auto directory = scratch_.path() / "all" / name;
    const json object = json::parse(base::ReadFile(directory / "evaluation.json"));
    EXPECT_EQ(object["physics"]["name"], name);
    EXPECT_EQ(object["run"]["seed"], 1);
    EXPECT_TRUE(Exists(std::string("all/") + name + "/evaluation-tracks.jsonl"));
  }
  // `slalom report` tells them apart, and they are no seeds of one agent.
  const ProgramResult report =
      RunProgram({"report", "all/slalom", "all/ode", "--output", "report"}, scratch_.path());
  EXPECT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(base::ReadFile(scratch_.path() / "report/report.md"), HasSubstr("dwa in ode"));
  const ProgramResult mixed =
      RunProgram({"report", "--agent", "dwa", "all/slalom", "all/ode"}, scratch_.path());
  EXPECT_EQ(mixed.exit_code, 1);
  EXPECT_THAT(mixed.err, AllOf(HasSubstr("agent dwa"), HasSubstr("physics slalom and ode")));
  const ProgramResult both = Evaluate({"--physics", "slalom,ode", "--json"});
  const json object = json::parse(both.out);
  EXPECT_EQ(object["evaluations"][1]["physics"]["name"], "ode");
  EXPECT_EQ(object["comparison"]["pairs"].size(), 1u);
  EXPECT_EQ(object["comparison"]["agents"][1]["label"], "dwa in ode");
  // Its own output is replaced if told so.
  EXPECT_EQ(Evaluate({"--physics", "slalom,ode", "--output", "all"}).exit_code, 1);
  EXPECT_EQ(Evaluate({"--physics", "slalom,ode", "--output", "all", "--force"}).exit_code, 0);
}

}  // namespace
}  // namespace slalom::test
