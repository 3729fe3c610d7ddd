#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/config.h"
#include "base/error.h"
#include "tests/base/example_config.h"
#include "tests/support/scratch_directory.h"

namespace slalom::config {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

class ConfigFileTest : public testing::Test {
 protected:
  ConfigFileTest() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    directory_ = fs::path(testing::TempDir()) /
                 (std::string("slalom_config_") + info->name() + "_" + std::to_string(::getpid()));
    fs::remove_all(directory_);
    fs::create_directories(directory_ / "sub");
  }
  ~ConfigFileTest() override { fs::remove_all(directory_); }

  fs::path Write(const std::string& name, const std::string& text) {
    std::ofstream(directory_ / name) << text;
    return directory_ / name;
  }
  static std::string ErrorOf(const fs::path& path) {
    try {
      (void)Load<Outer>(path, {});
      return "";
    } catch (const base::Error& error) {
      return error.what();
    }
  }

  fs::path directory_;
};

TEST_F(ConfigFileTest, AFileOverridesItsBasesAndOverridesComeLast) {
  Write("root.toml", "count = 1\nname = 'root'\nflag = true\n[inner]\nkind = 'slow'\n");
  Write("sub/middle.toml", "base = '../root.toml'\ncount = 2\n[inner]\nspeed = 9\n");
  const fs::path top = Write("top.toml", "base = 'sub/middle.toml'\nname = 'top'\n");
  const std::vector<std::string> overrides = {"inner.speed=4"};
  const auto config = Load<Outer>(top, overrides);
  EXPECT_TRUE(config.flag);
  EXPECT_EQ(config.count, 2);
  EXPECT_EQ(config.name, "top");
  EXPECT_EQ(config.inner.kind, "slow");
  EXPECT_EQ(config.inner.speed, 4.0);
}

TEST_F(ConfigFileTest, OfSeveralBasesALaterOneOverridesAnEarlierOneAndTheFileBoth) {
  Write("sub/root.toml", "flag = true\nname = 'root'\n");
  Write("sub/a.toml", "base = 'root.toml'\ncount = 1\n[inner]\nkind = 'slow'\nspeed = 9\n");
  Write("b.toml", "count = 2\nname = 'b'\n[inner]\nspeed = 7\n");
  const fs::path top = Write("top.toml", "base = ['sub/a.toml', 'b.toml']\n[inner]\nspeed = 5\n");
  const auto config = Load<Outer>(top, {});
  EXPECT_TRUE(config.flag);
  EXPECT_EQ(config.name, "b");
  EXPECT_EQ(config.count, 2);
  EXPECT_EQ(config.inner.kind, "slow");
  EXPECT_EQ(config.inner.speed, 5.0);
  EXPECT_THAT(ErrorOf(Write("gone.toml", "base = ['b.toml', 'none.toml']")),
              HasSubstr("none.toml"));
  EXPECT_THAT(ErrorOf(Write("c.toml", "base = ['b.toml', 'c.toml']")),
              AllOf(HasSubstr("c.toml:1: "), HasSubstr("circle")));
  for (const std::string list : {"['b.toml', 3]", "[]"}) {
    EXPECT_THAT(ErrorOf(Write("d.toml", "\nbase = " + list)),
                AllOf(HasSubstr("d.toml:2: "), HasSubstr("or a list of such paths")));
  }
}

TEST_F(ConfigFileTest, ErrorsNameTheFileThatIsWrong) {
  const fs::path root = Write("root.toml", "\ncuont = 1\n");
  const fs::path top = Write("top.toml", "base = 'root.toml'\n");
  EXPECT_THAT(ErrorOf(top), StartsWith(root.string() + ":2: "));
  EXPECT_THAT(ErrorOf(directory_ / "none.toml"), HasSubstr("none.toml"));
  EXPECT_THAT(ErrorOf(Write("a.toml", "base = 'gone.toml'")), HasSubstr("gone.toml"));
  EXPECT_THAT(ErrorOf(Write("b.toml", "base = 3")), HasSubstr("b.toml:1: "));
  EXPECT_THAT(ErrorOf(Write("c.toml", "base = 'c.toml'")), HasSubstr("circle"));
}

class FilesTest : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) {
    std::ofstream(scratch_.path() / name) << text;
  }
  fs::path Path(const std::string& name) const { return scratch_.path() / name; }

  test::ScratchDirectory scratch_;
};

/// A program that reads the inner section alone.
struct Half {
  Inner inner;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("inner", inner, "The inner one.");
  }
};

