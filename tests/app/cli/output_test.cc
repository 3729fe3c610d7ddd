#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

/// What `--output` may replace: nothing, unless told to.

namespace slalom::test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class OutputTest : public ::testing::Test {
 protected:
  ProgramResult Run(const std::vector<std::string>& arguments) {
    return RunProgram(arguments, scratch_.path());
  }

  /// Runs the command, which must refuse and leave the file as it is.
  void ExpectRefused(const std::vector<std::string>& arguments, const std::string& file,
                     const std::string& named) {
    Write(file, "precious");
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 1) << arguments[0];
    EXPECT_THAT(result.err, AllOf(HasSubstr(named), HasSubstr("--force")));
    EXPECT_EQ(Read(file), "precious");
  }

  void Write(const std::string& name, const std::string& content) {
    base::MakeDirectories((scratch_.path() / name).parent_path());
    base::WriteFileAtomically(scratch_.path() / name, content);
  }
  std::string Read(const std::string& name) { return base::ReadFile(scratch_.path() / name); }

  static std::vector<std::string> Evaluate(const std::string& output) {
    return {"evaluate",  "--agent",       "dwa",
            "--courses", "generated:1:1", "--episodes",
            "1",         "--set",         "evaluation.time_limit=1",
            "--output",  output};
  }

  ScratchDirectory scratch_;
};

TEST_F(OutputTest, AFileThatIsThereIsReplacedWithForceAlone) {
  std::vector<std::string> render = {"courses",  "render", "--courses", "real-world-1",
                                     "--format", "svg",    "--output",  "policy.safetensors"};
  ExpectRefused(render, "policy.safetensors", "policy.safetensors: exists already");
  render.push_back("--force");
  EXPECT_EQ(Run(render).exit_code, 0);
  EXPECT_THAT(Read("policy.safetensors"), HasSubstr("</svg>"));

  std::vector<std::string> generate = {"courses",       "generate", "--courses",
                                       "generated:1:1", "--output", "mine.courses"};
  ExpectRefused(generate, "mine.courses", "mine.courses: exists already");
  generate.push_back("--force");
  EXPECT_EQ(Run(generate).exit_code, 0);
  EXPECT_THAT(Read("mine.courses"), StartsWith("slalom-courses 1"));
}

TEST_F(OutputTest, WhatIsNoFileIsWrittenTo) {
  // Through links, so that a mistake costs the link and not the machine's device.
  fs::create_symlink("/dev/stdout", scratch_.path() / "stdout");
  fs::create_symlink("/dev/full", scratch_.path() / "full");
  const ProgramResult shown =
      Run({"courses", "generate", "--courses", "generated:1:1", "--output", "stdout"});
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_THAT(shown.out, AllOf(StartsWith("slalom-courses 1"), HasSubstr("\nchecksum ")));
  EXPECT_TRUE(fs::is_symlink(scratch_.path() / "stdout"));
  const ProgramResult full =
      Run({"courses", "generate", "--courses", "generated:1:1", "--output", "full"});
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.err, AllOf(HasSubstr("full: cannot write"), HasSubstr("No space left")));
  EXPECT_TRUE(fs::is_symlink(scratch_.path() / "full"));
}

TEST_F(OutputTest, WhereNothingCanBeWrittenIsSaidBeforeTheWork) {
  const auto error = [&](const std::string& output) {
    const ProgramResult result =
        Run({"courses", "generate", "--courses", "generated:1:1", "--output", output});
    EXPECT_EQ(result.exit_code, 1);
    return result.err;
  };
  EXPECT_THAT(error("none/x.courses"), HasSubstr("none/x.courses: there is no directory none"));
  EXPECT_THAT(error("."), HasSubstr(".: is a directory, expected a file"));
  EXPECT_THAT(error("-"), HasSubstr("/dev/stdout"));
  EXPECT_FALSE(fs::exists(scratch_.path() / "-"));
  // Of a set that would take minutes.
  Write("file", "precious");
  for (const std::string output : {"file", "file/deeper"}) {
    auto evaluate = Evaluate(output);
    evaluate[4] = "generated:1:100000";
    const ProgramResult result = Run(evaluate);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr("is not a directory, expected one"));
  }
  EXPECT_EQ(Read("file"), "precious");
}

