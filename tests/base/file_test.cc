#include "base/file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/error.h"
#include "tests/support/error_of.h"
#include "tests/support/failing_calls.h"
#include "tests/support/small_files.h"

namespace slalom::base {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using testing::HasSubstr;

class FileTest : public testing::Test {
 protected:
  FileTest() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    directory_ = fs::path(testing::TempDir()) /
                 (std::string("slalom_file_") + info->name() + "_" + std::to_string(::getpid()));
    fs::remove_all(directory_);
    MakeDirectories(directory_);
  }
  ~FileTest() override { fs::remove_all(directory_); }

  int NumFiles() const {
    return static_cast<int>(std::distance(fs::directory_iterator(directory_), {}));
  }

  fs::path directory_;
};

TEST_F(FileTest, ReadsBackWhatWasWritten) {
  const fs::path path = directory_ / "file";
  const std::string bytes("a\0b\n\xff", 5);
  WriteFileAtomically(path, bytes);
  EXPECT_EQ(ReadFile(path), bytes);
  WriteFileAtomically(path, "");
  EXPECT_EQ(ReadFile(path), "");
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(FileTest, WritesPieces) {
  const fs::path path = directory_ / "file";
  WriteFileAtomically(path, [](const AppendBytes& append) {
    for (const std::string_view piece : {"one ", "two ", "three"}) {
      append(std::as_bytes(std::span(piece)));
    }
  });
  EXPECT_EQ(ReadFile(path), "one two three");
}

TEST_F(FileTest, AWriterThatThrowsLeavesTheOldFile) {
  const fs::path path = directory_ / "file";
  WriteFileAtomically(path, "old");
  EXPECT_THROW(WriteFileAtomically(path,
                                   [](const AppendBytes& append) {
                                     append(std::as_bytes(std::span("half", 4)));
                                     throw std::runtime_error("planned");
                                   }),
               std::runtime_error);
  EXPECT_EQ(ReadFile(path), "old");
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(FileTest, TwoWritersOfOneFileDoNotMeet) {
  const fs::path path = directory_ / "file";
  WriteFileAtomically(path, [&](const AppendBytes& append) {
    append(std::as_bytes(std::span("outer", 5)));
    WriteFileAtomically(path, "inner");
    EXPECT_EQ(ReadFile(path), "inner");
  });
  EXPECT_EQ(ReadFile(path), "outer");
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(FileTest, AFullDiskLeavesTheOldFileAndNoOther) {
  const fs::path path = directory_ / "file";
  WriteFileAtomically(path, "old");
  const std::string error = ErrorOf([&] {
    const test::SmallFiles limit(100);
    WriteFileAtomically(path, std::string(1000, 'x'));
  });
  EXPECT_THAT(error, HasSubstr(path.string()));
  EXPECT_EQ(ReadFile(path), "old");
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(FileTest, APipeIsWrittenToAndStays) {
  const fs::path pipe = directory_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  EXPECT_TRUE(IsStream(pipe));
  WriteFileAtomically(pipe, "through");
  std::string read(100, ' ');
  const ssize_t size = ::read(reader, read.data(), read.size());
  ASSERT_EQ(size, 7);
  EXPECT_EQ(read.substr(0, 7), "through");
  ::close(reader);
  EXPECT_TRUE(fs::is_fifo(pipe));
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(FileTest, ADeviceStaysAndItsErrorIsSaid) {
  // A link, so that a mistake costs the link and not the machine's device.
  const fs::path link = directory_ / "full";
  fs::create_symlink("/dev/full", link);
  EXPECT_THAT(ErrorOf([&] { WriteFileAtomically(link, "x"); }),
              testing::AllOf(HasSubstr(link.string()), HasSubstr("No space left")));
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_TRUE(fs::is_character_file(link));
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(FileTest, AnOpenFileNamedByProcIsAppendedTo) {
  // As /dev/stdout is where the shell has sent standard output to a file.
  const fs::path file = directory_ / "file";
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  ASSERT_GE(fd, 0);
  ASSERT_EQ(::write(fd, "before ", 7), 7);
  const fs::path link = directory_ / "stdout";
  fs::create_symlink("/proc/self/fd/" + std::to_string(fd), link);
  EXPECT_TRUE(IsStream(link));
  WriteFileAtomically(link, "after");
  ::close(fd);
  EXPECT_EQ(ReadFile(file), "before after");
  EXPECT_TRUE(fs::is_symlink(link));
}

TEST_F(FileTest, ALinkStaysAndItsFileIsReplaced) {
  const fs::path file = directory_ / "there" / "file";
  MakeDirectories(file.parent_path());
  WriteFileAtomically(file, "old");
  const fs::path link = directory_ / "link";
  fs::create_symlink("there/file", link);
  EXPECT_FALSE(IsStream(link));
  WriteFileAtomically(link, "new");
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(ReadFile(file), "new");
  fs::remove(file);
  WriteFileAtomically(link, "made anew");
  EXPECT_EQ(ReadFile(file), "made anew");
}

TEST_F(FileTest, ALinkToALinkCountsFromThePlaceOfEach) {
  const fs::path there = directory_ / "there", below = there / "below";
  MakeDirectories(below);
  WriteFileAtomically(below / "file", "old");
  fs::create_symlink("there/link", directory_ / "link");
  fs::create_symlink("below/link", there / "link");
  fs::create_symlink("file", below / "link");
  WriteFileAtomically(directory_ / "link", "new");
  EXPECT_EQ(ReadFile(below / "file"), "new");
  EXPECT_TRUE(fs::is_symlink(below / "link"));
  EXPECT_EQ(NumFiles(), 2);
}

// The kernel does not follow links that lead to each other: what they stand for is not known.
TEST_F(FileTest, WhatKilledWritersLeftIsRemovedAndNothingElse) {
  for (const char* name : {"policy.safetensors.tmp", "spool.tmp-0123456789abcdef", "notes.tmp-old",
                           "tmp", "a.tmp.csv"}) {
    std::ofstream(directory_ / name) << "x";
  }
  fs::create_directory(directory_ / "mine.tmp");
  fs::create_symlink("a.tmp.csv", directory_ / "link.tmp");
  RemoveUnfinishedFiles(directory_);
  std::vector<std::string> left;
  for (const fs::path& path : ListDirectory(directory_)) left.push_back(path.filename());
  EXPECT_THAT(left, testing::UnorderedElementsAre("notes.tmp-old", "tmp", "a.tmp.csv", "mine.tmp",
                                                  "link.tmp"));
}

TEST_F(FileTest, ADirectoryThatCannotBeSyncedIsAnError) {
  const fs::path path = directory_ / "file";
  const test::FailingCalls failing({.function = "open", .path = directory_.string(), .error = EIO},
                                   directory_ / "calls");
  EXPECT_THAT(ErrorOf([&] { WriteFileAtomically(path, "new"); }),
              testing::AllOf(HasSubstr(directory_.string()), HasSubstr("cannot be synced")));
  EXPECT_EQ(failing.num_calls(), 1);
  WriteFileAtomically(path, "newer");
  EXPECT_EQ(ReadFile(path), "newer");
  EXPECT_EQ(NumFiles(), 1) << "no temporary file is left";
}

// Else a loss of power takes a directory away with all that was synced in it.
TEST_F(FileTest, EveryDirectoryThatGetsANewOneIsSynced) {
  for (const fs::path& parent : {directory_, directory_ / "a", directory_ / "a/b"}) {
    fs::remove_all(directory_ / "a");
    const test::FailingCalls failing({.function = "open", .path = parent.string(), .error = EIO},
                                     directory_ / "calls");
    EXPECT_THAT(ErrorOf([&] { MakeDirectories(directory_ / "a/b/c"); }),
                HasSubstr(parent.string() + ": cannot be synced"));
  }
  MakeDirectories(directory_ / "a/b/c");
  EXPECT_TRUE(fs::is_directory(directory_ / "a/b/c"));
}

TEST_F(FileTest, WhatCannotBeLookedAtIsNotReplaced) {
  const fs::path link = directory_ / "link";
  fs::create_symlink("other", link);
  fs::create_symlink("link", directory_ / "other");
  EXPECT_THAT(ErrorOf([&] { WriteFileAtomically(link, "x"); }),
              testing::AllOf(HasSubstr(link.string()), HasSubstr("levels of symbolic links")));
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_TRUE(fs::is_symlink(directory_ / "other"));
}

TEST_F(FileTest, AnErrorIsNoAbsence) {
  const fs::path file = directory_ / "file";
  EXPECT_FALSE(Exists(file));
  EXPECT_TRUE(ListDirectory(file).empty());
  WriteFileAtomically(file, "x");
  EXPECT_TRUE(Exists(file));
  EXPECT_THAT(ListDirectory(directory_), testing::ElementsAre(file));
  EXPECT_FALSE(Exists(file / "below a file"));
  const fs::path endless = directory_ / std::string(1000, 'x');
  EXPECT_THAT(ErrorOf([&] { static_cast<void>(Exists(endless)); }), HasSubstr("name too long"));
  EXPECT_THAT(ErrorOf([&] { ListDirectory(file); }), HasSubstr("Not a directory"));
}

TEST_F(FileTest, AnEndlessFileIsRefusedAndAPipeIsRead) {
  EXPECT_THAT(ErrorOf([] { ReadFile("/dev/zero"); }),
              testing::AllOf(HasSubstr("/dev/zero"), HasSubstr("no regular file")));
  EXPECT_EQ(ReadFile("/dev/null"), "");
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  ASSERT_EQ(::write(ends[1], "piped", 5), 5);
  ::close(ends[1]);
  EXPECT_EQ(ReadFile("/proc/self/fd/" + std::to_string(ends[0])), "piped");
  ::close(ends[0]);
}

TEST_F(FileTest, AByteOrderMarkIsNoText) {
  const fs::path path = directory_ / "file";
  for (const std::string text : {"text\n", "\xef\xbb", ""}) {
    WriteFileAtomically(path, "\xef\xbb\xbf" + text);
    EXPECT_EQ(ReadTextFile(path), text);
    WriteFileAtomically(path, text);
    EXPECT_EQ(ReadTextFile(path), text);
  }
  for (const std::string& text : {std::string("\xff\xfet\0", 4), std::string("\xfe\xff\0t", 4)}) {
    WriteFileAtomically(path, text);
    EXPECT_THAT(ErrorOf([&] { ReadTextFile(path); }),
                testing::AllOf(HasSubstr(path.string()), HasSubstr("UTF-16")));
  }
}

TEST_F(FileTest, ADirectoryIsNoFile) {
  EXPECT_THAT(ErrorOf([&] { WriteFileAtomically(directory_, "x"); }),
              testing::AllOf(HasSubstr(directory_.string()), HasSubstr("is a directory")));
}

TEST_F(FileTest, ErrorsNameTheFile) {
  const fs::path missing = directory_ / "missing";
  EXPECT_THAT(ErrorOf([&] { ReadFile(missing); }), HasSubstr(missing.string()));
  EXPECT_THAT(ErrorOf([&] { ReadFile(directory_); }), HasSubstr(directory_.string()));
  const fs::path nowhere = directory_ / "missing" / "file";
  EXPECT_THAT(ErrorOf([&] { WriteFileAtomically(nowhere, "x"); }), HasSubstr(nowhere.string()));
  WriteFileAtomically(missing, "now a file");
  EXPECT_THAT(ErrorOf([&] { MakeDirectories(nowhere); }), HasSubstr(missing.string()));
}

TEST_F(FileTest, NoPermissionIsAnError) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write anywhere";
  fs::permissions(directory_, fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(ErrorOf([&] { WriteFileAtomically(directory_ / "file", "x"); }),
              HasSubstr((directory_ / "file").string()));
  fs::permissions(directory_, fs::perms::owner_all);
}

TEST(ChecksumTest, IsXxh3) {
  // Of the empty input with seed 0, from the xxHash specification's reference implementation.
  EXPECT_EQ(Checksum(""), 0x2D06800538D394C2ull);
  EXPECT_NE(Checksum("a"), Checksum("b"));
  EXPECT_NE(Checksum("a"), Checksum("a", 1));
}

}  // namespace
}  // namespace slalom::base
