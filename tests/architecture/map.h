#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

/// The map of the folders in ARCHITECTURE.md: a table of who may include whom, which is what
/// counts, and a picture of its floors.

namespace slalom::architecture {

using Names = std::set<std::string>;

struct Map {
  /// The folders that each folder with a row may include outside the top-level folder it lies in.
  /// A folder without a row follows the nearest one above it that has one. "sim" stands for what is
  /// in sim/ up to sim/ itself: its lower levels, and not what stands above or beside it.
  std::map<std::string, Names> rows;
  /// The levels inside a top-level folder, from low to high. A folder may include all of the levels
  /// below its own, and nothing else of the same top-level folder. "planners/*" stands for each
  /// folder in planners/ that has no level of its own.
  std::map<std::string, std::vector<Names>> levels;
  /// The namespaces below slalom:: of each top-level folder.
  std::map<std::string, Names> namespaces;
  /// The picture: top-level folders, its highest floor first.
  std::vector<std::vector<std::string>> floors;

  /// Returns the folder of the map that a path from the root lies in, the deepest one; of a path
  /// outside the map its top-level folder.
  std::string FolderOf(const std::filesystem::path& path) const;

  /// Whether a folder has a row or a level, or is "planners/mppi" where "planners/*" has one.
  bool Has(const std::string& folder) const { return !NameOf(folder).empty(); }

  /// Returns the name by which the map has a folder: itself, "planners/*", or nothing.
  std::string NameOf(const std::string& folder) const;

  /// Returns the folder whose row a folder follows; empty if there is none.
  std::string RowOf(std::string folder) const;

  /// Whether `name`, as it stands in a row, allows `included`.
  bool Covers(const std::string& name, const std::string& included) const;
  bool Allows(const std::string& folder, const std::string& included) const;

  /// All folders of the table by name.
  Names Folders() const;
};

/// What stands in a row that allows all other folders.
inline constexpr char kEverything[] = "everything";

/// Returns the top-level folder of a path.
std::string TopOf(const std::string& folder);

/// Returns the text of ARCHITECTURE.md.
std::string ReadPage();

/// Reads the map. Throws `std::runtime_error` if the page lacks a part of it.
Map ReadMap(const std::string& page);

/// Returns what is wrong with a map: an edge up or in a circle, a folder that is on one floor too
/// many or none, in the picture alone, or in a row without being on the map.
std::vector<std::string> FaultsOf(const Map& map);

}  // namespace slalom::architecture
