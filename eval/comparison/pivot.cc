#include "eval/comparison/pivot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "base/check.h"
#include "eval/report/table_text.h"

namespace slalom::eval {
namespace {

/// The place of a head in its list, which it joins if it is new.
std::size_t IndexOf(std::vector<std::string>& heads, const std::string& head) {
  const auto found = std::ranges::find(heads, head);
  const auto index = static_cast<std::size_t>(found - heads.begin());
  if (found == heads.end()) heads.push_back(head);
  return index;
}

/// A number in the unit in which its quantity is shown.
PivotNumber Shown(std::optional<double> mean, std::optional<double> deviation, double factor) {
  if (mean) *mean *= factor;
  if (deviation) *deviation *= factor;
  return {mean, deviation};
}

/// The number in tenths, as it is printed; negative if a low one is better.
double RankOf(const PivotEntry& entry) {
  const double tenths = std::round(10.0 * *entry.number.mean);
  return entry.higher_is_better ? tenths : -tenths;
}

/// The entries that are printed bold.
std::set<const PivotEntry*> FindBest(const std::vector<PivotEntry>& entries) {
  std::map<std::size_t, std::vector<const PivotEntry*>> contests;
  for (const PivotEntry& entry : entries) {
    if (entry.number.mean) contests[entry.contest].push_back(&entry);
  }
  std::set<const PivotEntry*> best;
  for (const auto& [contest, rivals] : contests) {
    const auto rank = [](const PivotEntry* entry) { return RankOf(*entry); };
    const auto [least, most] = std::ranges::minmax(rivals, {}, rank);
    if (rank(least) == rank(most)) continue;
    for (const PivotEntry* entry : rivals) {
      if (rank(entry) == rank(most)) best.insert(entry);
    }
  }
  return best;
}

std::string NumberText(const PivotNumber& number) {
  if (!number.mean) return "–";
  std::string text = FixedText(*number.mean, 1);
  if (number.deviation) text += " ± " + FixedText(*number.deviation, 1);
  return text;
}

/// "**65.1 ± 4.0** (2/3 seeds)"
std::string EntryText(const PivotEntry& entry, bool is_best) {
  std::string text = NumberText(entry.number);
  if (is_best) text = "**" + text + "**";
  const bool has_mark = entry.number.mean && !entry.mark.empty();
  return has_mark ? fmt::format("{} ({} seeds)", text, entry.mark) : text;
}

/// The table of the heads that have entries.
class Printer {
 public:
  explicit Printer(const Pivot& pivot) : pivot_(pivot), best_(FindBest(pivot.entries)) {
    std::set<std::size_t> blocks;
    std::set<std::size_t> columns;
    for (const PivotEntry& entry : pivot.entries) {
      blocks.insert(entry.block);
      if (entry.column) columns.insert(*entry.column);
    }
    if (columns.empty()) columns.insert(0);
    table_.titles = {EscapeMarkdown(pivot.corner)};
    for (const std::size_t block : blocks) {
      for (const std::size_t column : columns) {
        place_[{block, column}] = table_.titles.size();
        const std::string& head = pivot.blocks[block];
        const std::string name = pivot.columns.empty() ? "" : pivot.columns[column];
        table_.titles.push_back(
            EscapeMarkdown(head.empty() ? name : fmt::format("{}, {}", head, name)));
      }
    }
    num_columns_ = columns.size();
  }

  std::string Print() {
    for (std::size_t line = 0; line < pivot_.lines.size(); ++line) AddLine(line);
    return fmt::format("{}\n{}\n", table_.Print(), EscapeMarkdown(pivot_.caption + Explanation()));
  }

