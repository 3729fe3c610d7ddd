#include "train/training_figure.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <sstream>
#include <string_view>
#include <vector>

#include "train/line_plot.h"

namespace slalom::train {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMaxPoints = 1000;  // Of a line; more cannot be seen.

std::vector<std::string> SplitCells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

double Number(const std::string& cell) {
  char* end = nullptr;
  const double number = std::strtod(cell.c_str(), &end);
  return cell.empty() || *end != '\0' ? kUnknown : number;
}

/// The numbers of a CSV file by column.
class Table {
 public:
  explicit Table(const std::string& text) {
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    const std::vector<std::string> header = SplitCells(line);
    while (std::getline(lines, line)) {
      if (lines.eof()) break;  // Without its end of line it is still being written.
      const std::vector<std::string> cells = SplitCells(line);
      for (std::size_t c = 0; c < header.size(); ++c) {
        columns_[header[c]].push_back(c < cells.size() ? Number(cells[c]) : kUnknown);
      }
      ++num_rows_;
    }
    Thin();
  }

  /// All unknown where there is no such column.
  std::vector<double> Column(const std::string& name) const {
    const auto it = columns_.find(name);
    return it == columns_.end() ? std::vector<double>(num_rows_, kUnknown) : it->second;
  }

 private:
  /// Keeps every n-th row, counted from the last, so that a long run's picture stays small.
  void Thin() {
    const std::size_t stride = (num_rows_ + kMaxPoints - 1) / kMaxPoints;
    if (stride <= 1) return;
    std::size_t num_kept = 0;
    for (auto& [name, values] : columns_) {
      std::vector<double> kept;
      for (std::size_t i = (num_rows_ - 1) % stride; i < num_rows_; i += stride) {
        kept.push_back(values[i]);
      }
      values = std::move(kept);
      num_kept = values.size();
    }
    num_rows_ = num_kept;
  }

  std::map<std::string, std::vector<double>> columns_;
  std::size_t num_rows_ = 0;
};

/// A line over training time. Points whose time is not known are unknown.
PlotSeries SeriesOf(const Table& table, const std::string& name, const std::string& column,
                    PlotColour colour) {
  PlotSeries series{name, colour, table.Column("training_s"), table.Column(column)};
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (std::isfinite(series.x[i])) continue;
    series.x[i] = 0.0;
    series.y[i] = kUnknown;
  }
  return series;
}

PlotPanel RatePanel(const std::string& title, const Table& table) {
  return {title,
          true,
          {SeriesOf(table, "success", "success_rate", PlotColour::kGreen),
           SeriesOf(table, "collision", "collision_rate", PlotColour::kRed),
           SeriesOf(table, "timeout", "timeout_rate", PlotColour::kAmber)}};
}

void AddStepScale(const Table& table, PlotFigure& figure) {
  figure.top_label = "steps";
  const std::vector<double> seconds = table.Column("training_s");
  const std::vector<double> steps = table.Column("steps");
  for (std::size_t i = 0; i < seconds.size(); ++i) {
    if (!std::isfinite(seconds[i]) || !std::isfinite(steps[i])) continue;
    if (!figure.top_x.empty() && seconds[i] <= figure.top_x.back()) continue;
    figure.top_x.push_back(seconds[i]);
    figure.top_values.push_back(steps[i]);
  }
}

}  // namespace

std::string DrawTrainingFigure(const std::string& run_name, const std::string& metrics,
                               const std::string& curve) {
  const Table training(metrics);
  const Table scores(curve);
  PlotPanel score_panel = RatePanel("Scores on the test courses, with 95 % intervals", scores);
  for (PlotSeries& series : score_panel.series) series.has_dots = true;
  score_panel.series.front().low = scores.Column("success_low");
  score_panel.series.front().high = scores.Column("success_high");
  PlotFigure figure{
      .title = run_name,
      .x_label = "training time [s]",
      .top_label = {},
      .top_x = {},
      .top_values = {},
      .panels = {RatePanel("Training episodes, with exploration noise", training),
                 {"Return of training episodes",
                  false,
                  {SeriesOf(training, "mean return", "mean_return", PlotColour::kBlue)}},
                 std::move(score_panel)}};
  AddStepScale(training, figure);
  return DrawFigure(figure);
}

}  // namespace slalom::train
