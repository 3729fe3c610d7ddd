#include "app/train/training_figure.h"

#include <cmath>
#include <limits>
#include <vector>

#include "app/train/line_plot.h"
#include "learner/run/metrics_table.h"

namespace slalom::train {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMaxPoints = 1000;  // Of a line; more cannot be seen.

/// A line over training time. Points whose time is not known are unknown.
plot::Series SeriesOf(const run::MetricsTable& table, const std::string& name,
                      const std::string& column, plot::Colour colour) {
  plot::Series series{name, colour, table.Column("training_s"), table.Column(column)};
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (std::isfinite(series.x[i])) continue;
    series.x[i] = 0.0;
    series.y[i] = kUnknown;
  }
  return series;
}

plot::Panel RatePanel(const std::string& title, const run::MetricsTable& table) {
  return {title,
          true,
          {SeriesOf(table, "success", "success_rate", plot::Colour::kGreen),
           SeriesOf(table, "collision", "collision_rate", plot::Colour::kRed),
           SeriesOf(table, "timeout", "timeout_rate", plot::Colour::kAmber)}};
}

void AddStepScale(const run::MetricsTable& table, plot::Figure& figure) {
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
  const run::MetricsTable training = run::ParseMetrics(metrics, kMaxPoints);
  const run::MetricsTable scores = run::ParseMetrics(curve, kMaxPoints);
  plot::Panel score_panel = RatePanel("Scores on the test courses, with 95 % intervals", scores);
  for (plot::Series& series : score_panel.series) series.has_dots = true;
  score_panel.series.front().low = scores.Column("success_low");
  score_panel.series.front().high = scores.Column("success_high");
  plot::Figure figure{
      .title = run_name,
      .x_label = "training time [s]",
      .top_label = {},
      .top_x = {},
      .top_values = {},
      .panels = {RatePanel("Training episodes, with exploration noise", training),
                 {"Return of training episodes",
                  false,
                  {SeriesOf(training, "mean return", "episode_return", plot::Colour::kBlue)}},
                 std::move(score_panel)}};
  AddStepScale(training, figure);
  return plot::DrawFigure(figure);
}

}  // namespace slalom::train
