#include "base/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "tests/base/example_config.h"
#include "tests/support/scratch_directory.h"

namespace slalom::config {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

/// What reading `text` throws; empty: nothing.
std::string ErrorOf(const std::string& text) {
  try {
    (void)FromToml<Outer>(text, "run.toml");
    return "";
  } catch (const base::Error& error) {
    return error.what();
  }
}

std::string OverrideErrorOf(const std::string& assignment) {
  Outer config;
  try {
    ApplyOverride(assignment, ListFields(config));
    return "";
  } catch (const base::Error& error) {
    return error.what();
  }
}

std::string RandomText(base::Random& random) {
  static constexpr std::string_view kPieces[] = {"a",  "\"", "\\", "\n", "'", "#",   "=",
                                                 "[]", "\t", "é",  "0",  " ", "\x01"};
  std::string text;
  for (auto n = random.UniformInt(6); n > 0; --n) {
    text += kPieces[random.UniformInt(std::size(kPieces))];
  }
  return text;
}

double RandomDouble(base::Random& random) {
  return random.Normal() * std::pow(10.0, random.Uniform(-300.0, 298.0));
}

TEST(ConfigTest, WhatIsPrintedReadsBackToTheSameValues) {
  base::Random random(1);
  for (int i = 0; i < 3000; ++i) {
    Outer config;
    config.flag = random.UniformInt(2) == 1;
    config.count = static_cast<int>(random.UniformInt(201)) - 100;
    config.large = static_cast<std::int64_t>(random.Uniform(-9e18, 9e18));
    config.name = RandomText(random);
    config.sizes.resize(random.UniformInt(4));
    for (int& size : config.sizes) size = static_cast<int>(random.UniformInt(201)) - 100;
    config.weights.resize(random.UniformInt(4));
    for (double& weight : config.weights) weight = RandomDouble(random);
    config.inner.speed = std::abs(RandomDouble(random));
    config.inner.kind = random.UniformInt(2) == 1 ? "fast" : "slow";
    config.inner.gear = static_cast<Gear>(random.UniformInt(3));
    const std::string text = ToToml(config);
    const auto back = FromToml<Outer>(text, "printed");
    ASSERT_EQ(ToToml(back), text);
    ASSERT_EQ(back.flag, config.flag);
    ASSERT_EQ(back.count, config.count);
    ASSERT_EQ(back.large, config.large);
    ASSERT_EQ(back.name, config.name) << text;
    ASSERT_EQ(back.sizes, config.sizes);
    ASSERT_EQ(back.weights, config.weights);
    ASSERT_EQ(back.inner.speed, config.inner.speed);
    ASSERT_EQ(back.inner.kind, config.inner.kind);
    ASSERT_EQ(back.inner.gear, config.inner.gear);
  }
}

TEST(ConfigTest, KeysThatAFileDoesNotHoldKeepTheirDefaults) {
  const auto config = FromToml<Outer>("count = 7\n[inner]\nspeed = 2\n", "run.toml");
  EXPECT_EQ(config.count, 7);
  EXPECT_EQ(config.inner.speed, 2.0);
  EXPECT_EQ(config.name, "x");
  EXPECT_THAT(config.sizes, ElementsAre(1, 2));
}

TEST(ConfigTest, ErrorsNameFileLineKeyFoundAndExpected) {
  EXPECT_THAT(ErrorOf("flag = true\ncount = 101\n"),
              AllOf(StartsWith("run.toml:2: "), HasSubstr("count is 101"),
                    HasSubstr("an integer in [-100, 100]")));
  EXPECT_THAT(ErrorOf("count = 1.5"), HasSubstr("count is 1.5, expected an integer"));
  EXPECT_THAT(ErrorOf("flag = 1"), HasSubstr("expected true or false"));
  EXPECT_THAT(ErrorOf("name = 1"), HasSubstr("expected a string"));
  EXPECT_THAT(ErrorOf("sizes = [1, 200]"), HasSubstr("expected a list of integers in [-100, 100]"));
  EXPECT_THAT(ErrorOf("weights = [\"a\"]"), HasSubstr("expected a list of numbers"));
  EXPECT_THAT(
      ErrorOf("[inner]\n\nkind = 'slwo'"),
      AllOf(StartsWith("run.toml:3: "), HasSubstr("'slwo'"), HasSubstr("one of 'fast', 'slow'")));
  EXPECT_THAT(ErrorOf("[inner]\n\ngear = 'third'"),
              AllOf(StartsWith("run.toml:3: "), HasSubstr("inner.gear is 'third', expected one of "
                                                          "'first', 'second', 'reverse'")));
  EXPECT_THAT(ErrorOf("[inner]\ngear = 1"), HasSubstr("gear is 1, expected one of 'first'"));
  EXPECT_THAT(ErrorOf("[inner]\nspeed = nan"), HasSubstr("expected a number"));
  EXPECT_THAT(ErrorOf("[inner]\nspeed = inf"), HasSubstr("expected a number"));
  EXPECT_THAT(ErrorOf("[inner]\nspeed = -11"), HasSubstr("m/s"));
  EXPECT_THAT(ErrorOf("inner = 3"), AllOf(StartsWith("run.toml:1: "), HasSubstr("[inner]")));
  EXPECT_THAT(ErrorOf("count = = 3"), StartsWith("run.toml:1: not valid TOML"));
  EXPECT_THAT(ErrorOf("count = 3\ncount = 4"), StartsWith("run.toml:2: not valid TOML"));
}

TEST(ConfigTest, UnknownKeysAreErrorsWithASuggestion) {
  EXPECT_THAT(ErrorOf("cuont = 3"),
              AllOf(StartsWith("run.toml:1: "), HasSubstr("unknown key 'cuont'"),
                    HasSubstr("did you mean 'count'?")));
  EXPECT_THAT(ErrorOf("[inner]\nsped = 3"), HasSubstr("did you mean 'inner.speed'?"));
  EXPECT_THAT(ErrorOf("speed = 3"), HasSubstr("did you mean 'inner.speed'?"));
  EXPECT_THAT(ErrorOf("[iner]\nspeed = 3"), HasSubstr("unknown key 'iner'"));
  EXPECT_THAT(ErrorOf("[inner.deeper]\nspeed = 3"), HasSubstr("unknown key 'inner.deeper'"));
  EXPECT_THAT(ErrorOf("zzzzzzzzzzzzzz = 3"), HasSubstr("docs/config.md"));
}

TEST(ConfigTest, OverridesTakeTomlOrBareWords) {
  Outer config;
  const FieldList list = ListFields(config);
  ApplyOverride("count=-5", list);
  ApplyOverride("flag=true", list);
  ApplyOverride("name=plain words", list);
  ApplyOverride("inner.kind=slow", list);
  ApplyOverride("inner.gear=reverse", list);
  ApplyOverride("inner.speed=2", list);
  ApplyOverride("sizes=[4, 5]", list);
  EXPECT_EQ(config.count, -5);
  EXPECT_TRUE(config.flag);
  EXPECT_EQ(config.name, "plain words");
  EXPECT_EQ(config.inner.kind, "slow");
  EXPECT_EQ(config.inner.gear, Gear::kReverse);
  EXPECT_EQ(config.inner.speed, 2.0);
  EXPECT_THAT(config.sizes, ElementsAre(4, 5));
  // A text that looks like something else is still a text.
  for (const std::string text : {"007", "1.50", "true", "2024-01-01", "[1]", ""}) {
    ApplyOverride("name=" + text, list);
    EXPECT_EQ(config.name, text);
  }
  ApplyOverride("name=\"quoted\"", list);
  EXPECT_EQ(config.name, "quoted");
}

TEST(ConfigTest, OverrideErrorsNameTheOverride) {
  EXPECT_THAT(OverrideErrorOf("inner={speed = 2}"),
              AllOf(StartsWith("--set inner={speed = 2}: "), HasSubstr("'inner' is a section"),
                    HasSubstr("inner.KEY=VALUE")));
  EXPECT_THAT(OverrideErrorOf("count=1000"),
              AllOf(StartsWith("--set count=1000: "), HasSubstr("[-100, 100]")));
  EXPECT_THAT(OverrideErrorOf("cout=1"), HasSubstr("did you mean 'count'?"));
  EXPECT_THAT(OverrideErrorOf("count"), HasSubstr("expected KEY=VALUE"));
  EXPECT_THAT(OverrideErrorOf("=1"), HasSubstr("expected KEY=VALUE"));
  EXPECT_THAT(OverrideErrorOf("count=many"), HasSubstr("expected an integer"));
  EXPECT_THAT(OverrideErrorOf("inner.gear=1"), HasSubstr("gear is '1', expected one of 'first'"));
  EXPECT_THAT(OverrideErrorOf("inner=1"), Not(testing::IsEmpty()));
}

TEST(ConfigTest, AValueMustBeOneValue) {
  // What follows a value on further lines would be keys of their own.
  EXPECT_THAT(OverrideErrorOf("count=1\nflag=true"), Not(testing::IsEmpty()));
}

/// A section with a table of assignments for its own fields.
struct WithTable {
  struct Section {
    double speed = 1.0;
    double gain = 2.0;
    base::TomlAssignments drawn;
    template <class Visitor>
    void Visit(Visitor& v) {
      v("drawn", drawn, "Drawn.");
      v("speed", speed, base::Range{0.0, 9.0}, "", "Speed.");
      v("gain", gain, base::Range{0.0, 9.0}, "", "Gain.");
    }
  };
  Section task;
  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("task", task, "The task.");
  }
};

