#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/sim/courses/barn_data.h"
#include "tests/support/scratch_directory.h"

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

/// Needs the published worlds, on which the paper's tables are made.
using PaperTablesTest = sim::PublishedWorlds;

TEST_F(PaperTablesTest, PagesShowWhatTheCommittedResultsGive) {
  const ScratchDirectory scratch;
  const fs::path source = SLALOM_SOURCE_DIR;
  fs::create_directory_symlink(source / "configs", scratch.path() / "configs");
  base::MakeDirectories(scratch.path() / "worlds");
  const ProgramResult import = RunShell(
      fmt::format("tar -xJf {0}/barn_worlds.tar.xz -C worlds && $SLALOM courses import worlds "
                  "--motions {0} --output barn",
                  directory().string()),
      scratch.path());
  ASSERT_EQ(import.exit_code, 0) << import.err;
  const fs::path pages = source / "docs/results/paper";
  const std::vector<std::string> names = {"README", "tables", "figures"};
  std::vector<std::string> command = {
      "sweep",    "report", "configs/sweeps/paper.toml", "--set", "courses.collection=barn",
      "--output", "store"};
  for (const std::string& name : names) {
    fs::copy_file(pages / (name + ".md"), scratch.path() / (name + ".markdown"));
    command.insert(command.end(), {"--into", name + ".markdown"});
  }
  const ProgramResult report = RunProgram(command, scratch.path());
  ASSERT_EQ(report.exit_code, 0) << report.err;
  for (const std::string& name : names) {
    EXPECT_EQ(base::ReadFile(scratch.path() / (name + ".markdown")),
              base::ReadFile(pages / (name + ".md")))
        << "docs/results/paper/README.md has the command that fills the tables";
  }
}

}  // namespace
}  // namespace slalom::test
