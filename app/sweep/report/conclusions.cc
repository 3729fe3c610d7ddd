#include "app/sweep/report/conclusions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <span>

#include "app/sweep/report/report.h"
#include "base/config_field.h"
#include "eval/comparison/comparison.h"
#include "eval/report/table_text.h"

namespace slalom::sweep {
namespace {

/// The evaluations of a row on a score; null: there are none.
const RowScore* FindScored(const SweepResults& results, const std::string& row,
                           const std::string& score) {
  const auto& scores = results.scores;
  const auto of_score = std::ranges::find(scores, score, &ScoreResults::name);
  if (of_score == scores.end()) return nullptr;
  for (const RowScore& found : of_score->rows) {
    if (results.rows[found.row].name == row) return found.seeds.empty() ? nullptr : &found;
  }
  return nullptr;
}

const eval::Quantity& QuantityOf(const Conclusion& conclusion) {
  return eval::Quantities()[*eval::FindQuantity(conclusion.quantity)];
}

/// "MLP on static-test"
std::string On(const Plan& plan, const std::string& row, const std::string& score) {
  return fmt::format("{} on {}", row, std::ranges::find(plan.scores, score, &Score::name)->label);
}

ConclusionFigure JudgeRow(const Plan& plan, const SweepResults& results,
                          const Conclusion& conclusion, std::size_t i) {
  ConclusionFigure figure;
  const std::string& name = conclusion.rows[i];
  const RowScore* row = FindScored(results, name, conclusion.score);
  if (conclusion.than.empty()) {
    figure.what = On(plan, name, conclusion.score);
    if (row == nullptr) return figure;
    figure.estimate = eval::EstimateOf(AgentOf(results, *row), QuantityOf(conclusion));
  } else {
    const std::string& than = conclusion.than[conclusion.than.size() == 1 ? 0 : i];
    figure.what = conclusion.than_score.empty()
                      ? On(plan, fmt::format("{} less {}", name, than), conclusion.score)
                      : fmt::format("{} less {}", On(plan, name, conclusion.score),
                                    On(plan, than, conclusion.than_score));
    const RowScore* other = FindScored(results, than, conclusion.other_score());
    if (row == nullptr || other == nullptr) return figure;
    figure.estimate = eval::DifferenceOf(AgentOf(results, *row), AgentOf(results, *other),
                                         QuantityOf(conclusion));
  }
  figure.verdict = figure.estimate ? Judge(*figure.estimate, conclusion.kind, conclusion.limit)
                                   : ConclusionVerdict::kCannotTell;
  return figure;
}

/// "GRU / 4 less MLP / 1 on static-test: success -3.8 (-6.1–-1.5) points"
std::string FigureText(const Conclusion& conclusion, const ConclusionFigure& figure) {
  const std::string what = eval::EscapeMarkdown(figure.what);
  if (!figure.estimate) return what + ": –";
  const eval::Quantity& quantity = QuantityOf(conclusion);
  return fmt::format("{}: {} {} {}", what, quantity.title,
                     eval::EstimateText(figure.estimate, quantity.factor, quantity.digits),
                     conclusion.than.empty() ? quantity.unit : quantity.difference_unit());
}

std::string LimitText(const Conclusion& conclusion) {
  return fmt::format("{} {}{:.4g}", base::EnumName(conclusion.kind),
                     conclusion.kind == ConclusionKind::kWithin ? "± " : "",
                     QuantityOf(conclusion).factor * conclusion.limit);
}

}  // namespace

ConclusionVerdict Judge(const eval::Estimate& estimate, ConclusionKind kind, double limit) {
  if (!estimate.interval) return ConclusionVerdict::kCannotTell;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double from = kind == ConclusionKind::kBelow    ? -kInfinity
                      : kind == ConclusionKind::kWithin ? -limit
                                                        : limit;
  const double to = kind == ConclusionKind::kAbove ? kInfinity : limit;
  const auto [low, high] = *estimate.interval;
  if (low > from && high < to) return ConclusionVerdict::kHolds;
  const bool is_elsewhere = low > to || high < from;
  return is_elsewhere ? ConclusionVerdict::kDoesNotHold : ConclusionVerdict::kCannotTell;
}

std::vector<JudgedConclusion> JudgeConclusions(const Plan& plan, const SweepResults& results) {
  std::vector<JudgedConclusion> judged;
  for (const Conclusion& conclusion : plan.conclusions) {
    JudgedConclusion& one = judged.emplace_back();
    one.conclusion = conclusion;
    for (std::size_t i = 0; i < conclusion.rows.size(); ++i) {
      one.figures.push_back(JudgeRow(plan, results, conclusion, i));
      one.verdict = std::min(one.verdict, one.figures.back().verdict);
    }
  }
  return judged;
}

std::string MarkdownConclusions(std::span<const ReportContent> contents) {
  eval::MarkdownTable table{
      .titles = {"conclusion", "figure, with its 95 % interval", "expected", "verdict"},
      .num_names = 4};
  for (const ReportContent& content : contents) {
    for (const JudgedConclusion& judged : content.conclusions) {
      std::vector<std::string> figures;
      for (const ConclusionFigure& figure : judged.figures) {
        figures.push_back(FigureText(judged.conclusion, figure));
      }
      table.rows.push_back({eval::EscapeMarkdown(judged.conclusion.text),
                            fmt::format("{}", fmt::join(figures, "<br>")),
                            LimitText(judged.conclusion),
                            std::string(base::EnumName(judged.verdict))});
    }
  }
  return "\n" + table.Print();
}

}  // namespace slalom::sweep
