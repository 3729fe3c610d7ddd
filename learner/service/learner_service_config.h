#pragma once

#include <cstdint>
#include <string>

#include "base/config_field.h"

namespace slalom::learner {

/// How a learner process fetches batches and publishes policies.
struct LearnerServiceConfig {
  std::string directory;
  int prefetch = 4;
  std::int64_t mirror_bytes = 1 << 30;
  double publish_seconds = 0.02;
  bool exit_when_finished = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("directory", directory,
      "Directory of the run: config, metrics.csv, checkpoints, snapshots and policy. Empty: "
      "learner/ below service.state.");
    v("prefetch", prefetch, base::Range{1, 256}, "batches",
      "Batches that are requested ahead of the one being learned from.");
    v("mirror_bytes", mirror_bytes, base::Range{0, 1e13}, "bytes",
      "Memory for scans that the replay servers have sent, so that each is sent once and later "
      "batches name it by its row. As much as the whole table has scans is used at most. 0: scans "
      "come with each batch.");
    v("publish_seconds", publish_seconds, base::Range{0.0, 3600.0}, "s",
      "Least time between two published policies; run.publish_interval limits them, too.");
    v("exit_when_finished", exit_when_finished,
      "End the process at run.max_steps or run.max_seconds. Otherwise it goes on serving the "
      "policy.");
  }
};

}  // namespace slalom::learner
