// Design rules as lint rules: what ARCHITECTURE.md and CONTRIBUTING.md say of the tree, read off
// the tree.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "tests/architecture/map.h"

namespace slalom::architecture {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::IsEmpty;
using testing::Not;

/// The map of ARCHITECTURE.md: which folders each folder may include.
const Map& OurMap() {
  static const Map map = ReadMap(ReadPage());
  return map;
}

/// Each heavy library, by how its headers begin, and the folders that may know it.
const std::map<std::string, Names>& Homes() {
  static const Names torch = {"policy",       "policy/nn",       "policy/nn/kernels", "learner",
                              "learner/loop", "learner/service", "app/train",         "app/cli"};
  static const std::map<std::string, Names> homes = {
      {"torch/", torch},
      {"ATen/", torch},
      {"c10/", torch},
      {"box2d/", {"sim"}},
      {"ode/", {"sim/engines/ode"}},
      {"mujoco/", {"sim/engines/mujoco"}},
      {"Eigen/",
       {"sim/engines/jackal", "sim/engines/ode", "sim/engines/mujoco", "planners/guard",
        "planners/localisation", "planners/mppi", "planners/teb", "env/sensing"}},
      {"tinyxml2.h", {"sim/courses"}},
      {"cairo", {"sim/pictures"}},
      {"toml++/", {"base"}},
      {"CLI/", {"app/cli"}},
      {"spdlog/", {"base"}},
      {"xxhash.h", {"base"}},
      {"lzma.h", {"app/sweep"}},
      {"zmq", {"proto/transport"}},
      {"google/", {"proto", "learner/run"}},
      {"proto/slalom.pb.h", {"proto"}},
      {"learner/run/tensorboard.pb.h", {"learner/run"}},
      {"prometheus/", {"metrics"}},
  };
  return homes;
}

struct SourceFile {
  fs::path path;  ///< From the root.
  std::vector<std::string> lines;

  std::string folder() const { return OurMap().FolderOf(path); }
  /// The folder whose rules it follows: tests and benchmarks of a folder may include what it may.
  bool is_program_code() const { return folder() != "tests" && folder() != "benchmarks"; }
};

std::vector<SourceFile> ReadTree() {
  static constexpr std::string_view kSkipped[] = {"build", "runs", ".git", "shared"};
  const fs::path root = SLALOM_SOURCE_DIR;
  std::vector<SourceFile> files;
  for (auto it = fs::recursive_directory_iterator(root); it != fs::recursive_directory_iterator();
       ++it) {
    const std::string name = it->path().filename().string();
    if (it->is_directory() && it.depth() == 0 &&
        (name.starts_with(".") ||
         std::find(std::begin(kSkipped), std::end(kSkipped), name) != std::end(kSkipped))) {
      it.disable_recursion_pending();
      continue;
    }
    const std::string extension = it->path().extension().string();
    if (extension != ".h" && extension != ".cc" && extension != ".inc") continue;
    SourceFile file{fs::relative(it->path(), root), {}};
    std::ifstream in(it->path());
    for (std::string line; std::getline(in, line);) file.lines.push_back(line);
    files.push_back(std::move(file));
  }
  return files;
}

struct Include {
  std::string target;
  bool quoted = false;
};

/// What a line includes; an empty target: nothing.
Include ParseInclude(std::string_view line) {
  const auto skip_spaces = [&line] {
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  };
  skip_spaces();
  if (!line.starts_with('#')) return {};
  line.remove_prefix(1);
  skip_spaces();
  if (!line.starts_with("include")) return {};
  line.remove_prefix(7);
  skip_spaces();
  if (line.empty() || (line[0] != '"' && line[0] != '<')) return {};
  const bool quoted = line[0] == '"';
  line.remove_prefix(1);
  return {std::string(line.substr(0, line.find(quoted ? '"' : '>'))), quoted};
}

std::string Place(const SourceFile& file, std::size_t line) {
  return file.path.string() + ":" + std::to_string(line + 1);
}

/// The rules on #include lines that a file breaks, one sentence each.
std::vector<std::string> IncludeFaults(const SourceFile& file) {
  std::vector<std::string> faults;
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    const auto [target, quoted] = ParseInclude(file.lines[i]);
    if (target.empty()) continue;
    if (file.is_program_code()) {
      for (const auto& [prefix, homes] : Homes()) {
        if (target.starts_with(prefix) && !homes.contains(file.folder())) {
          faults.push_back(Place(file, i) + ": <" + target + "> is at home elsewhere");
        }
      }
    }
    if (!quoted) continue;
    const std::string folder = OurMap().FolderOf(target);
    const bool is_ours = OurMap().Has(folder) || folder == "tests" || folder == "benchmarks";
    if (target.starts_with(".") || !is_ours) {
      faults.push_back(Place(file, i) + ": \"" + target + "\" is not a path from the root");
      continue;
    }
    if (!file.is_program_code()) continue;
    if (!OurMap().Has(file.folder())) {
      faults.push_back(Place(file, i) + ": folder " + file.folder() + " is not on the map");
    } else if (folder != file.folder() && !OurMap().Allows(file.folder(), folder)) {
      faults.push_back(Place(file, i) + ": " + file.folder() + "/ may not include " + target);
    }
  }
  return faults;
}

