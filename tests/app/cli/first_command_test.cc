#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "base/file.h"
#include "policy/policy.h"
#include "tests/app/cli/program.h"
#include "tests/support/scratch_directory.h"

/// What a newcomer does first: the script `slalom` in a fresh clone, which installs and builds
/// before it starts the program. Its tools are stubs here, of which one is slow.

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

void WriteScript(const fs::path& path, const std::string& body) {
  base::WriteFileAtomically(path, "#!/bin/bash\n" + body);
  fs::permissions(path, fs::perms::owner_all);
}

/// A clone with the script, this program as what the build makes, and `bin/` with the stubs.
void MakeClone(const fs::path& clone) {
  fs::create_directories(clone / "bin");
  fs::create_directories(clone / "build/release/cli");
  fs::copy_file(fs::path(SLALOM_SOURCE_DIR) / "slalom", clone / "slalom");
  fs::create_symlink(SLALOM_PROGRAM, clone / "build/release/cli/slalom");
  base::WriteFileAtomically(clone / "build/release/build.ninja", "");
  // Every package that is asked for is there: its name is any argument that is no option.
  WriteScript(clone / "bin/dpkg-query",
              "for name; do [[ $name == -* ]] || printf 'ii  %s\\n' \"$name\"; done\n");
  WriteScript(clone / "bin/apt-get", "exit 0\n");
  WriteScript(clone / "bin/cmake", R"([[ $1 == --build ]] && sleep 3
touch "$(dirname "$0")/../cmake-ran"
)");
}

TEST(FirstCommandTest, ASlowBuildTakesNothingFromTheTraining) {
  const ScratchDirectory scratch;
  // A path that a shell would split, if what is printed were not quoted.
  const fs::path clone = scratch.path() / "my clone";
  MakeClone(clone);
  WriteTinyConfig(clone, 100000000, "max_seconds = 2.0\n");
  const std::string command =
      "PATH=\"$PWD/bin:$PATH\" ./slalom train tiny.toml --set run.deterministic=false "
      "--set run.learning_starts=64 --no-evaluation";
  const ProgramResult result = RunShell(command, clone);
  EXPECT_TRUE(fs::exists(clone / "cmake-ran")) << "the script does not build as this test thinks";
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto policy = policy::LoadPolicy(clone / "runs/tiny/policy.safetensors");
  const double training_s = std::stod(policy.metadata.at("training_s"));
  EXPECT_GE(training_s, 2.0);
  EXPECT_GT(std::stoll(policy.metadata.at("updates")), 0);
  // A run that the build had shortened would have reached its limit within the first row.
  const std::string metrics = base::ReadFile(clone / "runs/tiny/metrics.csv");
  EXPECT_GT(std::count(metrics.begin(), metrics.end(), '\n'), 3);
}

// The stub builds until the other command says that it waits, or builds, too.
TEST(FirstCommandTest, CommandsThatStartAtOnceBuildOneAfterTheOther) {
  const ScratchDirectory scratch;
  const fs::path clone = scratch.path();
  MakeClone(clone);
  WriteScript(clone / "bin/cmake", R"(cd "$(dirname "$0")/.."
mkdir building 2>/dev/null || touch clash
until [[ -e clash ]] || grep -q 'waiting for another' first.err second.err; do sleep 0.05; done
rmdir building
)");
  const ProgramResult result = RunShell(
      "export PATH=\"$PWD/bin:$PATH\"; touch first.err second.err; "
      "./slalom --version 2>first.err & ./slalom --version 2>second.err && wait $!",
      clone);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_FALSE(fs::exists(clone / "clash")) << "two builds ran at once";
  EXPECT_EQ(std::count(result.out.begin(), result.out.end(), '\n'), 2) << result.out;
}

// Root may write anywhere, so it asks as another user.
TEST(FirstCommandTest, SomebodyElsesCheckoutIsUsedAsItIs) {
  const ScratchDirectory scratch;
  const fs::path clone = scratch.path();
  MakeClone(clone);
  const fs::path program = clone / "build/release/cli/slalom";
  const fs::perms all_may_read = fs::perms::owner_all | fs::perms::group_read |
                                 fs::perms::group_exec | fs::perms::others_read |
                                 fs::perms::others_exec;
  fs::remove(program);
  WriteScript(program, "echo the program with \"$@\"\n");
  fs::permissions(program, all_may_read);
  fs::permissions(clone, all_may_read);
  const auto run = [&] {
    return RunShell(
        "chmod a-w build; [ $(id -u) != 0 ] || other='setpriv --reuid=65534 --clear-groups'\n"
        "$other ./slalom config print; code=$?; chmod u+w build; exit $code",
        clone);
  };
  EXPECT_EQ(run().out, "the program with config print\n");
  EXPECT_FALSE(fs::exists(clone / "cmake-ran"));
  fs::remove(program);
  const ProgramResult missing = run();
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.err, testing::HasSubstr("is not yours to build in, and has no program yet"));
}

}  // namespace
}  // namespace slalom::test
