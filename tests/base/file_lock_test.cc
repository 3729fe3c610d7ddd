#include "base/file_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "tests/support/scratch_directory.h"

namespace slalom::base {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

template <class Lock>
std::string RefusalOf(const Lock& lock) {
  try {
    lock();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(FileLockTest, OneAtATimeHoldsAFile) {
  const test::ScratchDirectory scratch;
  const fs::path file = scratch.path() / "lock";
  const auto lock = [&] { return FileLock::OfFile(file, "it is in use"); };
  {
    FileLock first = lock();
    EXPECT_EQ(RefusalOf(lock), file.string() + ": it is in use");
    const FileLock moved = std::move(first);
    EXPECT_EQ(RefusalOf(lock), file.string() + ": it is in use");
  }
  EXPECT_EQ(RefusalOf(lock), "");
}

TEST(FileLockTest, OneThatIsMovedOutlivesTheOther) {
  const test::ScratchDirectory scratch;
  const fs::path file = scratch.path() / "lock";
  auto first = std::make_unique<FileLock>(FileLock::OfFile(file, "it is in use"));
  const FileLock second = std::move(*first);
  first.reset();
  EXPECT_THROW(FileLock::OfFile(file, "it is in use"), Error);
}

// Else one that tries again and again has no descriptor left.
TEST(FileLockTest, ARefusalKeepsNoDescriptor) {
  const test::ScratchDirectory scratch;
  const fs::path file = scratch.path() / "lock";
  const FileLock lock = FileLock::OfFile(file, "it is in use");
  const auto num_open = [&] {
    int count = 0;
    std::error_code gone;
    for (const auto& entry : fs::directory_iterator("/proc/self/fd")) {
      count += fs::read_symlink(entry.path(), gone) == file;
    }
    return count;
  };
  EXPECT_EQ(num_open(), 1);
  for (int i = 0; i < 3; ++i) EXPECT_THROW(FileLock::OfFile(file, "it is in use"), Error);
  EXPECT_EQ(num_open(), 1);
}

TEST(FileLockTest, TheLockStaysWithADirectoryThatIsRenamed) {
  const test::ScratchDirectory scratch;
  const fs::path directory = scratch.path() / "a";
  const auto lock = [&] { return FileLock::OfFile(directory / "lock", "it is in use"); };
  EXPECT_THAT(RefusalOf(lock), HasSubstr("cannot be opened"));
  EXPECT_FALSE(fs::exists(directory)) << "only the file is created";
  fs::create_directory(directory);
  const FileLock first = lock();
  fs::rename(directory, scratch.path() / "b");
  fs::create_directory(directory);
  EXPECT_EQ(RefusalOf(lock), "");
  EXPECT_THROW(FileLock::OfFile(scratch.path() / "b/lock", "it is in use"), Error);
}

}  // namespace
}  // namespace slalom::base