/// A source includes its own header first, so that each header is compiled with nothing before it.
std::vector<std::string> OwnHeaderFaults(const SourceFile& file) {
  fs::path header = file.path;
  header.replace_extension(".h");
  if (file.path.extension() != ".cc" || !fs::exists(fs::path(SLALOM_SOURCE_DIR) / header)) {
    return {};
  }
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    const std::string target = ParseInclude(file.lines[i]).target;
    if (target.empty()) continue;
    if (target == header.string()) return {};
    return {Place(file, i) + ": <" + target + "> stands before \"" + header.string() + "\""};
  }
  return {file.path.string() + ": does not include \"" + header.string() + "\""};
}

/// The rules on names and text that a file breaks.
std::vector<std::string> TextFaults(const SourceFile& file) {
  std::vector<std::string> faults;
  const std::string stem = file.path.stem().string();
  for (const std::string_view word : {"util", "helper", "common", "manager", "misc"}) {
    if (stem.find(word) != std::string::npos) {
      faults.push_back(file.path.string() + ": the name '" + std::string(word) + "' says nothing");
    }
  }
  // Put together from parts, as this file is read, too.
  const std::vector<std::string> forbidden = {std::string("#if") + " 0",
                                              std::string("DISABLED") + "_",
                                              std::string("TO") + "DO", std::string("FIX") + "ME"};
  const std::vector<std::string> forbidden_in_tests = {
      std::string("sleep") + "_for", std::string("sleep") + "_until", std::string("usleep") + "("};
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    const auto look_for = [&](const std::vector<std::string>& words) {
      for (const std::string& word : words) {
        if (file.lines[i].find(word) != std::string::npos) {
          faults.push_back(Place(file, i) + ": " + word);
        }
      }
    };
    look_for(forbidden);
    if (file.folder() == "tests") look_for(forbidden_in_tests);
  }
  if (file.path.extension() == ".h" &&
      std::find(file.lines.begin(), file.lines.end(), "#pragma once") == file.lines.end()) {
    faults.push_back(file.path.string() + ": no #pragma once");
  }
  return faults;
}

std::string_view Trimmed(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  return line;
}

/// A short literal between two others was cut by the formatter when they grew: it is to be joined.
std::vector<std::string> LiteralFaults(const SourceFile& file) {
  constexpr std::size_t kShort = 12;
  std::vector<std::string> faults;
  for (std::size_t i = 1; file.is_program_code() && i + 1 < file.lines.size(); ++i) {
    const std::string_view line = Trimmed(file.lines[i]);
    const bool is_short = line.size() > 1 && line.size() < kShort + 2 && line.front() == '"' &&
                          line.find('"', 1) == line.size() - 1 && !line.ends_with("\\n\"");
    if (is_short && file.lines[i - 1].ends_with('"') &&
        Trimmed(file.lines[i + 1]).starts_with('"')) {
      faults.push_back(Place(file, i) + ": join " + std::string(line) + " to what is around it");
    }
  }
  return faults;
}

template <class Rule>
std::string FaultsOfTree(Rule rule) {
  std::ostringstream out;
  for (const SourceFile& file : ReadTree()) {
    for (const std::string& fault : rule(file)) out << fault << "\n";
  }
  return out.str();
}

