// What files of the repository say about one another is true: no path, link or section that is not
// there, and nothing that lies outside.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/architecture/repository.h"

namespace slalom::architecture {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const Repository& Ours() {
  static const Repository repository = ReadRepository(SLALOM_SOURCE_DIR);
  return repository;
}

std::string Lines(const std::vector<std::string>& faults) {
  std::string lines;
  for (const std::string& fault : faults) lines += fault + "\n";
  return lines;
}

TEST(References, TheRepositoryIsRead) {
  EXPECT_TRUE(Ours().texts.contains("README.md"));
  EXPECT_TRUE(Ours().texts.contains("tests/architecture/repository.cc"));
  for (const char* path : {"docs/images", "base", "policy/CMakeLists.txt", "configs/fast.toml"}) {
    EXPECT_TRUE(Ours().paths.contains(path)) << path;
  }
}

TEST(References, EveryPathIsThere) { EXPECT_EQ(Lines(BrokenPaths(Ours())), ""); }

TEST(References, EveryLinkLeadsSomewhere) { EXPECT_EQ(Lines(BrokenLinks(Ours())), ""); }

TEST(References, EverySectionIsThere) { EXPECT_EQ(Lines(BrokenSections(Ours())), ""); }

TEST(References, NothingOutsideIsMentioned) {
  EXPECT_EQ(Lines(MentionsOfOtherMaterial(Ours())), "");
}

/// A repository of a page with a heading, a header, and one more file.
Repository With(const std::string& path, const std::string& text) {
  Repository repository;
  repository.texts = {{"docs/page.md", "# Page\n## Far `away`, isn't it?\n## Twice\n## Twice\n"},
                      {"sim/lidar.h", ""},
                      {path, text}};
  for (const auto& [name, content] : repository.texts) repository.paths.insert(name);
  repository.paths.insert({"docs", "sim", "tests", "tests/fuzz", "configs"});
  return repository;
}

TEST(References, BrokenPathsAreFound) {
  const auto faults = [](const std::string& text, const std::string& path = "sim/a.cc") {
    return BrokenPaths(With(path, text));
  };
  EXPECT_THAT(faults("\n\n// See docs/gone.md.\n"),
              ElementsAre("sim/a.cc:3: docs/gone.md is not there"));
  EXPECT_THAT(faults("// gone.md says more."), SizeIs(1));
  EXPECT_THAT(faults("\"see docs/gone.md\""), SizeIs(1));
  EXPECT_THAT(faults("#include \"sim/gone.h\""), SizeIs(1));
  EXPECT_THAT(faults("# configs/gone.toml", "configs/a.toml"), SizeIs(1));
  EXPECT_THAT(faults("# As gone.toml; see old/a.toml.", "configs/new/a.toml"), SizeIs(2));
  EXPECT_THAT(faults("in `tests/gone/`", "README.md"), SizeIs(1));
  EXPECT_THAT(faults("in ../sim/gone.md", "docs/b.md"), SizeIs(1));
  EXPECT_THAT(faults("`sim/lidar.{h,cc}`", "README.md"), ElementsAre(HasSubstr("sim/lidar.cc")));
  EXPECT_THAT(faults("// docs/gone.md", "tests/a_test.cc"), SizeIs(1));
  EXPECT_THAT(faults("\"docs/gone.md\"", "tests/a_test.cc"), SizeIs(1));

  EXPECT_THAT(faults("// See docs/page.md, page.md, sim/lidar.h. In tests/fuzz/, too."), IsEmpty());
  EXPECT_THAT(faults("docs/page.md#twice page.md ../docs/page.md", "docs/b.md"), IsEmpty());
  EXPECT_THAT(faults("# As a.toml, new/a.toml, configs/new/a.toml.", "configs/new/a.toml"),
              IsEmpty());
  EXPECT_THAT(faults("Write(\"sim/own.csv\");", "tests/a_test.cc"), IsEmpty());
  EXPECT_THAT(faults("// train/test, sim/real, docs/*.md, configs/{name}.toml, sim/a.{cc}"),
              IsEmpty());
  EXPECT_THAT(
      faults("// RJ:configs/a.yaml, $dir/docs/a.md, https://a.org/docs/a.md, runs/x/report.md"),
      IsEmpty());
}

TEST(References, BrokenLinksAreFound) {
  const auto faults = [](const std::string& text, const std::string& path = "docs/b.md") {
    return BrokenLinks(With(path, text));
  };
  EXPECT_THAT(faults("a\n[page](gone.md)"),
              ElementsAre("docs/b.md:2: link to gone.md, which is not there"));
  EXPECT_THAT(faults("[page](docs/page.md)"), SizeIs(1));
  EXPECT_THAT(faults("[one](page.md), [two](page.md#near)"),
              ElementsAre(HasSubstr("no such heading")));
  EXPECT_THAT(faults("# Here\n[here](#there)"), SizeIs(1));
  EXPECT_THAT(faults("![picture](images/gone.png)"), SizeIs(1));
  EXPECT_THAT(faults("[page](page.md#twice-2)"), SizeIs(1));

  EXPECT_THAT(
      faults("[a](page.md) [b](page.md#far-away-isnt-it) [c](page.md#twice-1) [d](../sim/lidar.h)"),
      IsEmpty());
  EXPECT_THAT(faults("# Here\n[here](#here) [there](https://example.org/a#b)"), IsEmpty());
  EXPECT_THAT(faults("[page](docs/page.md)", "README.md"), IsEmpty());
  EXPECT_THAT(faults("```\n[page](gone.md)\n```"), IsEmpty());
}

TEST(References, BrokenSectionsAreFound) {
  const auto faults = [](const std::string& text) {
    Repository repository = With("sim/a.h", text);
    repository.texts["docs/original-system.md"] = "# A\n## 1. B\n### 1.2 C\n## 3. D\n";
    return BrokenSections(repository);
  };
  EXPECT_THAT(faults("\n// (docs/original-system.md, section 1.3)"),
              ElementsAre("sim/a.h:2: docs/original-system.md has no section 1.3"));
  EXPECT_THAT(faults("/// docs/original-system.md, sections 1.2 and 2. Then"), SizeIs(1));
  EXPECT_THAT(faults("/// docs/original-system.md,\n/// section 4"), SizeIs(1));
  EXPECT_THAT(faults("[original-system.md](original-system.md), section 4"), SizeIs(1));
  EXPECT_THAT(
      faults(
          "docs/original-system.md, sections 1.2 and 3, F3; original-system.md,\n  /// section 1."),
      IsEmpty());
}

TEST(References, MentionsOfOtherMaterialAreFound) {
  const auto faults = [](const std::string& text) {
    return MentionsOfOtherMaterial(With("docs/b.md", text));
  };
  EXPECT_THAT(faults(std::string("a\nin ../share") + "d/barn"),
              ElementsAre(HasSubstr("docs/b.md:2: ")));
  EXPECT_THAT(faults(std::string("(paper") + ".tex)"), SizeIs(1));
  EXPECT_THAT(faults(std::string("feasibility") + ".md"), SizeIs(1));
  EXPECT_THAT(faults("/usr/share/slalom, feasibility, un" + std::string("share") + "d/"),
              IsEmpty());
}

}  // namespace
}  // namespace slalom::architecture
