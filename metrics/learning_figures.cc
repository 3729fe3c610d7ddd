#include "metrics/learning_figures.h"

#include <string>
#include <string_view>
#include <vector>

namespace slalom::metrics {
namespace {

struct NamedSpec {
  std::string name;
  std::string_view help;
};

struct ListSpecs {
  void operator()(std::string_view name, double, std::string_view help) {
    specs.push_back({"slalom_" + std::string(name), help});
  }
  std::vector<NamedSpec> specs;
};

struct SetGauges {
  void operator()(std::string_view, double value, std::string_view) {
    registry.gauge(LearningSpecs()[next++]).Set(value);
  }
  Registry& registry;
  std::size_t next = 0;
};

}  // namespace

std::span<const Spec> LearningSpecs() {
  static const std::vector<NamedSpec> named = [] {
    ListSpecs list;
    LearningFigures().Visit(list);
    return list.specs;
  }();
  static const std::vector<Spec> specs = [] {
    std::vector<Spec> all;
    all.reserve(named.size());
    for (const NamedSpec& spec : named) {
      all.push_back({spec.name, Type::kGauge, "learner, train", spec.help, {}, {}});
    }
    return all;
  }();
  return specs;
}

void ShowLearning(LearningFigures figures, Registry& registry) {
  SetGauges set{registry};
  figures.Visit(set);
}

}  // namespace slalom::metrics
