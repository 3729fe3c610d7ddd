#include "learner/run/run_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::run {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

TEST(RunDirectoryTest, ListsSnapshotsInTheOrderOfTheirSteps) {
  const test::ScratchDirectory scratch;
  const RunDirectory run{scratch.path()};
  EXPECT_THAT(run.ListSnapshots(), IsEmpty());
  base::MakeDirectories(run.snapshots());
  for (const std::int64_t steps : {20'000, 3'000, 100'000'000}) {
    base::WriteFileAtomically(run.snapshot(steps), "");
  }
  base::WriteFileAtomically(run.snapshots() / "step-1.txt", "");
  EXPECT_THAT(run.ListSnapshots(),
              ElementsAre(run.snapshot(3'000), run.snapshot(20'000), run.snapshot(100'000'000)));
}

TEST(RunDirectoryTest, SnapshotsThatCannotBeListedAreAnError) {
  const test::ScratchDirectory scratch;
  const RunDirectory run{scratch.path()};
  base::MakeDirectories(run.snapshots());
  const test::FailingCalls failing({.function = "openat", .path = "*/snapshots", .error = EMFILE},
                                   scratch.path() / "count");
  EXPECT_THAT([&] { (void)run.ListSnapshots(); },
              ThrowsMessage<base::Error>(
                  AllOf(HasSubstr(run.snapshots().string()), HasSubstr("Too many open files"))));
}

}  // namespace
}  // namespace slalom::run
