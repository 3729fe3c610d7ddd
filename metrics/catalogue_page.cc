#include <fmt/format.h>
#include <fmt/ranges.h>

#include "metrics/catalogue.h"

namespace slalom::metrics {
namespace {

constexpr std::string_view kHead =
    "# Metrics\n\n"
    "Every metric that a role shows to Prometheus. Made by `./slalom metrics docs > "
    "docs/metrics.md` from the list in\n"
    "the code (`metrics/catalogue.h`); a test checks that it is fresh.\n\n"
    "Each role answers `GET /metrics` on its own address (`service.metrics`); operations.md says "
    "how Prometheus and Grafana\n"
    "are set up. All metrics have the labels `run` (`run.name` of the config), `role` (actor, "
    "replay, learner, evaluator)\n"
    "and `name` (of the process; the same after a restart), and those of the column besides. Units "
    "are seconds, bytes and\n"
    "plain ratios (0 to 1). Names begin with `slalom_`, but for `process_`, which Prometheus gives "
    "the same name in every\n"
    "program. Counters that are kept on disk go on over restarts; the others begin at 0, as "
    "`rate()` expects.\n";

std::string Buckets(const Spec& spec) {
  if (spec.buckets.empty()) return "";
  return fmt::format(" Buckets from {} to {} s.", spec.buckets.front(), spec.buckets.back());
}

}  // namespace

std::string PrintMarkdown() {
  std::string page(kHead);
  for (const CatalogueSection& section : Catalogue()) {
    page += fmt::format("\n## {}\n\n", section.title);
    page += "| metric | type | labels | shown by | meaning |\n|---|---|---|---|---|\n";
    for (const Spec* spec : section.specs) {
      page += fmt::format("| `{}` | {} | {} | {} | {}{} |\n", spec->name, ToString(spec->type),
                          fmt::join(spec->labels, ", "), spec->roles, spec->help, Buckets(*spec));
    }
  }
  return page;
}

}  // namespace slalom::metrics