TEST_F(OutputTest, ADirectoryWithFilesIsWrittenToWithForceAlone) {
  ExpectRefused(Evaluate("runs/x"), "runs/x/config.toml", "runs/x: holds config.toml already");
  EXPECT_EQ(Run(Evaluate("scored/dwa")).exit_code, 0);
  const std::string scores = Read("scored/dwa/evaluation.json");
  EXPECT_THAT(Run(Evaluate("scored/dwa")).err, HasSubstr("scored/dwa: holds courses.png already"));
  auto forced = Evaluate("scored/dwa");
  forced.insert(forced.end(), {"--force", "--name", "other"});
  EXPECT_EQ(Run(forced).exit_code, 0);
  EXPECT_NE(Read("scored/dwa/evaluation.json"), scores);

  std::vector<std::string> report = {"report", "scored/dwa", "--output", "scored"};
  EXPECT_EQ(Run(report).exit_code, 0) << "directories in it cannot be replaced";
  EXPECT_THAT(Run(report).err, HasSubstr("scored: holds report-pairs.csv already"));
  report.push_back("--force");
  EXPECT_EQ(Run(report).exit_code, 0);
  base::MakeDirectories(scratch_.path() / "links");
  fs::create_symlink("nowhere", scratch_.path() / "links/dangling");
  EXPECT_THAT(Run({"report", "scored/dwa", "--output", "links"}).err,
              HasSubstr("links: holds dangling already"));
}

TEST_F(OutputTest, ARunIsMovedAsideWithForceAlone) {
  Write("tiny.toml",
        "[run]\nmax_steps = 200\nmax_seconds = 0.0\nlearning_starts = 100\n"
        "[courses]\ntrain = \"generated:1:2\"\ntest = \"\"\n[actor]\nnum_environments = 2\n");
  std::vector<std::string> train = {"train", "tiny.toml", "--name", "x"};
  EXPECT_EQ(Run(train).exit_code, 0);
  const std::string policy = Read("runs/x/policy.safetensors");
  EXPECT_THAT(Run(train).err, AllOf(HasSubstr("runs/x: holds a run already"),
                                    HasSubstr("slalom train runs/x --resume")));
  EXPECT_EQ(Read("runs/x/policy.safetensors"), policy);
  train.insert(train.end(), {"--force", "--seed", "2"});
  EXPECT_EQ(Run(train).exit_code, 0);
  EXPECT_EQ(Read("runs/x.1/policy.safetensors"), policy);
  EXPECT_NE(Read("runs/x/policy.safetensors"), policy);
}

TEST_F(OutputTest, ACollectionIsImportedAgainWithForceAlone) {
  Write("data/dynamic_wall.csv",
        "world,object,size_x,size_y,x0,y0,x1,y1,yaw,period_s\n"
        "400,right,0.1,4,0,7.25,-4.5,7.25,0.1,4.25\n");
  Write("data/dynamic_wall_fixed.csv", "x,y\n-4.425,0.075\n");
  std::vector<std::string> import = {"courses",  "import", "data",
                                     "--output", "barn",   "--incomplete"};
  EXPECT_EQ(Run(import).exit_code, 0);
  EXPECT_THAT(Run(import).err, HasSubstr("barn: holds dynamic-wall-1-of-100.courses already"));
  import.push_back("--force");
  EXPECT_EQ(Run(import).exit_code, 0);
}

TEST_F(OutputTest, AFullDiskBehindStandardOutputIsAnError) {
  for (const char* command : {"courses list", "config print", "--version", "evaluate --help"}) {
    const ProgramResult result =
        RunShell(std::string("$SLALOM ") + command + " > /dev/full", scratch_.path());
    EXPECT_EQ(result.exit_code, 1) << command;
    EXPECT_THAT(result.err, HasSubstr("No space left on device")) << command;
  }
}

}  // namespace
}  // namespace slalom::test
