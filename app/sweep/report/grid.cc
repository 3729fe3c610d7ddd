#include "app/sweep/report/grid.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <utility>

#include "base/progress.h"

namespace slalom::sweep {
namespace {

double Rounded(double value) { return std::round(10.0 * value); }

constexpr std::size_t kMaxColumns = 12;  // Columns of a table that fit across a page.
constexpr std::size_t kMaxRowsSideBySide = 7;

/// "Success rate (%) (↑)"
std::string QuantityHead(const Quantity& quantity) {
  std::string head(quantity.title);
  head.front() = static_cast<char>(head.front() - 'a' + 'A');
  return fmt::format("{} {} ({}) ({})", head, quantity.is_rate ? "rate" : "time", quantity.unit,
                     quantity.higher_is_better ? "↑" : "↓");
}

/// The share of the planned seeds that a row has: "1/3". Empty if it has all.
std::string Fraction(const RowFigures& row) {
  if (row.num_seeds == row.num_planned) return "";
  return fmt::format("{}/{}", row.num_seeds, row.num_planned);
}

GridCell CellOf(const RowFigures& row, std::size_t q) {
  const QuantityFigures& figures = row.quantities[q];
  const double factor = kQuantities[q].factor;
  GridCell cell;
  if (figures.seed_mean) cell.mean = factor * *figures.seed_mean;
  if (figures.seed_deviation) cell.deviation = factor * *figures.seed_deviation;
  cell.mark = Fraction(row);
  return cell;
}

GridCell CellOf(const std::optional<Published>& published, std::size_t q) {
  GridCell cell;
  if (!published) return cell;
  cell.mean = kQuantities[q].factor * published->value;
  if (published->deviation) cell.deviation = kQuantities[q].factor * *published->deviation;
  return cell;
}

/// The content of a cell of a grid: a quantity of a row of a score. Empty if `row` is null.
struct Place {
  const RowFigures* row = nullptr;
  std::size_t quantity = 0;
  int num_columns = 1;
};

/// A line with the numbers of its places, and below it the published numbers of each source.
GridLine MakeLine(std::string head, const std::vector<Place>& places) {
  GridLine line{std::move(head), {}, {}};
  std::vector<std::string> sources;
  for (const Place& place : places) {
    line.cells.push_back(place.row ? CellOf(*place.row, place.quantity) : GridCell{});
    line.cells.back().num_columns = place.num_columns;
    if (!place.row) continue;
    for (const Published& published : place.row->published[place.quantity]) {
      if (std::ranges::find(sources, published.source) == sources.end()) {
        sources.push_back(published.source);
      }
    }
  }
  for (const std::string& source : sources) {
    std::vector<GridCell> cells;
    for (const Place& place : places) {
      cells.push_back(
          place.row ? CellOf(FindPublished(*place.row, {place.quantity, source}), place.quantity)
                    : GridCell{});
      cells.back().num_columns = place.num_columns;
    }
    line.published.push_back({source, std::move(cells)});
  }
  return line;
}

/// Makes the best number of `cells` bold, and those that print alike. Nothing is bold if all
/// numbers print alike.
void EmboldenBest(const std::vector<GridCell*>& cells, bool higher_is_better) {
  std::vector<GridCell*> numbers;
  for (GridCell* cell : cells) {
    if (cell->mean) numbers.push_back(cell);
  }
  if (numbers.size() < 2) return;
  const double sign = higher_is_better ? 1.0 : -1.0;
  double best = sign * Rounded(*numbers.front()->mean);
  for (const GridCell* cell : numbers) best = std::max(best, sign * Rounded(*cell->mean));
  const auto is_best = [&](const GridCell* cell) { return sign * Rounded(*cell->mean) == best; };
  if (std::ranges::all_of(numbers, is_best)) return;
  for (GridCell* cell : numbers) cell->is_bold = is_best(cell);
}

void EmboldenBest(GridLine& line, bool higher_is_better) {
  std::vector<GridCell*> cells;
  for (GridCell& cell : line.cells) cells.push_back(&cell);
  EmboldenBest(cells, higher_is_better);
}

/// Makes the best number of a column bold. Requires: no cell spans several columns.
void EmboldenBest(Grid& grid, std::size_t column, bool higher_is_better) {
  std::vector<GridCell*> cells;
  for (GridLine& line : grid.lines) cells.push_back(&line.cells[column]);
  EmboldenBest(cells, higher_is_better);
}

/// The scores that have rows.
std::vector<const ScoreContent*> ScoresWithRows(const ReportContent& content) {
  std::vector<const ScoreContent*> scores;
  for (const ScoreContent& score : content.scores) {
    if (!score.rows.empty()) scores.push_back(&score);
  }
  return scores;
}

std::string Joined(const std::vector<std::string>& labels, std::size_t count) {
  return fmt::format("{}", fmt::join(labels.begin(), labels.begin() + count, " / "));
}

/// The values of one list in the order in which they first appear.
void AddOnce(std::vector<std::string>& list, const std::string& value) {
  if (std::ranges::find(list, value) == list.end()) list.push_back(value);
}

/// Whether an axis goes by its key, as the plan gives it no name.
bool IsKey(const std::string& axis_name) { return axis_name.find('.') != std::string::npos; }

/// Lines and columns of rows with two labels or more.
struct Axes {
  std::vector<std::string> lines;    // All labels but the last.
  std::vector<std::string> columns;  // The last one.
  std::string column_axis;

