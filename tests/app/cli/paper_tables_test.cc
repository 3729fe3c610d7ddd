#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/sim/courses/barn_data.h"
#include "tests/support/scratch_directory.h"

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

/// Needs the published worlds, on which the paper's tables are made.
using PaperTablesTest = sim::PublishedWorlds;

TEST_F(PaperTablesTest, PageShowsWhatTheCommittedResultsGive) {
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
  const fs::path page = source / "docs/results/paper/README.md";
  const fs::path copy = scratch.path() / "paper.markdown";
  fs::copy_file(page, copy);
  const ProgramResult report =
      RunProgram({"sweep", "report", "configs/sweeps/paper.toml", "--set",
                  "courses.collection=barn", "--output", "store", "--into", "paper.markdown"},
                 scratch.path());
  ASSERT_EQ(report.exit_code, 0) << report.err;
  EXPECT_EQ(base::ReadFile(copy), base::ReadFile(page))
      << page.string() << " has the command that fills its tables";
}

}  // namespace
}  // namespace slalom::test
