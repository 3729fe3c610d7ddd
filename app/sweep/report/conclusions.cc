#include "app/sweep/report/conclusions.h"

#include <algorithm>

#include "eval/comparison/comparison.h"

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

ConclusionFigure JudgeRow(const SweepResults& results, const Conclusion& conclusion,
                          const eval::Quantity& quantity, std::size_t i) {
  ConclusionFigure figure;
  figure.row = conclusion.rows[i];
  const RowScore* row = FindScored(results, figure.row, conclusion.score);
  if (conclusion.than.empty()) {
    if (row == nullptr) return figure;
    figure.estimate = eval::EstimateOf(AgentOf(results, *row), quantity);
  } else {
    figure.than = conclusion.than[conclusion.than.size() == 1 ? 0 : i];
    const RowScore* other = FindScored(results, figure.than, conclusion.other_score());
    if (row == nullptr || other == nullptr) return figure;
    figure.estimate =
        eval::DifferenceOf(AgentOf(results, *row), AgentOf(results, *other), quantity);
  }
  figure.verdict = figure.estimate ? Judge(*figure.estimate, conclusion.kind, conclusion.limit)
                                   : ConclusionVerdict::kCannotTell;
  return figure;
}

/// The verdict on all rows: the worst of theirs.
ConclusionVerdict Overall(const std::vector<ConclusionFigure>& figures) {
  for (const ConclusionVerdict verdict :
       {ConclusionVerdict::kDoesNotHold, ConclusionVerdict::kMissing,
        ConclusionVerdict::kCannotTell}) {
    if (std::ranges::find(figures, verdict, &ConclusionFigure::verdict) != figures.end()) {
      return verdict;
    }
  }
  return ConclusionVerdict::kHolds;
}

}  // namespace

std::string_view ToString(ConclusionVerdict verdict) {
  switch (verdict) {
    case ConclusionVerdict::kHolds:
      return "holds";
    case ConclusionVerdict::kDoesNotHold:
      return "does not hold";
    case ConclusionVerdict::kCannotTell:
      return "cannot tell";
    case ConclusionVerdict::kMissing:
      return "missing";
  }
  return "";
}

ConclusionVerdict Judge(const eval::Estimate& estimate, ConclusionKind kind, double limit) {
  if (!estimate.interval) return ConclusionVerdict::kCannotTell;
  const auto [low, high] = *estimate.interval;
  switch (kind) {
    case ConclusionKind::kAbove:
      if (low > limit) return ConclusionVerdict::kHolds;
      return high < limit ? ConclusionVerdict::kDoesNotHold : ConclusionVerdict::kCannotTell;
    case ConclusionKind::kBelow:
      if (high < limit) return ConclusionVerdict::kHolds;
      return low > limit ? ConclusionVerdict::kDoesNotHold : ConclusionVerdict::kCannotTell;
    case ConclusionKind::kWithin:
      if (low > -limit && high < limit) return ConclusionVerdict::kHolds;
      return low > limit || high < -limit ? ConclusionVerdict::kDoesNotHold
                                          : ConclusionVerdict::kCannotTell;
  }
  return ConclusionVerdict::kCannotTell;
}

std::vector<JudgedConclusion> JudgeConclusions(const Plan& plan, const SweepResults& results) {
  std::vector<JudgedConclusion> judged;
  for (const Conclusion& conclusion : plan.conclusions) {
    const eval::Quantity& quantity = eval::Quantities()[*eval::FindQuantity(conclusion.quantity)];
    JudgedConclusion& one = judged.emplace_back();
    one.conclusion = conclusion;
    for (std::size_t i = 0; i < conclusion.rows.size(); ++i) {
      one.figures.push_back(JudgeRow(results, conclusion, quantity, i));
    }
    one.verdict = Overall(one.figures);
  }
  return judged;
}

}  // namespace slalom::sweep
