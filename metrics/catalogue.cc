#include "metrics/catalogue.h"

#include <utility>

#include "metrics/learning_figures.h"

namespace slalom::metrics {
namespace {

using Labels = std::vector<std::string_view>;

// Upper bounds for times from a tenth of a millisecond to a minute, [s].
const std::vector<double> kWait = {0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05,
                                   0.1,    0.2,    0.5,    1.0,   2.0,   5.0,   10.0, 30.0, 60.0};
// The same, closer around 50 ms, which publishing is to stay below.
const std::vector<double> kLatency = {0.001, 0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05,
                                      0.075, 0.1,   0.2,   0.5,  1.0,   2.0,  5.0,  10.0, 60.0};

Labels With(Labels labels, std::string_view label) {
  labels.push_back(label);
  return labels;
}

// Labels of every metric of a sweep's cell, and of one of its scores. app/sweep/sweep_metrics.cc
// has the values.
const Labels kCell = {"sweep", "cell", "row", "method", "network", "training_courses", "seed"};
const Labels kScore = With(With(kCell, "courses"), "snapshot_steps");

Spec Describe(Type type, std::string_view name, std::string_view roles, std::string_view help,
              Labels labels = {}, std::vector<double> buckets = {}) {
  return {name, type, roles, help, std::move(labels), std::move(buckets)};
}

}  // namespace

#define SECTION(title)
#define METRIC(name, type, ...) const Spec name = Describe(Type::type, __VA_ARGS__);
#include "metrics/catalogue.inc"

std::span<const CatalogueSection> Catalogue() {
  static const std::vector<CatalogueSection> sections = [] {
    std::vector<CatalogueSection> all;
#define SECTION(title) all.push_back({title, {}});
#define METRIC(name, ...) all.back().specs.push_back(&name);
#include "metrics/catalogue.inc"
    for (CatalogueSection& section : all) {
      if (section.title != "Learning") continue;
      for (const Spec& figure : LearningSpecs()) section.specs.push_back(&figure);
    }
    return all;
  }();
  return sections;
}

}  // namespace slalom::metrics