std::string DrawnOf(const WithTable& config) {
  std::string text;
  for (const auto& [key, value] : config.task.drawn) text += key + "=" + value.text + " ";
  return text;
}

TEST(ConfigTest, OverridesSetEntriesOfATable) {
  WithTable config;
  const FieldList fields = ListFields(config);
  ApplyOverride("task.drawn.\"task.speed\"=[0.5, 1]", fields);
  ApplyOverride("task.drawn.other.key=['a', 'b']", fields);
  ApplyOverride("task.drawn.'gain'=[1, 2]", fields);
  EXPECT_EQ(DrawnOf(config), "gain=[1, 2] other.key=['a', 'b'] task.speed=[0.5, 1] ");
  EXPECT_EQ(config.task.drawn[0].value.where, "--set task.drawn.'gain'=[1, 2]");
  ApplyOverride("task.drawn.gain=word", fields);
  ApplyOverride("task.drawn={task.speed = [0.0, 0.5]}", fields);
  EXPECT_EQ(DrawnOf(config), "gain='word' other.key=['a', 'b'] task.speed=[0.0, 0.5] ");
  const std::string printed = ToToml(config);
  EXPECT_EQ(ToToml(FromToml<WithTable>(printed, "printed")), printed);
  ApplyOverride("task.drawn={}", fields);
  EXPECT_EQ(DrawnOf(config), "");
}

