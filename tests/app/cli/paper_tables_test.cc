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
  const std::pair<fs::path, fs::path> pages[] = {
      {source / "README.md", "README.md"},
      {source / "docs/results/paper/README.md", "paper.markdown"}};
  for (const auto& [page, copy] : pages) fs::copy_file(page, scratch.path() / copy);
  const ProgramResult report = RunProgram(
      {"sweep", "report", "configs/sweeps/paper.toml", "--set", "courses.collection=barn",
       "--output", "store", "--into", "README.md", "--into", "paper.markdown"},
      scratch.path());
  ASSERT_EQ(report.exit_code, 0) << report.err;
  for (const auto& [page, copy] : pages) {
    EXPECT_EQ(base::ReadFile(scratch.path() / copy), base::ReadFile(page))
        << page.string() << ": docs/results/paper/README.md has the command that fills its tables";
  }
}

}  // namespace
}  // namespace slalom::test