 private:
  void AddLine(std::size_t line) {
    std::vector<const PivotEntry*> entries;
    std::vector<std::string> sources;
    for (const PivotEntry& entry : pivot_.entries) {
      if (entry.line != line) continue;
      entries.push_back(&entry);
      for (const auto& [source, number] : entry.published) {
        if (std::ranges::find(sources, source) == sources.end()) sources.push_back(source);
      }
    }
    if (entries.empty()) return;
    AddRow(EscapeMarkdown(pivot_.lines[line]), entries,
           [&](const PivotEntry& entry) { return EntryText(entry, best_.contains(&entry)); });
    for (const std::string& source : sources) {
      AddRow("*" + EscapeMarkdown(source) + "*", entries, [&](const PivotEntry& entry) {
        for (const auto& [from, number] : entry.published) {
          if (from == source) return NumberText(number);
        }
        return NumberText({});
      });
    }
  }

  /// A number of all columns of its block stands in the first of them.
  template <class Text>
  void AddRow(std::string head, const std::vector<const PivotEntry*>& entries, Text text) {
    std::vector<std::string>& cells = table_.rows.emplace_back(table_.titles.size(), "–");
    cells[0] = std::move(head);
    for (const PivotEntry* entry : entries) {
      if (!entry->column) {
        const std::size_t first = place_.lower_bound({entry->block, 0})->second;
        std::fill_n(cells.begin() + static_cast<std::ptrdiff_t>(first), num_columns_, "");
        cells[first] = text(*entry);
      } else {
        cells[place_.at({entry->block, *entry->column})] = text(*entry);
      }
    }
  }

  /// How to read the table.
  std::string Explanation() const {
    const auto any = [&](auto has) { return std::ranges::any_of(pivot_.entries, has); };
    std::string text;
    if (any([](const PivotEntry& entry) { return entry.number.deviation.has_value(); })) {
      text += " Mean and standard deviation over seeds.";
    }
    if (!best_.empty()) text += " The bold font marks the best.";
    if (any([](const PivotEntry& entry) { return !entry.published.empty(); })) {
      text += " Lines in italics are published numbers.";
    }
    if (any([](const PivotEntry& entry) { return entry.number.mean && !entry.mark.empty(); })) {
      text += " A fraction says how many of the planned seeds are in the number.";
    }
    return text;
  }

  const Pivot& pivot_;
  const std::set<const PivotEntry*> best_;
  MarkdownTable table_;
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> place_;  // Of a block's column.
  std::size_t num_columns_ = 0;                                       // Of a block.
};

}  // namespace

void Pivot::Add(const PivotPlace& place, const AgentFigures* agent, std::size_t quantity,
                std::size_t contest) {
  PivotEntry entry{.line = IndexOf(lines, place.line), .block = IndexOf(blocks, place.block)};
  if (place.column) entry.column = IndexOf(columns, *place.column);
  if (agent == nullptr) return;
  const Quantity& of = Quantities()[quantity];
  const QuantityFigures& figures = agent->quantities[quantity];
  entry.number = Shown(figures.seed_mean(), figures.seed_deviation(), of.factor);
  for (const PublishedNumber& number : agent->published) {
    if (number.quantity != quantity) continue;
    entry.published.emplace_back(number.source, Shown(number.value, number.deviation, of.factor));
  }
  if (agent->num_seeds != agent->num_planned) {
    entry.mark = fmt::format("{}/{}", agent->num_seeds, agent->num_planned);
  }
  entry.contest = contest;
  entry.higher_is_better = of.higher_is_better;
  entries.push_back(std::move(entry));
}

void FitToPage(Pivot& pivot) {
  SLALOM_CHECK(pivot.blocks.size() <= 1);
  std::set<std::size_t> lines;
  std::set<std::size_t> columns;
  for (const PivotEntry& entry : pivot.entries) {
    lines.insert(entry.line);
    columns.insert(entry.column.value());
  }
  if (columns.size() <= std::max(kMaxPivotColumns, lines.size())) return;
  std::swap(pivot.lines, pivot.columns);
  for (PivotEntry& entry : pivot.entries) std::swap(entry.line, entry.column.value());
}

std::string MarkdownOf(const Pivot& pivot) { return Printer(pivot).Print(); }

}  // namespace slalom::eval
