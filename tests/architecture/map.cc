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

/// All folders that a text names: "sim/courses/", "planners/*/".
std::vector<std::string> FoldersIn(const std::string& text) {
  static const std::regex folder(R"(([a-z_]+(/([a-z_]+|\*))*)/(?![a-z_*]))");
  std::vector<std::string> folders;
  for (std::sregex_iterator it(text.begin(), text.end(), folder), end; it != end; ++it) {
    folders.push_back((*it)[1]);
  }
  return folders;
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

std::string Map::RowOf(const std::string& folder) const {
  if (edges.contains(folder)) return folder;
  const std::size_t slash = folder.find('/');
  if (slash == std::string::npos) return "";
  const std::string each = folder.substr(0, slash) + "/*";
  return edges.contains(each) ? each : "";
}

std::string Map::FolderOf(const fs::path& path) const {
  const fs::path parent = path.parent_path();
  if (parent.empty()) return "";
  auto part = parent.begin();
  const std::string top = part->string();
  if (++part == parent.end()) return top;
  const std::string inner = top + "/" + part->string();
  return Has(inner) ? inner : top;
}

bool Map::Allows(const std::string& folder, const std::string& included) const {
  const auto row = edges.find(RowOf(folder));
  return row != edges.end() && row->second.contains(RowOf(included));
}

std::string ReadPage() {
  std::ifstream in(fs::path(SLALOM_SOURCE_DIR) / "ARCHITECTURE.md");
  return {std::istreambuf_iterator<char>(in), {}};
}

Map ReadMap(const std::string& page) {
  Map map;
  std::istringstream table(Between(page, "| folder | may include, beside itself |\n", "\n\n"));
  for (std::string line; std::getline(table, line);) {
    std::vector<std::string> folders = FoldersIn(line);
    if (folders.empty()) continue;
    map.edges[folders.front()] = Names(folders.begin() + 1, folders.end());
  }
  std::istringstream picture(Between(page, "## The house\n\n```\n", "```"));
  map.floors.emplace_back();
  for (std::string line; std::getline(picture, line);) {
    if (line.find("---+---") != std::string::npos) map.floors.emplace_back();
    const std::vector<std::string> folders = FoldersIn(line);
    map.floors.back().insert(map.floors.back().end(), folders.begin(), folders.end());
  }
  map.drawing = Between(page, "```mermaid\n", "```");
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
      if (!map.edges.contains(folder)) faults.push_back(folder + "/ is in the picture alone");
    }
  }
  for (const auto& [folder, allowed] : map.edges) {
    if (!heights.contains(folder)) faults.push_back(folder + "/ is not in the picture");
    if (Reaches(map.edges, folder, folder)) faults.push_back(folder + "/ is part of a circle");
    for (const std::string& included : allowed) {
      if (!map.edges.contains(included)) {
        faults.push_back(folder + "/ may include " + included + "/, which has no row");
      } else if (heights.contains(folder) && heights.contains(included) &&
                 heights[included] > heights[folder]) {
        faults.push_back(folder + "/ may include " + included + "/ on a higher floor");
      }
    }
  }
  return faults;
}

std::string Draw(const std::map<std::string, Names>& edges) {
  const auto node = [](const std::string& folder) {
    std::string id = folder;
    std::ranges::replace(id, '/', '_');
    std::ranges::replace(id, '*', 'x');
    return id == folder ? id : id + "[\"" + folder + "\"]";
  };
  std::string drawing = "graph TD\n";
  for (const auto& [folder, allowed] : edges) {
    std::string targets;
    for (const std::string& included : allowed) {
      const bool is_implied = std::ranges::any_of(allowed, [&](const std::string& other) {
        return other != included && Reaches(edges, other, included);
      });
      if (!is_implied) targets += (targets.empty() ? "" : " & ") + node(included);
    }
    if (!targets.empty()) drawing += "  " + node(folder) + " --> " + targets + "\n";
  }
  return drawing;
}

}  // namespace slalom::architecture
