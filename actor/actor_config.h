#pragma once

#include <cstdint>

#include "base/config_field.h"

namespace slalom::actor {

/// How the noise is spaced from the first environment to the last.
enum class NoiseSpread { kGeometric, kLinear };
inline base::OneOf EnumNames(NoiseSpread) { return {"geometric", "linear"}; }

/// How training episodes are driven.
struct ActorConfig {
  int num_environments = 64;
  double noise_min = 0.1;
  double noise_max = 0.1;
  NoiseSpread noise_spread = NoiseSpread::kGeometric;
  std::int64_t warmup_steps = 0;
  bool time_limit_terminates = false;
  int stats_episodes = 300;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("num_environments", num_environments, base::Range{1, 4096}, "",
      "Environments stepped as one batch.");
    v("noise_min", noise_min, base::Range{0.0, 5.0}, "",
      "Standard deviation of the Gaussian noise on the normalised action in the first "
      "environment.");
    v("noise_max", noise_max, base::Range{0.0, 5.0}, "",
      "The same in the last environment. The environments between them get values spaced as "
      "noise_spread says.");
    v("noise_spread", noise_spread,
      "How the noise is spaced from the first environment to the last: by equal ratios (geometric) "
      "or by equal differences (linear).");
    v("warmup_steps", warmup_steps, base::Range{0, 1.0e12}, "",
      "Environment steps with uniformly random actions before the policy drives; 0: it drives from "
      "the start.");
    v("time_limit_terminates", time_limit_terminates,
      "Store transitions that the time limit ended as terminal, so that the value after them "
      "counts as 0. The original's code does so (docs/original-system.md, section 3.4, F3).");
    v("stats_episodes", stats_episodes, base::Range{1, 100000}, "",
      "Number of most recent episodes over which training success and return are averaged.");
  }
};

}  // namespace slalom::actor