TEST_F(FilesTest, KeysOfOthersInASharedFileAreCheckedAndPassedOver) {
  Write("base.toml", "flag = true\n");
  Write("shared.toml", "base = \"base.toml\"\ncount = 7\nsizes = [9]\n[inner]\nspeed = 2.5\n");
  Half half;
  Outer others;
  EXPECT_THAT(ReadSharedTomlFile(Path("shared.toml"), ListFields(half), ListFields(others)),
              testing::UnorderedElementsAre("flag", "count", "sizes"));
  EXPECT_EQ(half.inner.speed, 2.5);
  EXPECT_EQ(others.inner.speed, 1.5) << "what the reader itself knows is its own";

  Outer outer;
  Half other_half;
  EXPECT_THAT(ReadSharedTomlFile(Path("shared.toml"), ListFields(outer), ListFields(other_half)),
              testing::IsEmpty());
  EXPECT_EQ(outer.count, 7);

  const auto error_of = [&](const std::string& text) -> std::string {
    Write("bad.toml", text);
    try {
      ReadSharedTomlFile(Path("bad.toml"), ListFields(half), ListFields(others));
      return "";
    } catch (const base::Error& error) {
      return error.what();
    }
  };
  EXPECT_THAT(error_of("\ncuont = 7\n"),
              AllOf(HasSubstr("bad.toml:2: unknown key 'cuont'"), HasSubstr("'count'")));
  EXPECT_THAT(error_of("count = 1000\n"), HasSubstr("expected an integer in [-100, 100]"));
}

TEST_F(FilesTest, ASectionOfOthersIsNamedOnce) {
  struct Flat {
    int count = 3;
    void Visit(FieldCollector& v) { v("count", count, base::Range{0, 9}, "", "How many."); }
  } flat;
  Outer others;
  Write("shared.toml", "count = 5\n[inner]\nspeed = 2.5\nkind = \"slow\"\n");
  EXPECT_THAT(ReadSharedTomlFile(Path("shared.toml"), ListFields(flat), ListFields(others)),
              ElementsAre("inner"));
  EXPECT_EQ(flat.count, 5);
}

TEST_F(FilesTest, OfAMissingFileTheNearestIsNamed) {
  Write("quickstart.toml", "");
  Write("fast.toml", "");
  const auto error_of = [&](const std::string& name) -> std::string {
    Outer outer;
    try {
      ReadTomlFile(Path(name), ListFields(outer));
      return "";
    } catch (const base::Error& error) {
      return error.what();
    }
  };
  for (const char* name : {"quikstart.toml", "quickstart", "quickstrat.toml"}) {
    EXPECT_THAT(error_of(name),
                AllOf(StartsWith(Path(name).string()), HasSubstr("there is no such file"),
                      HasSubstr("did you mean '" + Path("quickstart.toml").string() + "'?")));
  }
  EXPECT_THAT(error_of("mine.toml"), EndsWith("there is no such file"));
  EXPECT_THAT(error_of("none/mine.toml"), EndsWith("there is no such file"));
}

TEST_F(FilesTest, WhatIsNotHereIsReadFromWhatCameWithTheProgram) {
  std::filesystem::create_directories(Path("configs/sweeps"));
  Write("configs/ours.toml", "count = 7\n");
  Write("configs/sweeps/other.toml", "base = \"../ours.toml\"\n");
  setenv("SLALOM_SHARE", Path("").c_str(), /*replace=*/1);
  Outer outer;
  ReadTomlFile("configs/sweeps/other.toml", ListFields(outer));
  EXPECT_EQ(outer.count, 7);
  EXPECT_EQ(Locate("configs/ours.toml"), Path("configs/ours.toml"));
  Write("mine.toml", "\nbase = \"configs/ours.toml\"\n");
  std::filesystem::create_directories(Path("elsewhere"));
  Write("elsewhere/mine.toml", "\nbase = \"configs/ours.toml\"\n");
  for (const char* mine : {"mine.toml", "elsewhere/mine.toml"}) {
    outer.count = 1;
    ReadTomlFile(Path(mine), ListFields(outer));
    EXPECT_EQ(outer.count, 7) << mine;
  }
  Write("elsewhere/wrong.toml", "\nbase = \"configs/oers.toml\"\n");
  try {
    ReadTomlFile(Path("elsewhere/wrong.toml"), ListFields(outer));
    ADD_FAILURE() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("elsewhere/wrong.toml:2: base = \"configs/oers.toml\""),
                      HasSubstr("relative to the file that names it"),
                      EndsWith("did you mean 'configs/ours.toml'?")));
  }
  EXPECT_EQ(Locate("configs/none.toml"), "configs/none.toml") << "as the user named it";
  EXPECT_EQ(Locate("/configs/ours.toml"), "/configs/ours.toml");
  try {
    ReadTomlFile("configs/oers.toml", ListFields(outer));
    ADD_FAILURE() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_STREQ(error.what(),
                 "configs/oers.toml: there is no such file; did you mean 'configs/ours.toml'?");
  }
  unsetenv("SLALOM_SHARE");
}

}  // namespace
}  // namespace slalom::config
