#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace slalom::sim {

/// The three kinds of courses that the original data set holds.
enum class CourseKind { kStatic, kDynamicBox, kDynamicWall };

/// "static", "dynamic-box" or "dynamic-wall": the name of the set of all courses of this kind.
std::string_view ToString(CourseKind kind);

/// Number of courses of this kind in the original data set: 300, 100, 100.
int NumCourses(CourseKind kind);

/// The N of the first world_N.world of this kind: 0, 300, 400.
int FirstWorld(CourseKind kind);

/// The courses of a set. A value.
struct CourseSplit {
  CourseKind kind = CourseKind::kStatic;
  std::vector<int> indices;  ///< From 0 to NumCourses(kind) - 1, in the paper's order.

  friend bool operator==(const CourseSplit&, const CourseSplit&) = default;
};

/// The paper's sets (docs/original-system.md, section 7.5), the same for the imported original
/// courses and for generated ones:
///
/// - `static`: all 300; `static-test`: 50, for final figures only; `static-train-5`, `-10`, `-50`,
///   `-100`, `-250`: nested; the last is all that are not in static-test;
/// - `dynamic-box`: all 100; `dynamic-box-train`: the first 50; `dynamic-box-test`: the others;
/// - `dynamic-wall`, `dynamic-wall-train`, `dynamic-wall-test`: likewise;
///
/// the 50 that the BARN Challenge is scored on (docs/original-system.md, section 8.6):
///
/// - `static-challenge`: 0, 6, ..., 294;
///
/// two of our own, for choosing settings without a look at static-test:
///
/// - `static-validation`: 40 of static-train-250, every third or fourth that is not in
///   static-train-100, so nothing that trains on static-train-100 or less has seen it;
/// - `static-train-210`: static-train-250 without static-validation;
///
/// and one for scores on static-challenge, of which 40 are in static-train-250:
///
/// - `static-train-no-challenge`: the 210 of static-train-250 that are not in static-challenge.
std::span<const std::string_view> SplitNames();

inline constexpr int kNumValidationCourses = 40;

/// The set of this name, or nothing if `SplitNames` does not hold the name.
std::optional<CourseSplit> FindSplit(std::string_view name);

}  // namespace slalom::sim
