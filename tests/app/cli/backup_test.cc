#include <gmock/gmock.h>

#include <cerrno>
#include <filesystem>
#include <string>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

/// `slalom backup` of a state that stands still.

namespace slalom::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class BackupTest : public testing::Test {
 protected:
  BackupTest() {
    for (const char* file : {"actors/a/ledger", "actors/b/ledger", "evaluators/e/scores.csv",
                             "replay/journal-00000001.log", "learner/config.toml"}) {
      Write(directory() / "state" / file);
    }
    Write(directory() / "big/step-1/state");
  }

  static void Write(const fs::path& file) {
    fs::create_directories(file.parent_path());
    base::WriteFileAtomically(file, file.filename().string());
  }
  ProgramResult BackUp(const std::string& target) const {
    return RunProgram({"backup", "state", target}, directory());
  }
  /// Backing up to `target` fails with `error`, and nothing is written.
  void ExpectRefused(const std::string& target, const std::string& error) const {
    const ProgramResult result = BackUp(target);
    EXPECT_EQ(result.exit_code, 1) << target;
    EXPECT_THAT(result.err, HasSubstr(error));
    EXPECT_FALSE(fs::exists(directory() / target)) << target;
    EXPECT_FALSE(fs::exists(directory() / (target + ".unfinished"))) << target;
  }
  const fs::path& directory() const { return scratch_.path(); }

 private:
  ScratchDirectory scratch_;
};

TEST_F(BackupTest, LinksAreFollowed) {
  fs::create_directory_symlink(directory() / "big", directory() / "state/learner/checkpoints");
  fs::create_symlink(directory() / "big/step-1/state", directory() / "state/evaluators/e/best");
  const ProgramResult result = BackUp("copy/");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("7 files"));
  for (const char* file : {"learner/checkpoints/step-1/state", "evaluators/e/best"}) {
    const fs::path copied = directory() / "copy" / file;
    EXPECT_EQ(base::ReadFile(copied), "state");
    EXPECT_FALSE(fs::is_symlink(copied));
  }
}

TEST_F(BackupTest, WhatCannotBeCopiedIsRefusedBeforeTheFirstByte) {
  ExpectRefused("state/copy", "lies within state");
  ExpectRefused("state/replay/deep/copy", "lies within state");
  const fs::path link = directory() / "state/learner/checkpoints";
  fs::create_directory_symlink(directory() / "big", link);
  ExpectRefused("big/copy", "lies within state/learner/checkpoints");
  fs::remove(link);
  fs::create_directory_symlink(directory() / "gone", link);
  ExpectRefused("copy", "checkpoints: is a symbolic link to " + (directory() / "gone").string());
  fs::remove(link);
  fs::create_directory_symlink("..", link);
  ExpectRefused("copy", "checkpoints: is a symbolic link to");
}

TEST_F(BackupTest, TheReplayServerIsFirst) {
  const FailingCalls failing({.function = "open", .path = "state/*", .error = EIO},
                             directory() / "calls", SLALOM_FAILING_LIBC);
  const ProgramResult result = BackUp("copy");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("state/replay/journal-00000001.log: cannot open"));
}

}  // namespace
}  // namespace slalom::test
