#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/sweep/plan.h"
#include "app/sweep/results.h"
#include "base/config_field.h"
#include "eval/statistics/statistics.h"

namespace slalom::sweep {

/// Whether the results support a conclusion. That on several rows is the first of theirs.
enum class ConclusionVerdict {
  kDoesNotHold,  ///< The whole interval lies elsewhere.
  kMissing,      ///< A row has no evaluation yet.
  kCannotTell,   ///< The interval reaches over the limit, or there is none.
  kHolds,        ///< The whole interval lies where the conclusion says.
};
inline base::OneOf EnumNames(ConclusionVerdict) {
  return {"does not hold", "missing", "cannot tell", "holds"};
}

/// One row of a conclusion.
struct ConclusionFigure {
  std::string what;  ///< "MLP on static-test"; "GRU less MLP on static-test".
  /// In the quantity's own unit, with its 95 % interval over seeds and courses. Empty if a row is
  /// missing or no episode has the quantity.
  std::optional<eval::Estimate> estimate;
  ConclusionVerdict verdict = ConclusionVerdict::kMissing;
};

/// A conclusion with a figure for each of its rows.
struct JudgedConclusion {
  Conclusion conclusion;
  std::vector<ConclusionFigure> figures;
  ConclusionVerdict verdict = ConclusionVerdict::kHolds;
};

/// Judges an estimate.
ConclusionVerdict Judge(const eval::Estimate& estimate, ConclusionKind kind, double limit);

/// Judges the conclusions of a plan, in its order. Rows that drove the same courses are compared on
/// these courses pair by pair.
std::vector<JudgedConclusion> JudgeConclusions(const Plan& plan, const SweepResults& results);

}  // namespace slalom::sweep
