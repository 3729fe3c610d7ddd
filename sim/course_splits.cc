#include "sim/course_splits.h"

#include <algorithm>

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

constexpr int kNumCourses = 300;
constexpr int kNumValidation = 40;

constexpr std::string_view kNames[] = {"static",           "static-test",      "static-train-5",
                                       "static-train-10",  "static-train-50",  "static-train-100",
                                       "static-train-250", "static-train-210", "static-validation",
                                       "static-challenge"};

std::vector<int> First(int n) { return {kTrain100, kTrain100 + n}; }

/// Indices below 300 that are in neither list, ascending.
std::vector<int> AllBut(std::span<const int> a, std::span<const int> b) {
  std::vector<int> rest;
  for (int i = 0; i < kNumCourses; ++i) {
    const bool listed =
        std::find(a.begin(), a.end(), i) != a.end() || std::find(b.begin(), b.end(), i) != b.end();
    if (!listed) rest.push_back(i);
  }
  return rest;
}

std::vector<int> EverySixth() {
  std::vector<int> chosen;
  for (int i = 0; i < kNumCourses; i += 6) chosen.push_back(i);
  return chosen;
}

std::vector<int> Validation() {
  const std::vector<int> candidates = AllBut(kTest, kTrain100);
  std::vector<int> chosen;
  for (std::size_t i = 0; i < kNumValidation; ++i) {
    chosen.push_back(candidates[i * candidates.size() / kNumValidation]);
  }
  return chosen;
}

}  // namespace

std::span<const std::string_view> StaticSplitNames() { return kNames; }

std::optional<std::vector<int>> StaticSplit(std::string_view name) {
  if (name == "static") return AllBut({}, {});
  if (name == "static-test") return std::vector<int>(std::begin(kTest), std::end(kTest));
  if (name == "static-train-5") return First(5);
  if (name == "static-train-10") return First(10);
  if (name == "static-train-50") return First(50);
  if (name == "static-train-100") return First(100);
  if (name == "static-train-250") return AllBut(kTest, {});
  if (name == "static-train-210") return AllBut(kTest, Validation());
  if (name == "static-validation") return Validation();
  if (name == "static-challenge") return EverySixth();
  return std::nullopt;
}

}  // namespace slalom::sim
