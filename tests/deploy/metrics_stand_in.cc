// Shows the whole catalogue as the four roles would, with values that move, on four free ports,
// which it prints ("replay 41234"). Ends when its standard input does.

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "metrics/catalogue.h"
#include "metrics/exposer.h"

namespace slalom {
namespace {

using metrics::Spec;
using Values = std::vector<std::string_view>;

/// What a label may hold.
const Values& ValuesOf(std::string_view label) {
  static const std::map<std::string_view, Values> values = {
      {"outcome", {"success", "collision", "timeout"}},
      {"course_set", {"static-test"}},
      {"reason", {"killed", "replaced", "bad_message"}},
      {"queue", {"unacknowledged", "inserts", "samples", "journal", "batches"}},
      {"peer_role", {"actor", "learner"}},
      {"server", {"replay", "learner"}},
      {"message", {"Hello", "Insert"}},
      {"expected", {"0.5", "0.9"}},
  };
  return values.at(label);
}

struct StandIn {
  explicit StandIn(std::string_view role_name)
      : role(role_name), registry(std::string(role), std::string(role) + "-1") {
    for (const metrics::CatalogueSection& section : metrics::Catalogue()) {
      for (const Spec* spec : section.specs) Add(*spec);
    }
    exposer = std::make_unique<metrics::Exposer>("127.0.0.1:0", registry);
  }

  bool Shows(const Spec& spec) const {
    if (spec.roles == "all") return false;  // The registry has these by itself.
    return (", " + std::string(spec.roles) + ",").find(" " + std::string(role) + ",") !=
           std::string::npos;
  }

  void Add(const Spec& spec) {
    if (!Shows(spec)) return;
    switch (spec.labels.size()) {
      case 0:
        return Add(spec, {});
      case 1:
        for (const auto a : ValuesOf(spec.labels[0])) Add(spec, {a});
        return;
      default:
        for (const auto a : ValuesOf(spec.labels[0])) {
          for (const auto b : ValuesOf(spec.labels[1])) Add(spec, {a, b});
        }
    }
  }

  void Add(const Spec& spec, std::initializer_list<std::string_view> values) {
    if (spec.type == metrics::Type::kCounter) counters.push_back(registry.counter(spec, values));
    if (spec.type == metrics::Type::kGauge) gauges.push_back(registry.gauge(spec, values));
    if (spec.type == metrics::Type::kHistogram) {
      histograms.push_back(registry.histogram(spec, values));
    }
  }

  void Move(int tick) {
    for (metrics::Counter& counter : counters) counter.Increment(3.0);
    for (metrics::Gauge& gauge : gauges) gauge.Set(1.0 + tick % 7);
    for (metrics::Histogram& histogram : histograms) histogram.Observe(0.01 * (1 + tick % 7));
  }

  std::string_view role;
  metrics::Registry registry;
  std::vector<metrics::Counter> counters;
  std::vector<metrics::Gauge> gauges;
  std::vector<metrics::Histogram> histograms;
  std::unique_ptr<metrics::Exposer> exposer;
};

void Run() {
  std::vector<std::unique_ptr<StandIn>> roles;
  for (const std::string_view role : {"replay", "learner", "actor", "evaluator"}) {
    roles.push_back(std::make_unique<StandIn>(role));
    fmt::print("{} {}\n", role, roles.back()->exposer->port());
  }
  std::fflush(stdout);
  pollfd input{STDIN_FILENO, POLLIN, 0};
  for (int tick = 0; poll(&input, 1, 100) == 0; ++tick) {
    for (const auto& role : roles) role->Move(tick);
  }
}

}  // namespace
}  // namespace slalom

int main() { slalom::Run(); }
