#include "tests/architecture/repository.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>
#include <sstream>

namespace slalom::architecture {
namespace {

namespace fs = std::filesystem;

/// The folders that hold no code. Those with code have a CMakeLists.txt.
constexpr std::string_view kDataFolders[] = {"cmake", "configs", "deploy", "docs"};

constexpr std::string_view kTextExtensions[] = {".md",  ".h",     ".cc",   ".toml", ".py",
                                                ".sh",  ".js",    ".html", ".yml",  ".cmake",
                                                ".txt", ".proto", ".inc"};

/// Holds examples of what the rules refuse.
constexpr std::string_view kExamples = "tests/architecture/references_test.cc";

/// What documentation names though it is not there: files that a program writes, and a stand-in for
/// a name.
constexpr std::string_view kNotHere[] = {"report.md", "physics.md", "FILE.md"};

bool IsFolderOfRepository(const fs::path& path) {
  return fs::exists(path / "CMakeLists.txt") ||
         std::find(std::begin(kDataFolders), std::end(kDataFolders), path.filename()) !=
             std::end(kDataFolders);
}

bool IsText(const fs::path& path) {
  const std::string extension = path.extension().string();
  return std::find(std::begin(kTextExtensions), std::end(kTextExtensions), extension) !=
             std::end(kTextExtensions) ||
         path.filename() == "Dockerfile" || path.filename() == "slalom";
}

std::string ParentOf(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

std::string Join(const std::string& folder, const std::string& path) {
  return (fs::path(folder) / path).lexically_normal().generic_string();
}

std::string Place(const std::string& path, const std::string& text, std::size_t offset) {
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(offset);
  return path + ":" + std::to_string(1 + std::count(text.begin(), end, '\n')) + ": ";
}

bool Exists(const Repository& repository, std::string path) {
  while (path.ends_with('/')) path.pop_back();
  if (repository.paths.contains(path)) return true;
  // Made by protoc.
  return path.ends_with(".pb.h") &&
         repository.paths.contains(path.substr(0, path.size() - 5) + ".proto");
}

/// What `token` stands for: "a.{h,cc}" for two paths; nothing for a pattern or a stand-in.
std::vector<std::string> Expand(const std::string& token) {
  const std::size_t open = token.find('{'), close = token.find('}');
  if (token.find('*') != std::string::npos) return {};
  if (open == std::string::npos) return {token};
  if (close == std::string::npos || close < open) return {};
  std::stringstream choices(token.substr(open + 1, close - open - 1));
  std::vector<std::string> expanded;
  for (std::string choice; std::getline(choices, choice, ',');) {
    expanded.push_back(token.substr(0, open) + choice + token.substr(close + 1));
  }
  return expanded.size() > 1 ? expanded : std::vector<std::string>{};
}

bool IsPathCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) ||
         std::string_view("_-./{},*").find(c) != std::string_view::npos;
}

/// A path that begins after one of these is not one from the root: "RJ:configs/a.yaml",
/// "$root/docs", "<dir>/docs".
bool MayPrecedePath(char c) {
  return std::string_view(":$~<>)]}@%=").find(c) == std::string_view::npos;
}

/// Whether the place lies in a comment: after // or # on its line.
bool IsInComment(const std::string& text, std::size_t offset) {
  const std::size_t begin = text.rfind('\n', offset) + 1;
  const std::string_view before = std::string_view(text).substr(begin, offset - begin);
  return before.find("//") != std::string_view::npos || before.find('#') != std::string_view::npos;
}

bool IsTestCode(const std::string& path) {
  return path.starts_with("tests/") &&
         (path.ends_with(".cc") || path.ends_with(".h") || path.ends_with(".py"));
}

/// Whether a word is taken for a path from the root, and not for one from elsewhere or an
/// alternative as in "train/test": it begins with a folder of the repository, and ends with a slash
/// or has an extension.
bool IsPathFromRoot(const Repository& repository, const std::string& word) {
  const std::size_t first = word.find('/');
  if (first == std::string::npos || !repository.paths.contains(word.substr(0, first))) return false;
  return word.ends_with('/') || word.find('.', word.rfind('/')) != std::string::npos;
}

/// The places where `word`, in the file at `path`, may lie: it is broken if it is at none of them.
/// Empty if it refers to nothing.
std::vector<std::string> Candidates(const Repository& repository, const std::string& path,
                                    const std::string& word, bool counts_everywhere) {
  const std::string folder = ParentOf(path);
  if (IsPathFromRoot(repository, word)) {
    return counts_everywhere || word.starts_with("docs/") ? std::vector<std::string>{word}
                                                          : std::vector<std::string>{};
  }
  const bool is_bare = word.find('/') == std::string::npos;
  if (word.ends_with(".md") && is_bare && word.size() > 3)
    return {Join(folder, word), word, "docs/" + word};
  if (word.ends_with(".md") && word.starts_with("../") && path.ends_with(".md")) {
    return {Join(folder, word)};
  }
  if (word.ends_with(".toml") && path.starts_with("configs/")) {
    std::vector<std::string> candidates;
    for (std::string above = folder; !above.empty(); above = ParentOf(above)) {
      candidates.push_back(Join(above, word));
    }
    return candidates;
  }
  return {};
}

/// Why a word of the file at `path` refers to something that is not there; empty if it does not.
std::string FaultOfWord(const Repository& repository, const std::string& path, std::string word,
                        bool counts_everywhere) {
  while (!word.empty() && std::string_view(".,-").find(word.back()) != std::string_view::npos) {
    word.pop_back();
  }
  for (const std::string& choice : Expand(word)) {
    if (std::find(std::begin(kNotHere), std::end(kNotHere), choice) != std::end(kNotHere)) continue;
    const std::vector<std::string> candidates =
        Candidates(repository, path, choice, counts_everywhere);
    const auto exists = [&](const std::string& candidate) { return Exists(repository, candidate); };
    if (!candidates.empty() && std::none_of(candidates.begin(), candidates.end(), exists)) {
      return choice + " is not there";
    }
  }
  return "";
}

/// A Markdown file's lines, with those of code blocks emptied.
std::vector<std::string> LinesOutsideCode(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  bool is_code = false;
  for (std::string line; std::getline(in, line);) {
    const bool is_fence = line.find("```") != std::string::npos;
    lines.push_back(is_fence || is_code ? "" : line);
    if (is_fence) is_code = !is_code;
  }
  return lines;
}

std::set<std::string> AnchorsOf(const std::string& text) {
  std::set<std::string> anchors;
  std::map<std::string, int> counts;
  for (const std::string& line : LinesOutsideCode(text)) {
    const std::size_t level = line.find_first_not_of('#');
    if (level == 0 || level == std::string::npos || line[level] != ' ') continue;
    const std::string anchor = AnchorOf(line.substr(level + 1));
    const int count = counts[anchor]++;
    anchors.insert(count == 0 ? anchor : anchor + "-" + std::to_string(count));
  }
  return anchors;
}

/// Why a link of the file at `path` leads nowhere; empty if it leads somewhere or outside.
std::string FaultOfLink(const Repository& repository, const std::string& path,
                        const std::string& target) {
  if (target.find("://") != std::string::npos || target.starts_with("mailto:")) return "";
  const std::size_t hash = target.find('#');
  const std::string file = hash == 0 ? path : Join(ParentOf(path), target.substr(0, hash));
  if (!Exists(repository, file)) return "link to " + target + ", which is not there";
  if (hash == std::string::npos) return "";
  const auto text = repository.texts.find(file);
  if (text != repository.texts.end() && AnchorsOf(text->second).contains(target.substr(hash + 1)))
    return "";
  return "link to " + target + ": " + file + " has no such heading";
}

}  // namespace

