#include "run/checkpoint_store.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/scratch_directory.h"

namespace slalom::run {
namespace {

namespace fs = std::filesystem;

void WriteOne(CheckpointStore& store, std::int64_t steps, const std::string& content = "x") {
  store.Write(steps, [&](const fs::path& directory) {
    base::WriteFileAtomically(directory / "a", content);
  });
}

TEST(CheckpointStoreTest, KeepsTheNewestTwoByStepsNotByName) {
  const test::ScratchDirectory scratch;
  CheckpointStore store(scratch.path() / "checkpoints");
  for (const int steps : {9, 80, 700}) WriteOne(store, steps);
  const auto list = store.List();
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].filename(), "step-700");
  EXPECT_EQ(list[1].filename(), "step-80");
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
}

}  // namespace
}  // namespace slalom::run
