#include "app/sweep/report/page_blocks.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <sstream>

#include "app/sweep/report/cross_tables.h"
#include "app/sweep/report/report.h"
#include "base/error.h"

namespace slalom::sweep {
namespace {

constexpr std::string_view kBegin = "<!-- sweep ";
constexpr std::string_view kEnd = "<!-- end of sweep -->";

/// The new text of a block; none: it is of another plan.
std::optional<std::string> BlockText(const std::string& kind, const std::string& name,
                                     std::span<const ReportContent> contents) {
  if (kind == "conclusions" && name == "-->") return MarkdownConclusions(contents);
  for (const ReportContent& content : contents) {
    if (content.plan.sweep.name != name) continue;
    if (kind == "conclusions") return MarkdownConclusions(std::span(&content, 1));
    if (kind == "summary") return "\n" + MarkdownSummary(content);
    const std::vector<eval::Pivot> tables = CrossTables(content);
    return tables.empty() ? "" : "\n" + eval::MarkdownOf(tables.front());
  }
  return std::nullopt;
}

}  // namespace

std::string FillBlocks(const std::string& page, const std::string& source,
                       std::span<const ReportContent> contents) {
  std::istringstream lines(page);
  std::string text;
  std::string line;
  bool has_filled = false;
  for (int number = 1; std::getline(lines, line); ++number) {
    text += line + "\n";
    if (!line.starts_with(kBegin)) continue;
    const auto require = [&](bool condition, const std::string& what) {
      if (!condition) throw base::Error(fmt::format("{}:{}: {}", source, number, what));
    };
    std::string kind;
    std::string name;
    std::istringstream(line.substr(kBegin.size())) >> kind >> name;
    require(
        kind == "table" || kind == "summary" || kind == "conclusions",
        fmt::format("the block is of the kind '{}', expected table, summary or conclusions", kind));
    std::string former;
    while (std::getline(lines, line) && line != kEnd) former += line + "\n";
    require(static_cast<bool>(lines),
            fmt::format("the block has no end, expected a line \"{}\"", kEnd));
    number += static_cast<int>(std::ranges::count(former, '\n')) + 1;
    const std::optional<std::string> block = BlockText(kind, name, contents);
    has_filled = has_filled || block.has_value();
    text += fmt::format("{}{}\n", block ? *block + "\n" : former, kEnd);
  }
  if (has_filled) return text;
  throw base::Error(
      fmt::format("{}: has no block of these plans, expected a line such as \"{}table {} -->\"",
                  source, kBegin, contents.front().plan.sweep.name));
}

}  // namespace slalom::sweep