TEST(ConfigTest, SettingAFieldLaterTakesItsEntryOutOfATable) {
  const test::ScratchDirectory scratch;
  const auto write = [&](const char* name, const std::string& text) {
    std::ofstream(scratch.path() / name) << text;
  };
  const auto load = [&](const char* name, const std::vector<std::string>& overrides = {}) {
    return DrawnOf(Load<WithTable>(scratch.path() / name, overrides));
  };
  write("base.toml", "[task]\nspeed = 3\n[task.drawn]\nspeed = [1, 2]\ngain = [3, 4]\n");
  write("sets.toml", "base = \"base.toml\"\n[task]\ngain = 5\n");
  write("draws.toml", "base = \"sets.toml\"\ntask.drawn.gain = [7, 8]\n");
  write("none.toml", "base = \"base.toml\"\n[task]\ndrawn = {}\n");
  EXPECT_EQ(load("base.toml"), "gain=[3, 4] speed=[1, 2] ") << "a file's own order does not matter";
  EXPECT_EQ(load("sets.toml"), "speed=[1, 2] ");
  EXPECT_EQ(load("draws.toml"), "gain=[7, 8] speed=[1, 2] ");
  EXPECT_EQ(load("none.toml"), "");
  EXPECT_EQ(load("base.toml", {"task.speed=1"}), "gain=[3, 4] ");
  EXPECT_EQ(load("base.toml", {"task.speed=1", "task.drawn.speed=[0, 1]"}),
            "gain=[3, 4] speed=[0, 1] ");
  EXPECT_EQ(load("base.toml", {"task.drawn={}"}), "");
}

