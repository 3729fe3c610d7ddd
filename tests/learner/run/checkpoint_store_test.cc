#include "learner/run/checkpoint_store.h"

#include <gmock/gmock.h>

#include <cerrno>
#include <functional>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::run {
namespace {

namespace fs = std::filesystem;

void WriteOne(CheckpointStore& store, std::int64_t steps, const std::string& content = "x") {
  store.Write(steps, [&](const fs::path& directory) {
    base::WriteFileAtomically(directory / "a", content);
  });
}

TEST(CheckpointStoreTest, KeepsTheNewestByStepsNotByName) {
  const test::ScratchDirectory scratch;
  CheckpointStore store(scratch.path() / "checkpoints");
  for (const int steps : {9, 80, 700}) WriteOne(store, steps);
  const auto kept = store.Keep(2);
  EXPECT_EQ(store.List(), kept);
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_EQ(kept[0].filename(), "step-700");
  EXPECT_EQ(kept[1].filename(), "step-80");
}

TEST(CheckpointStoreTest, ADirectoryThatCannotBeListedIsNotAnEmptyOne) {
  const test::ScratchDirectory scratch;
  CheckpointStore store(scratch.path() / "checkpoints");
  for (const int steps : {10, 20, 30}) WriteOne(store, steps);
  const std::function<void()> looks[] = {[&] { store.List(); }, [&] { store.Keep(1); },
                                         [&] { const CheckpointStore again(store.directory()); }};
  // It cannot be opened, or not be read to its end.
  const test::FailingCall unopened{.function = "openat", .path = "*/checkpoints", .error = EMFILE};
  const test::FailingCall cut_off{
      .function = "readdir", .path = "*/checkpoints", .error = EIO, .first = 3};
  for (const test::FailingCall& call : {unopened, cut_off}) {
    const fs::path count = scratch.path() / call.function;
    for (const auto& look : looks) {
      fs::remove(count);
      const test::FailingCalls failing(call, count);
      EXPECT_THAT(look, testing::ThrowsMessage<base::Error>(
                            testing::HasSubstr("checkpoints: cannot be listed")));
      EXPECT_EQ(failing.num_calls(), call.first);
    }
  }
  EXPECT_EQ(store.List().size(), 3u);
}

TEST(CheckpointStoreTest, AFailedWriteLeavesTheEarlierOnesAndNoTrace) {
  const test::ScratchDirectory scratch;
  CheckpointStore store(scratch.path() / "checkpoints");
  WriteOne(store, 10);
  EXPECT_THROW(store.Write(20,
                           [](const fs::path& directory) {
                             base::WriteFileAtomically(directory / "a", "half");
                             throw base::Error("no space");
                           }),
               base::Error);
  ASSERT_EQ(store.List().size(), 1u);
  EXPECT_EQ(std::distance(fs::directory_iterator(store.directory()), {}), 1);
  EXPECT_EQ(base::ReadFile(store.List()[0] / "a"), "x");
}

TEST(CheckpointStoreTest, WhatACrashLeftHalfWrittenIsNoCheckpoint) {
  const test::ScratchDirectory scratch;
  const fs::path directory = scratch.path() / "checkpoints";
  fs::create_directories(directory / "step-99.unfinished");
  fs::create_directories(directory / "replay");
  CheckpointStore store(directory);
  EXPECT_TRUE(store.List().empty());
  EXPECT_FALSE(fs::exists(directory / "step-99.unfinished"));
  EXPECT_TRUE(fs::exists(directory / "replay"));
}

TEST(CheckpointStoreTest, ACrashWhileAStepIsReplacedLosesNothing) {
  const test::ScratchDirectory scratch;
  const fs::path directory = scratch.path() / "checkpoints";
  {
    CheckpointStore store(directory);
    WriteOne(store, 10, "old");
    WriteOne(store, 20, "new");
  }
  // Between the two renames, and after both.
  fs::rename(directory / "step-10", directory / "step-10.replaced");
  fs::copy(directory / "step-20", directory / "step-20.replaced");
  const CheckpointStore store(directory);
  ASSERT_EQ(store.List().size(), 2u);
  EXPECT_EQ(base::ReadFile(store.List()[1] / "a"), "old");
  EXPECT_EQ(std::distance(fs::directory_iterator(directory), {}), 2);
}

TEST(CheckpointStoreTest, OneSetAsideCountsNoMoreButIsKept) {
  const test::ScratchDirectory scratch;
  CheckpointStore store(scratch.path() / "checkpoints");
  WriteOne(store, 10);
  WriteOne(store, 20);
  store.SetAside(store.List()[0]);
  ASSERT_EQ(store.List().size(), 1u);
  EXPECT_EQ(store.List()[0].filename(), "step-10");
  EXPECT_TRUE(fs::exists(store.directory() / "step-20.damaged"));
}

TEST(CheckpointStoreTest, TheSameStepAgainReplacesTheOld) {
  const test::ScratchDirectory scratch;
  CheckpointStore store(scratch.path() / "checkpoints");
  WriteOne(store, 10, "old");
  WriteOne(store, 10, "new");
  ASSERT_EQ(store.List().size(), 1u);
  EXPECT_EQ(base::ReadFile(store.List()[0] / "a"), "new");
  EXPECT_EQ(std::distance(fs::directory_iterator(store.directory()), {}), 1);
}

}  // namespace
}  // namespace slalom::run
