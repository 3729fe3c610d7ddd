#include "sim/courses/course_splits.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

namespace slalom::sim {
namespace {

// static-train-5, -10 and -50 are its first 5, 10 and 50.
constexpr int kTrain100[] = {
    153, 43,  20,  209, 74,  274, 127, 192, 56,  291, 242, 29,  238, 170, 286, 52,  243,
    157, 116, 131, 23,  276, 231, 273, 51,  247, 266, 110, 166, 225, 207, 236, 280, 35,
    49,  65,  105, 80,  67,  109, 18,  177, 75,  195, 249, 26,  264, 83,  149, 176, 282,
    246, 223, 62,  59,  179, 24,  181, 154, 172, 165, 112, 66,  77,  275, 194, 28,  130,
    111, 81,  17,  89,  205, 86,  297, 136, 70,  90,  259, 25,  57,  71,  240, 237, 138,
    268, 217, 63,  147, 278, 76,  168, 277, 87,  191, 15,  188, 135, 255, 183};

constexpr int kTest[] = {250, 292, 97,  162, 219, 125, 142, 289, 1,   106, 227, 79, 132,
                         31,  151, 220, 91,  228, 160, 145, 224, 152, 10,  252, 69, 174,
                         244, 208, 158, 214, 211, 37,  120, 271, 99,  21,  4,   5,  2,
                         32,  14,  96,  139, 212, 245, 84,  156, 128, 58,  48};

constexpr int kNumStatic = 300;
constexpr int kNumDynamic = 100;  // Courses of each kind; the first half is for training.

constexpr std::string_view kNames[] = {"static",
                                       "static-test",
                                       "static-train-5",
                                       "static-train-10",
                                       "static-train-50",
                                       "static-train-100",
                                       "static-train-250",
                                       "static-train-210",
                                       "static-train-no-challenge",
                                       "static-validation",
                                       "static-challenge",
                                       "dynamic-box",
                                       "dynamic-box-train",
                                       "dynamic-box-test",
                                       "dynamic-wall",
                                       "dynamic-wall-train",
                                       "dynamic-wall-test"};

std::vector<int> First(int n) { return {kTrain100, kTrain100 + n}; }

/// Indices of static courses that are in neither list, ascending.
std::vector<int> AllBut(std::span<const int> a, std::span<const int> b) {
  std::vector<int> rest;
  for (int i = 0; i < kNumStatic; ++i) {
    const bool listed =
        std::find(a.begin(), a.end(), i) != a.end() || std::find(b.begin(), b.end(), i) != b.end();
    if (!listed) rest.push_back(i);
  }
  return rest;
}

std::vector<int> EverySixth() {
  std::vector<int> chosen;
  for (int i = 0; i < kNumStatic; i += 6) chosen.push_back(i);
  return chosen;
}

std::vector<int> Validation() {
  const std::vector<int> candidates = AllBut(kTest, kTrain100);
  std::vector<int> chosen;
  for (std::size_t i = 0; i < kNumValidationCourses; ++i) {
    chosen.push_back(candidates[i * candidates.size() / kNumValidationCourses]);
  }
  return chosen;
}

std::vector<int> Range(int first, int last) {
  std::vector<int> indices(static_cast<std::size_t>(last - first));
  std::iota(indices.begin(), indices.end(), first);
  return indices;
}

/// The set of static courses of this name.
std::optional<std::vector<int>> StaticIndices(std::string_view name) {
  if (name == "static") return Range(0, kNumStatic);
  if (name == "static-test") return std::vector<int>(std::begin(kTest), std::end(kTest));
  if (name == "static-train-5") return First(5);
  if (name == "static-train-10") return First(10);
  if (name == "static-train-50") return First(50);
  if (name == "static-train-100") return First(100);
  if (name == "static-train-250") return AllBut(kTest, {});
  if (name == "static-train-210") return AllBut(kTest, Validation());
  if (name == "static-train-no-challenge") return AllBut(kTest, EverySixth());
  if (name == "static-validation") return Validation();
  if (name == "static-challenge") return EverySixth();
  return std::nullopt;
}

}  // namespace

std::string_view ToString(CourseKind kind) {
  constexpr std::array<std::string_view, 3> kKinds = {"static", "dynamic-box", "dynamic-wall"};
  return kKinds.at(static_cast<std::size_t>(kind));
}

int NumCourses(CourseKind kind) { return kind == CourseKind::kStatic ? kNumStatic : kNumDynamic; }

int FirstWorld(CourseKind kind) {
  constexpr std::array<int, 3> kFirst = {0, kNumStatic, kNumStatic + kNumDynamic};
  return kFirst.at(static_cast<std::size_t>(kind));
}

std::span<const std::string_view> SplitNames() { return kNames; }

std::optional<CourseSplit> FindSplit(std::string_view name) {
  if (auto indices = StaticIndices(name)) {
    return CourseSplit{CourseKind::kStatic, std::move(*indices)};
  }
  for (const CourseKind kind : {CourseKind::kDynamicBox, CourseKind::kDynamicWall}) {
    if (!name.starts_with(ToString(kind))) continue;
    const std::string_view part = name.substr(ToString(kind).size());
    if (part.empty()) return CourseSplit{kind, Range(0, kNumDynamic)};
    if (part == "-train") return CourseSplit{kind, Range(0, kNumDynamic / 2)};
    if (part == "-test") return CourseSplit{kind, Range(kNumDynamic / 2, kNumDynamic)};
  }
  return std::nullopt;
}

}  // namespace slalom::sim
