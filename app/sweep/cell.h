#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/sweep/plan.h"
#include "app/train/resolved_run.h"
#include "app/train/run_identity.h"

namespace slalom::sweep {

/// One evaluation that a cell needs: `slalom evaluate --config TASK --courses COURSES`.
struct ScoreTask {
  std::string name;     ///< Name of the plan's score.
  std::string digest;   ///< Digest (16 hex digits) of all that decides its result but the policy.
  std::string task;     ///< The config of the evaluation: TOML, every key.
  std::string courses;  ///< Course set as `--courses` takes it.
  std::string physics;  ///< What moves the robot, as `--physics` takes it.
  int num_courses = 0;  ///< Number of courses in that set.
  std::int64_t num_episodes = 0;
  std::int64_t snapshot_steps = 0;  ///< Steps of the scored snapshot; 0: the final policy.
};

/// One unit of work of a sweep: a training and its scores, or the scores of a planner. A value.
struct Cell {
  std::string id;     ///< Digest of everything that decides the training: 16 hex digits.
  std::string group;  ///< Name of the plan's group.
  /// Labels of the group, if there are several, and of each axis but the columns' axis.
  std::vector<std::string> row;
  std::string column;  ///< Label on the axis of the columns; empty if there is none.
  std::int64_t seed = 0;
  std::string planner;                       ///< Empty if a policy is trained.
  std::optional<train::ResolvedRun> config;  ///< Config of the training; empty for a planner.
  int num_actors = 0;      ///< Actors of the service that trains it; 0: one process trains it.
  std::string collection;  ///< Name of the courses' collection; empty if built in.
  std::string friction;    ///< Friction law of the robot, as configs name it, or "drawn".
  int num_training_courses = 0;
  std::vector<ScoreTask> scores;

  /// "TD3 / 50", the row's name in tables.
  std::string row_name() const;
  /// "TD3 / 50", or "TD3 / 50, walls" if there is an axis of columns: all seeds of a training.
  std::string training_name() const;
  /// "TD3 / 50, seed 2", or "TD3 / 50, walls, seed 2", for progress and errors.
  std::string name() const;
};

/// A plan, resolved. A value.
struct Cells {
  std::vector<Cell> cells;              ///< Seeds of a row in turn, rows in the plan's order.
  std::vector<std::string> axis_names;  ///< Axes of `Cell::row`, for the heads of tables.
};

/// Resolves a plan: reads every course set, and reads and checks every config as `slalom train`
/// would. Puts `platform` into the cells' ids unless the plan mixes platforms. Throws `base::Error`
/// that names the plan's file, the line if there is one, and what was expected, if a config does
/// not have a key or value, a training could learn nothing, a course set does not exist, or two
/// cells have one id.
Cells ExpandPlan(const Plan& plan, const train::Platform& platform);

}  // namespace slalom::sweep
