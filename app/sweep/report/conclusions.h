#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/sweep/plan.h"
#include "app/sweep/results.h"
#include "eval/statistics/statistics.h"

/// The conclusions of a plan, held against the results.

namespace slalom::sweep {

/// Whether the results support a conclusion.
enum class ConclusionVerdict {
  kHolds,        ///< The whole interval lies where the conclusion says.
  kDoesNotHold,  ///< The whole interval lies elsewhere.
  kCannotTell,   ///< The interval reaches over the limit, or there is none.
  kMissing,      ///< A row has no evaluation yet.
};
std::string_view ToString(ConclusionVerdict verdict);

/// One row of a conclusion.
struct ConclusionFigure {
  std::string row;
  std::string than;  ///< The row that was subtracted; empty: none was.
  /// In the quantity's own unit, with its 95 % interval over seeds and courses. Empty if a row is
  /// missing or no episode has the quantity.
  std::optional<eval::Estimate> estimate;
  ConclusionVerdict verdict = ConclusionVerdict::kMissing;
};

/// A conclusion with its figures. It holds if it holds for each row, and does not if it does not
/// for one.
struct JudgedConclusion {
  Conclusion conclusion;
  std::vector<ConclusionFigure> figures;
  ConclusionVerdict verdict = ConclusionVerdict::kMissing;
};

/// Judges an estimate.
ConclusionVerdict Judge(const eval::Estimate& estimate, ConclusionKind kind, double limit);

/// Judges the conclusions of a plan, in its order. Rows that drove the same courses are compared on
/// these courses pair by pair.
std::vector<JudgedConclusion> JudgeConclusions(const Plan& plan, const SweepResults& results);

}  // namespace slalom::sweep
