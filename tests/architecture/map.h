#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

/// The map of the folders, which ARCHITECTURE.md holds three times: as a table of who may include
/// whom, which is what counts, as a picture of floors, and as a drawing of the table.

namespace slalom::architecture {

using Names = std::set<std::string>;

struct Map {
  /// The table: the folders that each folder may include, beside itself. "planners/*" stands for
  /// each folder in planners/ without a row of its own.
  std::map<std::string, Names> edges;
  /// The picture, its highest floor first.
  std::vector<std::vector<std::string>> floors;
  /// The lines of the drawing.
  std::string drawing;

  /// Returns the folder that a path from the root lies in: of two levels where such a one has a
  /// row, else of one.
  std::string FolderOf(const std::filesystem::path& path) const;

  /// Returns the name of the folder's row: itself, "planners/*", or nothing.
  std::string RowOf(const std::string& folder) const;

  bool Has(const std::string& folder) const { return !RowOf(folder).empty(); }
  bool Allows(const std::string& folder, const std::string& included) const;
};

/// Returns the text of ARCHITECTURE.md.
std::string ReadPage();

/// Reads the map. Throws `std::runtime_error` if the page lacks a part of it.
Map ReadMap(const std::string& page);

/// Returns what is wrong with a map: an edge up or in a circle, a folder that is on one floor too
/// many or none, or in the table or the picture alone.
std::vector<std::string> FaultsOf(const Map& map);

/// Draws the edges in Mermaid's language, without those that others imply.
std::string Draw(const std::map<std::string, Names>& edges);

}  // namespace slalom::architecture
