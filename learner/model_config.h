#pragma once

#include <cstdint>

#include "base/config_field.h"

namespace slalom::learner {

/// Whether the loss of the next frame is the sum or the mean over its features.
enum class StateLoss { kSum, kMean };
inline base::OneOf EnumNames(StateLoss) { return {"sum", "mean"}; }

/// How a transition model is trained. The defaults are the original's (docs/original-system.md,
/// section 5), except for `held_out`.
struct ModelTrainingConfig {
  double learning_rate = 1e-4;
  double weight_decay = 0.0;
  int batch_size = 128;
  int updates_per_update = 5;
  StateLoss state_loss = StateLoss::kSum;
  double held_out = 0.05;
  int elites = 0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("learning_rate", learning_rate, base::Range{0.0, 1.0}, "",
      "Adam's learning rate for the model.");
    v("weight_decay", weight_decay, base::Range{0.0, 1.0}, "",
      "Decoupled weight decay: each update subtracts this times the learning rate times the "
      "weight.");
    v("batch_size", batch_size, base::Range{1, 65536}, "", "Transitions per update of the model.");
    v("updates_per_update", updates_per_update, base::Range{1, 1000}, "",
      "Updates of the model per update of the policy.");
    v("state_loss", state_loss,
      "Whether the error of the next frame is summed or averaged over its features. The "
      "original's: sum if probabilistic, mean if deterministic.");
    v("held_out", held_out, base::Range{0.0, 0.5}, "",
      "Fraction of transitions that are never trained on, to measure the model's error.");
    v("elites", elites, base::Range{0, 64}, "",
      "Members of the ensemble that predict: those with the smallest held-out error. 0: all.");
  }
};

/// How the policy learns from a model's rollouts.
enum class ImaginationKind { kNone, kDyna, kMbpo };
inline base::OneOf EnumNames(ImaginationKind) { return {"none", "dyna", "mbpo"}; }

/// How the policy learns from a transition model's rollouts. The defaults are the original's Dyna
/// (docs/original-system.md, section 5.2) without its faults.
struct ImaginationConfig {
  ImaginationKind kind = ImaginationKind::kNone;
  int imagined_batches = 10;
  int rollout_steps = 4;
  double noise = 0.1;
  std::int64_t learning_starts = 1000;
  bool as_published = false;
  int final_rollout_steps = 0;
  std::int64_t schedule_begin = 0;
  std::int64_t schedule_end = 0;
  int rollouts = 128;
  std::int64_t buffer_capacity = 50000;
  double real_ratio = 0.05;

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf for_mbpo{"kind", {"mbpo"}};
    v("kind", kind,
      "none: nothing is imagined. dyna: updates from n-step transitions that are imagined from "
      "replayed states. mbpo: rollouts that branch off replayed states fill a buffer of one-step "
      "transitions (docs/models.md).");
    v("imagined_batches", imagined_batches, base::Range{0, 1000}, "",
      "Updates from imagined batches per update from a replayed batch.");
    v("rollout_steps", rollout_steps, base::Range{1, 100}, "steps",
      "Steps imagined from a replayed state: n of Dyna's n-step returns, or the length of MBPO's "
      "rollouts at the start.");
    v("noise", noise, base::Range{0.0, 10.0}, "",
      "Standard deviation of the noise on the policy's actions while imagining.");
    v("learning_starts", learning_starts, base::Range{0, 1e12}, "",
      "Updates of the model before the policy learns from its rollouts.");
    v("as_published", as_published,
      "Reproduce Dyna's published fault M3 (docs/original-system.md, section 5.3): the imagined "
      "state is not advanced, the first action goes with the last reward and frame, and the return "
      "is thrown away.",
      base::ReadIf{"kind", {"dyna"}});
    v("final_rollout_steps", final_rollout_steps, base::Range{0, 100}, "steps",
      "Length of rollouts at the end of the schedule. 0: as at the start.", for_mbpo);
    v("schedule_begin", schedule_begin, base::Range{0, 1e12}, "updates",
      "Updates of the policy at which rollouts begin to grow.", for_mbpo);
    v("schedule_end", schedule_end, base::Range{0, 1e12}, "updates",
      "Updates of the policy at which rollouts reach their final length.", for_mbpo);
    v("rollouts", rollouts, base::Range{1, 65536}, "",
      "Rollouts per replayed batch; a multiple of learner.batch_size.", for_mbpo);
    v("buffer_capacity", buffer_capacity, base::Range{1, 1e9}, "",
      "Imagined transitions kept, the oldest overwritten first.", for_mbpo);
    v("real_ratio", real_ratio, base::Range{0.0, 1.0}, "",
      "Fraction of each batch that is replayed, not imagined.", for_mbpo);
  }
};

}  // namespace slalom::learner
