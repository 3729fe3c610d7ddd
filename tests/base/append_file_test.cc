#include "base/append_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/small_files.h"

namespace slalom::base {
namespace {

using ::testing::HasSubstr;

TEST(AppendFileTest, RecordsStandBehindWhatWasThere) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "file";
  {
    AppendFile file(path, AppendFile::Mode::kMakeNew);
    EXPECT_FALSE(file.Append("one "));
    EXPECT_FALSE(file.Append("two "));
  }
  AppendFile file(path, AppendFile::Mode::kGoOn);
  EXPECT_FALSE(file.Append("three"));
  EXPECT_EQ(ReadFile(path), "one two three");
}

TEST(AppendFileTest, OnAFullDiskARecordIsThereWholeOrNotAtAll) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "file";
  AppendFile file(path, AppendFile::Mode::kMakeNew);
  EXPECT_FALSE(file.Append("0123456789"));
  {
    const test::SmallFiles limit(14);
    const auto failure = file.Append("abcdefghij");
    ASSERT_TRUE(failure);
    EXPECT_THAT(failure->text, HasSubstr("file: cannot write (File too large)"));
    EXPECT_FALSE(file.Append("abcd"));
  }
  EXPECT_FALSE(file.Append("efghij"));
  EXPECT_EQ(ReadFile(path), "0123456789abcdefghij");
}

TEST(AppendFileTest, OneThatIsMovedOutlivesTheOther) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "file";
  auto first = std::make_unique<AppendFile>(path, AppendFile::Mode::kMakeNew);
  EXPECT_FALSE(first->Append("one "));
  AppendFile second(std::move(*first));
  first.reset();
  EXPECT_FALSE(second.Append("two"));
  EXPECT_EQ(ReadFile(path), "one two");
}

TEST(AppendFileTest, WhatCannotBeOpenedIsNamed) {
  const test::ScratchDirectory scratch;
  WriteFileAtomically(scratch.path() / "file", "");
  EXPECT_THROW(AppendFile(scratch.path() / "file", AppendFile::Mode::kMakeNew), Error);
  EXPECT_THROW(AppendFile("/nonexistent/file", AppendFile::Mode::kGoOn), Error);
}

}  // namespace
}  // namespace slalom::base
