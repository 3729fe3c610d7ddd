#include <fmt/format.h>
#include <fmt/ranges.h>

#include "metrics/catalogue.h"

namespace slalom::metrics {
namespace {

constexpr std::string_view kHead =
    "# Metrics\n\n"
    "Every metric that a role shows to Prometheus. `./slalom metrics docs > docs/metrics.md` makes "
    "this page from the\n"
    "list in the code (`metrics/catalogue.h`); a test checks that it is up to date.\n\n"
    "Each role answers `GET /metrics` on its own address (`service.metrics`; for a sweep that of "
    "`slalom sweep serve`,\n"
    "for a training in one process that of `slalom train --metrics`). operations.md says how to "
    "set up Prometheus and\n"
    "Grafana. Every metric has the labels `run` (`run.name` of the config; the sweep's name), "
    "`role` (actor, replay,\n"
    "learner, evaluator, sweep, train) and `name` (of the process; the same after a\n"
    "restart), besides those in the column \"labels\". Units are seconds, bytes and plain ratios "
    "(0 to 1). Names begin with\n"
    "`slalom_`, except for those with `process_`, which Prometheus calls the same in every "
    "program. Counters that are kept\n"
    "on disk continue after a restart; the others begin at 0 again, which `rate()` expects.\n";

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