Repository ReadRepository(const fs::path& root) {
  Repository repository;
  const auto add = [&](const fs::directory_entry& entry) {
    const std::string path = entry.path().lexically_relative(root).generic_string();
    repository.paths.insert(path);
    if (!entry.is_regular_file() || !IsText(entry.path()) || path == kExamples) return;
    std::ifstream in(entry.path());
    repository.texts[path] = {std::istreambuf_iterator<char>(in), {}};
  };
  for (const fs::directory_entry& entry : fs::directory_iterator(root)) {
    if (!entry.is_directory()) {
      add(entry);
    } else if (IsFolderOfRepository(entry.path())) {
      add(entry);
      for (const fs::directory_entry& inner : fs::recursive_directory_iterator(entry.path())) {
        add(inner);
      }
    }
  }
  return repository;
}

std::vector<std::string> BrokenPaths(const Repository& repository) {
  std::vector<std::string> faults;
  for (const auto& [path, text] : repository.texts) {
    for (std::size_t begin = 0; begin < text.size();) {
      if (!IsPathCharacter(text[begin])) {
        ++begin;
        continue;
      }
      std::size_t end = begin;
      while (end < text.size() && IsPathCharacter(text[end])) ++end;
      if (begin == 0 || MayPrecedePath(text[begin - 1])) {
        const bool counts = !IsTestCode(path) || IsInComment(text, begin);
        const std::string fault =
            FaultOfWord(repository, path, text.substr(begin, end - begin), counts);
        if (!fault.empty()) faults.push_back(Place(path, text, begin) + fault);
      }
      begin = end;
    }
  }
  return faults;
}