struct OneVersion {
  double gain = 0.5;
  std::vector<int> steps;
  std::string name = "x";

  template <class Visitor>
  void Visit(Visitor& v) {
    v("gain", gain, base::Range{0.0, 1.0}, "", "Gain.");
    v("steps", steps, base::Range{0, 9}, "", "Steps.");
    v("name", name, "Name.");
  }
};

/// The same with one more key, in another order.
struct NextVersion {
  int added = 7;
  OneVersion kept;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("name", kept.name, "Name.");
    v("added", added, base::Range{0, 9}, "", "Added.");
    v("steps", kept.steps, base::Range{0, 9}, "", "Steps.");
    v("gain", kept.gain, base::Range{0.0, 1.0}, "", "Gain.");
  }
};

TEST(ConfigPrintTest, ChangesDoNotDependOnKeysAtTheirDefaultsOrOnTheirOrder) {
  EXPECT_EQ(Changes(OneVersion{}), "");
  EXPECT_EQ(Changes(NextVersion{}), "");
  const OneVersion changed{.gain = 0.25, .steps = {1, 2}, .name = "y"};
  EXPECT_EQ(Changes(changed), "gain = 0.25\nname = \"y\"\nsteps = [1, 2]\n");
  EXPECT_EQ(Changes(NextVersion{.kept = changed}), Changes(changed));
  EXPECT_EQ(Changes(NextVersion{.added = 8, .kept = changed}), "added = 8\n" + Changes(changed));
}

TEST(ConfigPrintTest, FlattensATextWhoseKeysNobodyKnows) {
  const base::TomlAssignments values =
      FlattenToml("z = 0.1\n[b.c]\nname = \"x y\"\nlist = [1, 2.5, \"u\"]\n", "a file");
  std::vector<std::string> lines;
  for (const auto& [key, value] : values) lines.push_back(key + " = " + value.text);
  EXPECT_THAT(lines, ElementsAre("b.c.list = [1, 2.5, \"u\"]", "b.c.name = \"x y\"", "z = 0.1"));
  EXPECT_THAT([] { (void)FlattenToml("a = 1\nb = ", "a file"); },
              testing::ThrowsMessage<base::Error>(HasSubstr("a file:2: not valid TOML")));
}

TEST(ConfigPrintTest, MarkdownHoldsEveryField) {
  Outer config;
  const std::string page = PrintMarkdown(ListFields(config));
  EXPECT_THAT(page, HasSubstr("## Top level"));
  EXPECT_THAT(page, HasSubstr("| `flag` | `false` |"));
  EXPECT_THAT(page, HasSubstr("## `[inner]`"));
  EXPECT_THAT(page, HasSubstr("| `speed` | `1.5` | -10 to 1e+300 | m/s | How fast. |"));
  EXPECT_THAT(page, HasSubstr("`fast`, `slow`"));
  EXPECT_THAT(page, HasSubstr("| `gear` | `\"second\"` | `first`, `second`, `reverse` |  | "
                              "Which gear. |"));
}

TEST(ConfigPrintTest, SectionsFollowTheirFields) {
  const std::string text = ToToml(Outer{});
  EXPECT_THAT(text, StartsWith("flag = false\ncount = 3\n"));
  EXPECT_THAT(text, EndsWith("[inner]\nspeed = 1.5\nkind = \"fast\"\ngear = \"second\"\n"));
}