/// A namespace stands in the table beside its folder.
std::vector<std::string> NamespaceFaults(const SourceFile& file) {
  static const std::string kBegin = "namespace slalom::";
  if (!file.is_program_code()) return {};
  std::vector<std::string> faults;
  const std::string top = TopOf(file.folder());
  const auto row = OurMap().namespaces.find(top);
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    if (!file.lines[i].starts_with(kBegin)) continue;
    const std::string rest = file.lines[i].substr(kBegin.size());
    const std::string name = rest.substr(0, rest.find_first_of(": {"));
    if (row == OurMap().namespaces.end() || !row->second.contains(name)) {
      faults.push_back(Place(file, i) + ": namespace " + name + " is not one of " + top + "/");
    }
  }
  return faults;
}

TEST(ArchitectureTest, EveryFolderOfTheMapIsInTheTree) {
  Names folders;
  for (const SourceFile& file : ReadTree()) {
    folders.insert(OurMap().NameOf(file.folder()));
    folders.insert(TopOf(file.folder()));
  }
  for (const std::string& folder : OurMap().Folders()) EXPECT_THAT(folders, Contains(folder));
}

// Otherwise the map would show what is not there.
TEST(ArchitectureTest, EveryEdgeOfTheMapIsUsed) {
  std::map<std::string, Names> used;
  for (const SourceFile& file : ReadTree()) {
    for (const std::string& line : file.lines) {
      const auto [target, quoted] = ParseInclude(line);
      if (quoted) used[OurMap().RowOf(file.folder())].insert(OurMap().FolderOf(target));
    }
  }
  std::ostringstream unused;
  for (const auto& [folder, allowed] : OurMap().rows) {
    for (const std::string& name : allowed) {
      const bool is_used = std::ranges::any_of(used[folder], [&](const std::string& included) {
        return OurMap().Covers(name, included);
      });
      if (!is_used) unused << folder << "/ includes nothing of " << name << "/\n";
    }
  }
  EXPECT_EQ(unused.str(), "");
}

TEST(ArchitectureTest, NamespacesAreThoseOfTheMap) { EXPECT_EQ(FaultsOfTree(NamespaceFaults), ""); }

TEST(ArchitectureTest, IncludesFollowTheMap) { EXPECT_EQ(FaultsOfTree(IncludeFaults), ""); }

TEST(ArchitectureTest, EverySourceIncludesItsOwnHeaderFirst) {
  EXPECT_EQ(FaultsOfTree(OwnHeaderFaults), "");
}

TEST(ArchitectureTest, NamesLengthsAndTextFollowTheStyle) {
  EXPECT_EQ(FaultsOfTree(TextFaults), "");
}

// As CONTRIBUTING.md promises of the next one.
TEST(ArchitectureTest, AnObservedQuantityIsNamedInTwoSources) {
  Names sources;
  for (const SourceFile& file : ReadTree()) {
    if (!file.is_program_code()) continue;
    for (const std::string& line : file.lines) {
      if (line.find("\"mounting\"") == line.npos && line.find(".mounting") == line.npos) continue;
      sources.insert(file.path.string());
    }
  }
  EXPECT_EQ(sources, (Names{"env/state_layout.h", "sim/environments.cc"}));
}

TEST(ArchitectureTest, LiteralsAreJoined) { EXPECT_EQ(FaultsOfTree(LiteralFaults), ""); }