  explicit Axes(const ReportContent& content) {
    const auto& names = content.cells.axis_names;
    if (!names.empty()) column_axis = names.back();
    for (const Row& row : content.results.rows) {
      AddOnce(lines, LineOf(row, names.size()));
      if (row.labels.size() == names.size()) AddOnce(columns, row.labels.back());
    }
  }

  static std::string LineOf(const Row& row, std::size_t num_axes) {
    if (row.labels.size() < num_axes) return row.name;
    return Joined(row.labels, row.labels.size() - 1);
  }

  /// The head of a line: its labels, with the axes if one of these has no name but a key.
  static std::string LineHead(const ReportContent& content, const std::string& line) {
    const auto& names = content.cells.axis_names;
    const auto row = std::ranges::find_if(content.results.rows, [&](const Row& r) {
      return r.labels.size() == names.size() && LineOf(r, names.size()) == line;
    });
    if (row == content.results.rows.end() || std::ranges::none_of(names, IsKey)) return line;
    return RowTitle({names.begin(), names.end() - 1}, {row->labels.begin(), row->labels.end() - 1});
  }

  /// "H=4", as papers print an axis with a short name; "gamma 0.99" of a key; or the label alone.
  std::string ColumnHead(const std::string& label) const {
    if (IsKey(column_axis)) return RowTitle({column_axis}, {label});
    return column_axis.size() > 2 ? label : column_axis + "=" + label;
  }
};

/// The places of one line below one score. A row without the last label spans all columns.
void AddPlaces(const ReportContent& content, const ScoreContent& score, const Axes& axes,
               const std::string& line, std::size_t q, std::vector<Place>& places) {
  const std::size_t num_axes = content.cells.axis_names.size();
  const int num_columns = static_cast<int>(axes.columns.size());
  std::vector<Place> found(axes.columns.size());
  for (Place& place : found) place.quantity = q;
  for (const RowFigures& figures : score.rows) {
    const Row& row = content.row(figures);
    if (Axes::LineOf(row, num_axes) != line) continue;
    if (row.labels.size() < num_axes) {
      found = {{&figures, q, num_columns}};
      break;
    }
    const auto column = std::ranges::find(axes.columns, row.labels.back());
    found[column - axes.columns.begin()].row = &figures;
  }
  places.insert(places.end(), found.begin(), found.end());
}

/// One quantity over two axes, for some of the scores.
Grid AxesTable(const ReportContent& content, std::span<const ScoreContent* const> scores,
               std::size_t q) {
  const Quantity& quantity = kQuantities[q];
  const Axes axes(content);
  Grid grid;
  grid.corner = QuantityHead(quantity);
  std::vector<std::string> columns;
  for (const std::string& column : axes.columns) columns.push_back(axes.ColumnHead(column));
  for (const ScoreContent* score : scores) {
    grid.blocks.push_back({score->label, columns});
  }
  for (const std::string& line : axes.lines) {
    std::vector<Place> places;
    for (const ScoreContent* score : scores) AddPlaces(content, *score, axes, line, q, places);
    if (std::ranges::none_of(places, [](const Place& place) { return place.row; })) continue;
    grid.lines.push_back(MakeLine(Axes::LineHead(content, line), places));
  }
  // The best below each score.
  for (std::size_t s = 0; s < scores.size(); ++s) {
    std::vector<GridCell*> cells;
    for (GridLine& line : grid.lines) {
      std::size_t column = 0;
      for (GridCell& cell : line.cells) {
        if (column / columns.size() == s) cells.push_back(&cell);
        column += cell.num_columns;
      }
    }
    EmboldenBest(cells, quantity.higher_is_better);
  }
  grid.caption =
      fmt::format("{}: {} by {}.", content.title, QuantityHead(quantity), axes.column_axis);
  grid.label = fmt::format("tab::{}-{}", scores.front()->name, quantity.key);
  return grid;
}

/// Indices in `kQuantities`.
std::vector<std::size_t> QuantitiesOf(const Plan& plan) {
  const auto& wanted = plan.sweep.quantities;
  std::vector<std::size_t> quantities;
  for (std::size_t q = 0; q < std::size(kQuantities); ++q) {
    if (wanted.empty() || std::ranges::find(wanted, kQuantities[q].key) != wanted.end()) {
      quantities.push_back(q);
    }
  }
  return quantities;
}

std::vector<Grid> AxesTables(const ReportContent& content) {
  const std::vector<const ScoreContent*> scores = ScoresWithRows(content);
  const std::size_t columns = Axes(content).columns.size();
  const std::size_t most =
      std::max<std::size_t>(1, kMaxColumns / std::max<std::size_t>(1, columns));
  const std::size_t num_tables = (scores.size() + most - 1) / most;
  const std::size_t at_once = num_tables == 0 ? 1 : (scores.size() + num_tables - 1) / num_tables;
  std::vector<Grid> grids;
  for (const std::size_t q : QuantitiesOf(content.plan)) {
    for (std::size_t s = 0; s < scores.size(); s += at_once) {
      const auto some = std::span(scores).subspan(s, std::min(at_once, scores.size() - s));
      grids.push_back(AxesTable(content, some, q));
    }
  }
  return grids;
}

/// The head of the column with the rows' names.
std::string RowHead(const ReportContent& content) {
  const auto& names = content.cells.axis_names;
  return names.empty() ? "Methods" : fmt::format("{}", fmt::join(names, " / "));
}

/// Rows side by side, quantities below one another.
Grid SideBySide(const ReportContent& content, const ScoreContent& score) {
  Grid grid;
  grid.corner = RowHead(content);
  grid.blocks.push_back({"", {}});
  for (const RowFigures& row : score.rows) {
    grid.blocks.front().columns.push_back(content.row(row).name);
  }
  for (std::size_t q = 0; q < std::size(kQuantities); ++q) {
    std::vector<Place> places;
    for (const RowFigures& row : score.rows) places.push_back({&row, q, 1});
    grid.lines.push_back(MakeLine(QuantityHead(kQuantities[q]), places));
    EmboldenBest(grid.lines.back(), kQuantities[q].higher_is_better);
  }
  grid.caption = fmt::format("{}: {}.", content.title, score.label);
  grid.label = fmt::format("tab::{}", score.name);
  return grid;
}

/// Rows below one another, quantities side by side.
Grid Downwards(const ReportContent& content, const ScoreContent& score) {
  Grid grid;
  grid.corner = RowHead(content);
  grid.blocks.push_back({"", {}});
  for (const Quantity& quantity : kQuantities) {
    grid.blocks.front().columns.push_back(QuantityHead(quantity));
  }
  for (const RowFigures& row : score.rows) {
    std::vector<Place> places;
    for (std::size_t q = 0; q < std::size(kQuantities); ++q) places.push_back({&row, q, 1});
    grid.lines.push_back(MakeLine(content.row(row).name, places));
  }
  for (std::size_t q = 0; q < std::size(kQuantities); ++q) {
    EmboldenBest(grid, q, kQuantities[q].higher_is_better);
  }
  grid.caption = fmt::format("{}: {}.", content.title, score.label);
  grid.label = fmt::format("tab::{}", score.name);
  return grid;
}

/// One quantity: rows below one another, scores side by side, or the other way round if there are
/// many scores.
Grid ScoresTable(const ReportContent& content, std::size_t q) {
  const Quantity& quantity = kQuantities[q];
  Grid grid;
  grid.corner = QuantityHead(quantity);
  grid.blocks.push_back({"", {}});
  std::vector<std::string>& columns = grid.blocks.front().columns;
  const std::vector<const ScoreContent*> scores = ScoresWithRows(content);
  const auto& rows = content.results.rows;
  const auto place = [&](const ScoreContent& score, std::size_t r) -> Place {
    const auto row = std::ranges::find(score.rows, r, &RowFigures::row);
    return {row == score.rows.end() ? nullptr : &*row, q, 1};
  };
  if (scores.size() > kMaxColumns && scores.size() > rows.size()) {
    columns.reserve(rows.size());
    for (const auto& row : rows) columns.push_back(row.name);
    for (const ScoreContent* score : scores) {
      std::vector<Place> places;
      places.reserve(rows.size());
      for (std::size_t r = 0; r < rows.size(); ++r) places.push_back(place(*score, r));
      grid.lines.push_back(MakeLine(score->label, places));
      EmboldenBest(grid.lines.back(), quantity.higher_is_better);
    }
  } else {
    columns.reserve(scores.size());
    for (const ScoreContent* score : scores) columns.push_back(score->label);
    for (std::size_t r = 0; r < rows.size(); ++r) {
      std::vector<Place> places;
      places.reserve(scores.size());
      for (const ScoreContent* score : scores) places.push_back(place(*score, r));
      grid.lines.push_back(MakeLine(rows[r].name, places));
    }
    for (std::size_t s = 0; s < scores.size(); ++s) {
      EmboldenBest(grid, s, quantity.higher_is_better);
    }
  }
  grid.caption = fmt::format("{}: {}.", content.title, QuantityHead(quantity));
  grid.label = fmt::format("tab::{}", quantity.key);
  return grid;
}

/// Success by the steps of snapshots.
Grid SnapshotTable(const ReportContent& content, const ScoreContent& score) {
  std::vector<std::int64_t> steps;  // 0, the finished policy, last.
  for (const std::int64_t at : score.snapshot_steps) {
    if (at > 0 && std::ranges::find(steps, at) == steps.end()) steps.push_back(at);
  }
  std::ranges::sort(steps);
  steps.push_back(0);
  Grid grid;
  grid.corner = "Steps";
  grid.blocks.push_back({"", {}});
  for (const std::int64_t at : steps) {
    grid.blocks.front().columns.push_back(at > 0 ? base::FormatCount(static_cast<double>(at))
                                                 : "end");
  }
  for (std::size_t i = 0; i < score.snapshots.size();) {
    const std::size_t row = score.snapshots[i].row;
    std::vector<Place> places(steps.size());
    for (; i < score.snapshots.size() && score.snapshots[i].row == row; ++i) {
      const auto column = std::ranges::find(steps, score.snapshot_steps[i]) - steps.begin();
      places[column].row = &score.snapshots[i];
    }
    grid.lines.push_back(MakeLine(content.results.rows[row].name, places));
  }
  for (std::size_t column = 0; column < steps.size(); ++column) EmboldenBest(grid, column, true);
  grid.caption = fmt::format("{}: {} on {} by number of environment steps.", content.title,
                             QuantityHead(kQuantities[0]), score.label);
  grid.label = fmt::format("tab::{}-steps", score.name);
  return grid;
}

/// The fraction of the planned seeds that all rows with more than one planned seed have: "1/3".
/// Empty if they have all, or if their fractions differ.
std::string SeedsOfAll(const ReportContent& content) {
  std::set<std::string> fractions;
  const auto add = [&](std::span<const RowFigures> rows) {
    for (const RowFigures& row : rows) {
      if (row.num_seeds > 0 && row.num_planned > 1) fractions.insert(Fraction(row));
    }
  };
  for (const ScoreContent& score : content.scores) {
    add(score.rows);
    add(score.snapshots);
  }
  return fractions.size() == 1 ? *fractions.begin() : "";
}

/// Adds to the caption how to read the table. `seeds`: of `SeedsOfAll`; the numbers then go
/// without.
void Explain(const std::string& seeds, Grid& grid) {
  bool has_deviations = false;
  bool has_marks = false;
  bool has_bold = false;
  bool has_published = false;
  for (GridLine& line : grid.lines) {
    has_published = has_published || !line.published.empty();
    for (GridCell& cell : line.cells) {
      has_deviations = has_deviations || cell.deviation;
      has_marks = has_marks || (cell.mean && !cell.mark.empty());
      has_bold = has_bold || cell.is_bold;
      if (!seeds.empty()) cell.mark.clear();
    }
  }
  if (has_deviations) grid.caption += " Mean and standard deviation over seeds.";
  if (has_bold) grid.caption += " The bold font marks the best.";
  if (has_published) grid.caption += " Lines in italics are published numbers.";
  if (!has_marks) return;
  grid.caption += seeds.empty()
                      ? " A fraction says how many of the planned seeds are in the number."
                      : fmt::format(" Trained so far: {} seeds.", seeds);
}

}  // namespace

std::vector<Grid> MakeGrids(const ReportContent& content) {
  std::vector<Grid> grids;
  if (content.cells.axis_names.size() >= 2) {
    grids = AxesTables(content);
  } else if (!content.plan.sweep.quantities.empty()) {
    for (const std::size_t q : QuantitiesOf(content.plan)) {
      grids.push_back(ScoresTable(content, q));
    }
  } else {
    for (const ScoreContent* score : ScoresWithRows(content)) {
      grids.push_back(score->rows.size() <= kMaxRowsSideBySide ? SideBySide(content, *score)
                                                               : Downwards(content, *score));
    }
  }
  for (const ScoreContent& score : content.scores) {
    if (!score.snapshots.empty()) grids.push_back(SnapshotTable(content, score));
  }
  const std::string seeds = SeedsOfAll(content);
  for (Grid& grid : grids) Explain(seeds, grid);
  return grids;
}

}  // namespace slalom::sweep
