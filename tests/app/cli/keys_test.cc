#include <gmock/gmock.h>

#include <filesystem>
#include <string>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

/// `slalom keys`: what it makes, and what it says of what is wrong.

namespace slalom::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class KeysCommandTest : public ::testing::Test {
 protected:
  ProgramResult Run(const std::string& verb, const std::string& directory) {
    return RunProgram({"keys", verb, directory}, scratch_.path());
  }

  const ScratchDirectory scratch_;
};

TEST_F(KeysCommandTest, NewKeysPassTheCheckAndNoSecretIsPrinted) {
  const ProgramResult made = Run("new", "keys");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const std::string secret = base::ReadFile(scratch_.path() / "keys/actor.key").substr(0, 40);
  const std::string public_key = base::ReadFile(scratch_.path() / "keys/actor.pub").substr(0, 40);
  const ProgramResult checked = Run("check", "keys");
  EXPECT_EQ(checked.exit_code, 0) << checked.err;
  EXPECT_THAT(checked.out, AllOf(HasSubstr("actor"), HasSubstr("operator"), HasSubstr(public_key),
                                 HasSubstr("5 keys may connect")));
  EXPECT_THAT(made.out + made.err + checked.out + checked.err, Not(HasSubstr(secret)));
}

TEST_F(KeysCommandTest, KeysInUseAreNotReplaced) {
  ASSERT_EQ(Run("new", "keys").exit_code, 0);
  const std::string secret = base::ReadFile(scratch_.path() / "keys/replay.key");
  const ProgramResult again = Run("new", "keys");
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, AllOf(HasSubstr("keys/replay.key"), HasSubstr("exists already")));
  EXPECT_EQ(base::ReadFile(scratch_.path() / "keys/replay.key"), secret);
}

TEST_F(KeysCommandTest, EveryFaultIsNamedAndTheCheckFails) {
  ASSERT_EQ(Run("new", "keys").exit_code, 0);
  std::filesystem::permissions(scratch_.path() / "keys/actor.key",
                               std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  base::WriteFileAtomically(scratch_.path() / "keys/learner.pub", "nonsense");
  const ProgramResult checked = Run("check", "keys");
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.err,
              AllOf(HasSubstr("2 things are wrong"), HasSubstr("keys/actor.key"),
                    HasSubstr("chmod 600"), HasSubstr("keys/learner.pub"), HasSubstr("40 char")));
}

TEST_F(KeysCommandTest, WhatIsNoDirectoryOfKeysIsNamed) {
  const ProgramResult none = Run("check", "none");
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("none: is not a directory"));
  base::WriteFileAtomically(scratch_.path() / "file", "");
  const ProgramResult file = Run("new", "file");
  EXPECT_EQ(file.exit_code, 1);
  EXPECT_THAT(file.err, HasSubstr("file"));
  EXPECT_THAT(file.err, Not(HasSubstr("terminate called")));
  EXPECT_EQ(RunProgram({"keys"}, scratch_.path()).exit_code, 2);
}

}  // namespace
}  // namespace slalom::test