// The rules see what they are there to see.
TEST(ArchitectureTest, EveryRuleRefusesWhatItForbids) {
  const auto include = [](const std::string& path, const std::string& line) {
    return IncludeFaults({path, {line}});
  };
  EXPECT_THAT(include("sim/a.cc", "#include \"replay/table.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("base/a.cc", "#include \"env/action.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("policy/a.cc", "  #  include \"replay/table.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("replay/a.cc", "#include <torch/torch.h>"), Not(IsEmpty()));
  EXPECT_THAT(include("replay/a.cc", "#include \"table.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("replay/a.cc", "#include \"../replay/table.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("attic/a.cc", "#include \"base/check.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("learner/a.cc", "#include \"app/train/trainer.h\""), Not(IsEmpty()));
  // A service stands above the folder it lies in, never the other way round.
  EXPECT_THAT(include("replay/a.cc", "#include \"replay/service/server.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("learner/a.cc", "#include \"replay/service/server.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("replay/a.cc", "#include \"proto/transport/server.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("replay/service/a.cc", "#include <zmq.hpp>"), Not(IsEmpty()));
  EXPECT_THAT(include("replay/service/a.cc", "#include \"proto/slalom.pb.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("replay/service/a.cc", "#include \"learner/learner.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("replay/service/a.cc", "#include \"replay/table.h\""), IsEmpty());
  EXPECT_THAT(include("replay/service/a.cc", "#include \"proto/transport/server.h\""), IsEmpty());
  EXPECT_THAT(include("replay/service/a.cc", "#include \"replay/service/server.h\""), IsEmpty());
  EXPECT_THAT(include("eval/report/page/a.cc", "#include \"sim/courses/course.h\""), IsEmpty());
  EXPECT_THAT(include("eval/report/page/a.cc", "#include \"policy/policy.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("eval/a.cc", "#include \"sim/pictures/animation.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("sim/courses/a.cc", "#include \"sim/lidar.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("sim/a.cc", "#include \"sim/engines/physics.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("learner/run/a.cc", "#include \"policy/policy.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("proto/transport/a.cc", "#include \"proto/messages.h\""), Not(IsEmpty()));
  // Each local planner has a folder of its own and knows none of the others.
  EXPECT_THAT(include("planners/mppi/a.cc", "#include \"planners/navigation/costmap.h\""),
              IsEmpty());
  EXPECT_THAT(include("planners/mppi/a.cc", "#include \"planners/mppi/mppi.h\""), IsEmpty());
  EXPECT_THAT(include("planners/mppi/a.cc", "#include \"planners/dwa/dwa.h\""), Not(IsEmpty()));
  EXPECT_THAT(include("planners/a.cc", "#include \"planners/mppi/mppi.h\""), IsEmpty());
  EXPECT_THAT(include("sim/a.cc", "#include <box2d/box2d.h>"), IsEmpty());
  EXPECT_THAT(include("sim/courses/a.cc", "#include <cairo.h>"), Not(IsEmpty()));
  EXPECT_THAT(include("learner/run/a.cc", "#include <torch/torch.h>"), Not(IsEmpty()));
  EXPECT_THAT(include("learner/a.cc", "#include \"replay/table.h\""), IsEmpty());
  EXPECT_THAT(include("app/cli/a.cc", "#include \"replay/service/server.h\""), IsEmpty());
  EXPECT_THAT(include("tests/sim/a.cc", "#include \"replay/table.h\""), IsEmpty());

  EXPECT_THAT(NamespaceFaults({"sim/a.cc", {"namespace slalom::engines {"}}), IsEmpty());
  EXPECT_THAT(NamespaceFaults({"sim/a.cc", {"namespace slalom::replay {"}}), Not(IsEmpty()));

  const auto literals = [](const std::string& middle) {
    return LiteralFaults({"sim/a.cc", {"  f(\"one \"", "    " + middle, "    \"three\");"}});
  };
  EXPECT_THAT(literals("\"two \""), Not(IsEmpty()));
  EXPECT_THAT(literals("\"two\\n\""), IsEmpty());
  EXPECT_THAT(literals("\"two hundred and two \""), IsEmpty());
  EXPECT_THAT(literals("two"), IsEmpty());

  const std::string own = "#include \"base/file.h\"";
  EXPECT_THAT(OwnHeaderFaults({"base/file.cc", {"// text", own, "#include <map>"}}), IsEmpty());
  EXPECT_THAT(OwnHeaderFaults({"base/file.cc", {"#include <map>", own}}), Not(IsEmpty()));
  EXPECT_THAT(OwnHeaderFaults({"base/file.cc", {}}), Not(IsEmpty()));
  EXPECT_THAT(OwnHeaderFaults({"app/cli/main.cc", {"#include <map>"}}), IsEmpty());

  const auto text = [](const std::string& path, const std::string& line) {
    return TextFaults({path, {"#pragma once", line}});
  };
  EXPECT_THAT(text("sim/string_utils.h", ""), Not(IsEmpty()));
  EXPECT_THAT(text("sim/a.h", std::string("#if") + " 0"), Not(IsEmpty()));
  EXPECT_THAT(text("tests/a.cc", std::string("std::this_thread::sleep") + "_for(1s);"),
              Not(IsEmpty()));
  EXPECT_THAT(text("tests/a.cc", std::string("TEST(A, DISABLED") + "_B)"), Not(IsEmpty()));
  EXPECT_THAT(TextFaults({"sim/a.h", {}}), Not(IsEmpty()));
  EXPECT_THAT(text("sim/a.h", ""), IsEmpty());
}

}  // namespace
}  // namespace slalom::architecture
