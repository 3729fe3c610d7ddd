#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

/// The repository as text, and the rules on what its files say about one another. Every rule
/// returns the places that break it, one line each: "FILE:LINE: what is wrong".
///
/// Only the folders and files that belong to the repository are read, not what a user may have
/// beside them: runs, builds, imported courses.

namespace slalom::architecture {

struct Repository {
  std::set<std::string> paths;               ///< Of all files and folders, from the root.
  std::map<std::string, std::string> texts;  ///< Of text files, by path.
};

Repository ReadRepository(const std::filesystem::path& root);

/// Paths that begin with a folder of the repository, such as docs/config.md or tests/fuzz/, and
/// names of Markdown files without a folder. In the code of tests only comments and what lies in
/// docs/ count, as tests make files of their own.
std::vector<std::string> BrokenPaths(const Repository& repository);

/// Relative targets of Markdown links, and their anchors.
std::vector<std::string> BrokenLinks(const Repository& repository);

/// Sections of docs/original-system.md that are cited by number.
std::vector<std::string> BrokenSections(const Repository& repository);

/// Mentions of material that no clone contains.
std::vector<std::string> MentionsOfOtherMaterial(const Repository& repository);

/// The anchor of a Markdown heading, as GitHub makes it, when no earlier heading has the same.
std::string AnchorOf(std::string_view heading);

}  // namespace slalom::architecture
