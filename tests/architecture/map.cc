#include "tests/architecture/map.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace slalom::architecture {
namespace {

namespace fs = std::filesystem;

/// The text between two markers, without them.
std::string Between(const std::string& page, const std::string& begin, const std::string& end) {
  const std::size_t from = page.find(begin);
  const std::size_t to = page.find(end, from + begin.size());
  if (from == std::string::npos || to == std::string::npos) {
    throw std::runtime_error("ARCHITECTURE.md: nothing between '" + begin + "' and '" + end + "'");
  }
  return page.substr(from + begin.size(), to - from - begin.size());
}

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

std::vector<std::string> Matches(const std::string& text, const std::regex& pattern) {
  std::vector<std::string> found;
  for (std::sregex_iterator it(text.begin(), text.end(), pattern), end; it != end; ++it) {
    found.push_back((*it)[1]);
  }
  return found;
}

/// All folders that a text names: "sim/courses/", "planners/*/".
std::vector<std::string> FoldersIn(const std::string& text) {
  static const std::regex folder(R"(([a-z_]+(/([a-z_]+|\*))*)/(?![a-z_*]))");
  return Matches(text, folder);
}

Names NamesIn(const std::string& text) {
  static const std::regex name(R"(`([a-z_]+)`)");
  const std::vector<std::string> names = Matches(text, name);
  return {names.begin(), names.end()};
}

std::string ParentOf(const std::string& folder) {
  const std::size_t slash = folder.rfind('/');
  return slash == std::string::npos ? "" : folder.substr(0, slash);
}

/// The level of a folder inside its top-level folder, by its name; 0 if the latter has no levels.
int LevelOf(const Map& map, const std::string& name) {
  const auto levels = map.levels.find(TopOf(name));
  if (levels == map.levels.end()) return 0;
  const auto level = std::ranges::find_if(levels->second,
                                          [&](const Names& names) { return names.contains(name); });
  return static_cast<int>(level - levels->second.begin());
}

/// The edges between top-level folders.
std::map<std::string, Names> TopEdges(const Map& map) {
  std::map<std::string, Names> edges;
  for (const auto& [folder, allowed] : map.rows) {
    for (const std::string& name : allowed) {
      if (name != kEverything) edges[TopOf(folder)].insert(TopOf(name));
    }
  }
  for (const auto& [folder, allowed] : map.rows) {
    if (!allowed.contains(kEverything)) continue;
    for (const auto& [other, unused] : map.rows) {
      if (TopOf(other) != TopOf(folder)) edges[TopOf(folder)].insert(TopOf(other));
    }
  }
  return edges;
}

/// Whether `to` can be reached from `from` by one edge or more.
bool Reaches(const std::map<std::string, Names>& edges, const std::string& from,
             const std::string& to) {
  Names seen;
  std::vector<std::string> open = {from};
  while (!open.empty()) {
    const auto row = edges.find(open.back());
    open.pop_back();
    if (row == edges.end()) continue;
    for (const std::string& next : row->second) {
      if (next == to) return true;
      if (seen.insert(next).second) open.push_back(next);
    }
  }
  return false;
}

}  // namespace

std::string TopOf(const std::string& folder) { return folder.substr(0, folder.find('/')); }

Names Map::Folders() const {
  Names folders;
  for (const auto& [folder, allowed] : rows) folders.insert(folder);
  for (const auto& [top, inside] : levels) {
    for (const Names& level : inside) folders.insert(level.begin(), level.end());
  }
  return folders;
}

std::string Map::NameOf(const std::string& folder) const {
  const auto inside = levels.find(TopOf(folder));
  const auto is_named = [&](const std::string& name) {
    return rows.contains(name) ||
           (inside != levels.end() && std::ranges::any_of(inside->second, [&](const Names& level) {
              return level.contains(name);
            }));
  };
  if (is_named(folder)) return folder;
  const std::string each = ParentOf(folder) + "/*";
  return is_named(each) ? each : "";
}

std::string Map::FolderOf(const fs::path& path) const {
  std::string folder = path.parent_path().generic_string();
  while (!Has(folder) && folder.find('/') != std::string::npos) folder = ParentOf(folder);
  return folder;
}

