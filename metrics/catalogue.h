#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "metrics/registry.h"

/// Every metric that exists, as a `Spec` such as `kQueueDepth`. metrics/catalogue.inc describes
/// each of them once: its meaning, the roles that show it and the values of its labels. `slalom
/// metrics docs` prints docs/metrics.md from that list.

namespace slalom::metrics {

#define SECTION(title)
#define METRIC(name, ...) extern const Spec name;
#include "metrics/catalogue.inc"

/// Label values that several roles must spell alike.
namespace queue {
inline constexpr std::string_view kUnacknowledged = "unacknowledged";  ///< Chunks of an actor.
inline constexpr std::string_view kInserts = "inserts";  ///< Chunks held by the rate limiter.
inline constexpr std::string_view kSamples = "samples";  ///< Requests held by the rate limiter.
inline constexpr std::string_view kJournal = "journal";  ///< Chunks not yet written.
inline constexpr std::string_view kBatches = "batches";  ///< Prefetched by the learner.
}  // namespace queue

/// A group of metrics and its title on the page. The learner's figures
/// (metrics/learning_figures.h) are in "Learning".
struct CatalogueSection {
  std::string_view title;
  std::vector<const Spec*> specs;
};
/// Returns all sections in the order of the page.
std::span<const CatalogueSection> Catalogue();

/// The text of docs/metrics.md.
std::string PrintMarkdown();

}  // namespace slalom::metrics
