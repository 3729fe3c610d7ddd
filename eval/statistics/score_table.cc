#include "eval/statistics/score_table.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::eval {
namespace {

void CheckTable(const ScoreTable& table) {
  SLALOM_CHECK(!table.scores.empty());
  SLALOM_CHECK(!table.scores.front().empty());
  for (const std::vector<double>& row : table.scores) {
    SLALOM_CHECK_EQ(row.size(), table.num_courses());
    for (const double score : row) SLALOM_CHECK(std::isfinite(score));
  }
}

std::vector<double> AllScores(const ScoreTable& table) {
  CheckTable(table);
  std::vector<double> all;
  all.reserve(table.num_seeds() * table.num_courses());
  for (const std::vector<double>& row : table.scores) all.insert(all.end(), row.begin(), row.end());
  return all;
}

double MeanOf(std::span<const double> numbers) {
  double sum = 0.0;
  for (const double number : numbers) sum += number;
  return sum / static_cast<double>(numbers.size());
}

}  // namespace

double Mean(const ScoreTable& table) { return MeanOf(AllScores(table)); }

double InterquartileMean(const ScoreTable& table) {
  std::vector<double> all = AllScores(table);
  std::ranges::sort(all);
  const std::size_t cut = all.size() / 4;
  return MeanOf(std::span(all).subspan(cut, all.size() - 2 * cut));
}

double LowestTwentiethMean(const ScoreTable& table) {
  std::vector<double> all = AllScores(table);
  std::ranges::sort(all);
  return MeanOf(std::span(all).first((all.size() + 19) / 20));
}

double AreaUnderCurve(std::span<const double> x, std::span<const double> y) {
  SLALOM_CHECK_EQ(x.size(), y.size());
  SLALOM_CHECK_GE(x.size(), 2u);
  double area = 0.0;
  for (std::size_t i = 1; i < x.size(); ++i) {
    SLALOM_CHECK_LT(x[i - 1], x[i]);
    area += 0.5 * (y[i - 1] + y[i]) * (x[i] - x[i - 1]);
  }
  return area / (x.back() - x.front());
}

}  // namespace slalom::eval