/// Keys that are read with choices of their own section, of another one, and in a chain.
struct WithChoices {
  struct Tool {
    std::string kind = "none";
    double speed = 1.0;
    int teeth = 4;
    bool is_counted = false;
    int most = 9;
    template <class Visitor>
    void Visit(Visitor& v) {
      v("kind", kind, base::OneOf{"none", "saw", "drill", "file"}, "", "Which tool.");
      v("speed", speed, base::Range{0.0, 9.0}, "", "Speed.");
      v("teeth", teeth, base::Range{0, 9}, "", "Teeth.", base::ReadIf{"kind", {"saw", "file"}});
      v("is_counted", is_counted, "Count cuts.");
      v("most", most, base::Range{0, 9}, "", "Most cuts.", base::ReadIf{"is_counted"});
    }
  };
  Tool tool;
  Gear gear = Gear::kSecond;
  int clutch = 1;
  template <class Visitor>
  void Visit(Visitor& v) {
    v("gear", gear, "Which gear.");
    v("clutch", clutch, base::Range{0, 9}, "", "Clutch.", base::ReadIf{"gear", {"reverse"}});
    v.Section("tool", tool, "The tool.", base::ReadIf{"tool.kind"});
  }
};

std::string UnreadOf(const std::vector<std::string>& overrides) {
  WithChoices config = Load<WithChoices>(std::nullopt, overrides), defaults;
  try {
    RequireRead(ListFields(config), ListFields(defaults));
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

TEST(ConfigReadTest, WhatNothingReadsHasItsDefault) {
  EXPECT_EQ(UnreadOf({}), "");
  EXPECT_EQ(UnreadOf({"tool.speed=2"}),
            "tool.speed is 2.0, expected its default 1.0 with tool.kind = \"none\", with which "
            "nothing reads it");
  EXPECT_EQ(UnreadOf({"tool.speed=1"}), "") << "at its default";
  EXPECT_EQ(UnreadOf({"tool.speed=2", "tool.kind=drill"}), "");
  EXPECT_EQ(UnreadOf({"tool.kind=drill", "tool.teeth=3", "clutch=2"}),
            "clutch is 2, expected its default 1 with gear = \"second\", as it is read with "
            "\"reverse\" alone; tool.teeth is 3, expected its default 4 with tool.kind = "
            "\"drill\", as it is read with \"saw\" or \"file\" alone");
  EXPECT_EQ(UnreadOf({"tool.kind=file", "tool.teeth=3", "gear=reverse", "clutch=2"}), "");
  EXPECT_THAT(UnreadOf({"tool.kind=saw", "tool.most=1"}), HasSubstr("tool.is_counted = false"));
  EXPECT_THAT(UnreadOf({"tool.is_counted=true", "tool.most=1"}),
              AllOf(HasSubstr("tool.is_counted is true"), HasSubstr("tool.most is 1")));
  EXPECT_EQ(UnreadOf({"tool.kind=saw", "tool.is_counted=true", "tool.most=1"}), "");
}

TEST(ConfigReadTest, WhatNothingReadsIsResetAndTheRestIsKept) {
  // `most` is read until `is_counted`, with which it is, has its default.
  const std::vector<std::string> overrides = {"tool.speed=2", "tool.is_counted=true", "tool.most=1",
                                              "gear=reverse"};
  WithChoices config = Load<WithChoices>(std::nullopt, overrides), defaults;
  ResetUnread(ListFields(config), ListFields(defaults));
  EXPECT_EQ(PrintChanges(ListFields(config), ListFields(defaults)), "gear = \"reverse\"\n");
}

TEST(ConfigReadTest, ThePageSaysWithWhatAKeyIsRead) {
  WithChoices config;
  const std::string page = PrintMarkdown(ListFields(config));
  EXPECT_THAT(page, HasSubstr("| Clutch. Read with `gear` = `reverse`. |"));
  EXPECT_THAT(page, HasSubstr("The tool. Not read with `kind` = `\"none\"`.\n"));
  EXPECT_THAT(page, HasSubstr("| Which tool. |"));
  EXPECT_THAT(page, HasSubstr("| Speed. |")) << "the section says it for all";
  EXPECT_THAT(page, HasSubstr("| Teeth. Read with `kind` = `saw`, `file`. |"));
  EXPECT_THAT(page, HasSubstr("| Most cuts. Not read with `is_counted` = `false`. |"));
}

}  // namespace
}  // namespace slalom::config