std::string Map::RowOf(std::string folder) const {
  while (!folder.empty() && !rows.contains(folder)) folder = ParentOf(folder);
  return folder;
}

bool Map::Covers(const std::string& name, const std::string& included) const {
  if (name == kEverything || name == included) return true;
  return TopOf(name) == TopOf(included) && LevelOf(*this, NameOf(included)) < LevelOf(*this, name);
}

bool Map::Allows(const std::string& folder, const std::string& included) const {
  if (TopOf(folder) == TopOf(included)) {
    return LevelOf(*this, NameOf(included)) < LevelOf(*this, NameOf(folder));
  }
  const auto row = rows.find(RowOf(folder));
  return row != rows.end() && std::ranges::any_of(row->second, [&](const std::string& name) {
           return Covers(name, included);
         });
}

std::string ReadPage() {
  std::ifstream in(fs::path(SLALOM_SOURCE_DIR) / "ARCHITECTURE.md");
  return {std::istreambuf_iterator<char>(in), {}};
}

Map ReadMap(const std::string& page) {
  static const std::string kHead =
      "| folder | may include | inside it, from low to high | namespaces |\n";
  Map map;
  std::istringstream table(Between(page, kHead, "\n\n"));
  for (std::string line; std::getline(table, line);) {
    const std::vector<std::string> cells = Split(line, '|');
    if (cells.size() < 5 || FoldersIn(cells[1]).empty()) continue;
    const std::string folder = FoldersIn(cells[1]).front();
    const std::vector<std::string> allowed = FoldersIn(cells[2]);
    map.rows[folder] = Names(allowed.begin(), allowed.end());
    if (cells[2].find(kEverything) != std::string::npos) map.rows[folder] = {kEverything};
    for (const std::string& level : Split(cells[3], '<')) {
      const std::vector<std::string> names = FoldersIn(level);
      if (!names.empty()) map.levels[folder].emplace_back(names.begin(), names.end());
    }
    if (!NamesIn(cells[4]).empty()) map.namespaces[folder] = NamesIn(cells[4]);
  }
  std::istringstream picture(Between(page, "## The house\n\n```\n", "```"));
  map.floors.emplace_back();
  for (std::string line; std::getline(picture, line);) {
    if (line.find("----") != std::string::npos) map.floors.emplace_back();
    const std::vector<std::string> folders = FoldersIn(line);
    map.floors.back().insert(map.floors.back().end(), folders.begin(), folders.end());
  }
  return map;
}

std::vector<std::string> FaultsOf(const Map& map) {
  std::vector<std::string> faults;
  std::map<std::string, int> heights;
  const int num_floors = static_cast<int>(map.floors.size());
  for (int i = 0; i < num_floors; ++i) {
    for (const std::string& folder : map.floors[i]) {
      if (!heights.emplace(folder, num_floors - i).second) {
        faults.push_back(folder + "/ is in the picture twice");
      }
      if (!map.rows.contains(folder)) faults.push_back(folder + "/ is in the picture alone");
    }
  }
  for (const auto& [folder, allowed] : map.rows) {
    if (!heights.contains(TopOf(folder))) faults.push_back(folder + "/ is not in the picture");
    for (const std::string& name : allowed) {
      if (name != kEverything && !map.Has(name)) {
        faults.push_back(folder + "/ may include " + name + "/, which is not on the map");
      }
    }
  }
  const std::map<std::string, Names> edges = TopEdges(map);
  for (const auto& [folder, included] : edges) {
    if (Reaches(edges, folder, folder)) faults.push_back(folder + "/ is part of a circle");
    for (const std::string& other : included) {
      if (heights.contains(folder) && heights.contains(other) && heights[other] > heights[folder]) {
        faults.push_back(folder + "/ may include " + other + "/ on a higher floor");
      }
    }
  }
  for (const auto& [top, levels] : map.levels) {
    Names seen;
    for (const Names& level : levels) {
      for (const std::string& folder : level) {
        if (TopOf(folder) != top) faults.push_back(folder + "/ is not inside " + top + "/");
        if (!seen.insert(folder).second) faults.push_back(folder + "/ has two levels");
      }
    }
  }
  return faults;
}

}  // namespace slalom::architecture