std::vector<std::string> BrokenLinks(const Repository& repository) {
  std::vector<std::string> faults;
  for (const auto& [path, text] : repository.texts) {
    if (!path.ends_with(".md")) continue;
    const std::vector<std::string> lines = LinesOutsideCode(text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      for (std::size_t at = lines[i].find("]("); at != std::string::npos;
           at = lines[i].find("](", at + 1)) {
        const std::size_t end = lines[i].find(')', at);
        if (end == std::string::npos) continue;
        const std::string fault =
            FaultOfLink(repository, path, lines[i].substr(at + 2, end - at - 2));
        if (!fault.empty()) faults.push_back(path + ":" + std::to_string(i + 1) + ": " + fault);
      }
    }
  }
  return faults;
}

std::vector<std::string> BrokenSections(const Repository& repository) {
  static constexpr std::string_view kPage = "original-system.md";
  std::set<std::string> sections;
  const auto page = repository.texts.find("docs/original-system.md");
  if (page != repository.texts.end()) {
    for (const std::string& line : LinesOutsideCode(page->second)) {
      if (!line.starts_with("##")) continue;
      const std::size_t begin = line.find_first_not_of("# ");
      std::string number = line.substr(begin, line.find(' ', begin) - begin);
      if (number.ends_with('.')) number.pop_back();
      sections.insert(number);
    }
  }
  std::vector<std::string> faults;
  for (const auto& [path, text] : repository.texts) {
    for (std::size_t at = text.find(kPage); at != std::string::npos;
         at = text.find(kPage, at + 1)) {
      // What may stand between the page and the numbers, over a line break, too: ", sections ".
      std::size_t i = at + kPage.size();
      const std::string& body = text;  // clang 14 lets no lambda use a structured binding.
      const auto skip = [&](std::string_view characters) {
        while (i < body.size() && characters.find(body[i]) != std::string_view::npos) ++i;
      };
      skip("),` \n/#");
      if (text.compare(i, 7, "section") != 0) continue;
      i += 7;
      skip("s \n/#");
      while (i < text.size() && std::isdigit(static_cast<unsigned char>(text[i]))) {
        std::size_t end = i;
        while (end < text.size() &&
               (std::isdigit(static_cast<unsigned char>(text[end])) || text[end] == '.'))
          ++end;
        std::string number = text.substr(i, end - i);
        if (number.ends_with('.')) number.pop_back();
        if (!sections.contains(number)) {
          faults.push_back(Place(path, text, at) + "docs/original-system.md has no section " +
                           number);
        }
        i = end;
        skip(" \n/#");
        if (text.compare(i, 4, "and ") != 0) break;
        i += 4;
      }
    }
  }
  return faults;
}

std::vector<std::string> MentionsOfOtherMaterial(const Repository& repository) {
  // Put together from parts, as this file is read, too.
  const std::string words[] = {std::string("share") + "d/", std::string("paper") + ".tex",
                               std::string("feasibility") + ".md"};
  std::vector<std::string> faults;
  for (const auto& [path, text] : repository.texts) {
    if (path == "slalom") continue;  // It looks for the published worlds beside the checkout.
    for (const std::string& word : words) {
      for (std::size_t at = text.find(word); at != std::string::npos;
           at = text.find(word, at + 1)) {
        const bool is_part = at > 0 && (std::isalnum(static_cast<unsigned char>(text[at - 1])) ||
                                        text[at - 1] == '_' || text[at - 1] == '-');
        if (!is_part) faults.push_back(Place(path, text, at) + "no clone contains " + word);
      }
    }
  }
  return faults;
}

std::string AnchorOf(std::string_view heading) {
  std::string anchor;
  for (std::size_t i = 0; i < heading.size(); ++i) {
    const auto c = static_cast<unsigned char>(heading[i]);
    if (heading.substr(i, 2) == "](") {  // Of a link only the text counts.
      i = std::min(heading.find(')', i), heading.size() - 1);
    } else if (std::isalnum(c) || c == '_' || c == '-' || c >= 0x80) {
      anchor += static_cast<char>(std::tolower(c));
    } else if (c == ' ') {
      anchor += '-';
    }
  }
  return anchor;
}

}  // namespace slalom::architecture
