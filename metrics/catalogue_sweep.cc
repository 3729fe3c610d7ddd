#include "metrics/catalogue.h"

namespace slalom::metrics {
namespace {

using Labels = std::vector<std::string_view>;

Labels With(Labels labels, std::string_view label) {
  labels.push_back(label);
  return labels;
}

// Of every metric of one cell, and of one of its scores. sweep/sweep_metrics.cc has the values.
const Labels kCell = {"sweep", "cell", "row", "method", "network", "training_courses", "seed"};
const Labels kScore = With(With(kCell, "courses"), "snapshot_steps");

Spec Of(std::string_view name, std::string_view help, Labels labels = kCell) {
  return {name, Type::kGauge, "sweep", help, std::move(labels), {}};
}

}  // namespace

const Spec kSweepCells =
    Of("slalom_sweep_cells",
       "Cells of the sweep in each state: waiting, training, scoring, done, failed.",
       {"sweep", "state"});
const Spec kSweepScores =
    Of("slalom_sweep_scores", "Scores that the plan asks for, over all cells.", {"sweep"});
const Spec kSweepScoresDone =
    Of("slalom_sweep_scores_done", "Those of them that are there.", {"sweep"});
const Spec kSweepCellState =
    Of("slalom_sweep_cell_state",
       "Always 1. The label `state` says what the cell is in now. `cell` is its id; `row` its row "
       "in tables; `method` the algorithm and what it is combined with (td3-lagrangian, sac-mbpo), "
       "or the planner; `network` the encoder, with its history (gru-h4), or none; "
       "`training_courses` how many courses it trains on.",
       With(kCell, "state"));
const Spec kSweepFailed = Of("slalom_sweep_failed", "1 if the cell's last attempt failed, else 0.");
const Spec kSweepSteps =
    Of("slalom_sweep_steps",
       "Environment steps of the cell's training so far. Falls where a killed training goes on "
       "from its checkpoint.");
const Spec kSweepUpdates =
    Of("slalom_sweep_updates",
       "Updates of the cell's training so far, by its metrics.csv. Not shown before the first row, "
       "as for the next two.");
const Spec kSweepTrainingSeconds =
    Of("slalom_sweep_training_seconds", "Time that the cell has spent training.");
const Spec kSweepTrainingSuccessRate =
    Of("slalom_sweep_training_success_rate",
       "Share of the cell's most recent training episodes, with exploration noise, that reached "
       "the goal.");
const Spec kSweepTrainingCourses =
    Of("slalom_sweep_training_courses",
       "Number of courses that the cell trains on, which is a label, too. Not shown for planners.");
const Spec kSweepSuccessRate =
    Of("slalom_sweep_success_rate",
       "Share of a finished score's episodes that reached the goal. `courses` is the name of the "
       "score, `snapshot_steps` the steps after which the policy was kept (0: the trained one).",
       kScore);
const Spec kSweepCollisionRate = Of("slalom_sweep_collision_rate",
                                    "Share of a finished score's episodes that collided.", kScore);

}  // namespace slalom::metrics
