#include "base/file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <stdexcept>

#include "base/error.h"

namespace slalom::base {
namespace {

namespace fs = std::filesystem;
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

template <class Body>
std::string ErrorOf(Body body) {
  try {
    body();
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

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

TEST_F(FileTest, AFullDiskLeavesTheOldFileAndNoOther) {
  const fs::path path = directory_ / "file";
  WriteFileAtomically(path, "old");
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit{100, before.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ::setrlimit(RLIMIT_FSIZE, &limit);
  const std::string error = ErrorOf([&] { WriteFileAtomically(path, std::string(1000, 'x')); });
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(error, HasSubstr(path.string()));
  EXPECT_EQ(ReadFile(path), "old");
  EXPECT_EQ(NumFiles(), 1);
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
