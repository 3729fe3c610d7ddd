#pragma once

#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "app/train/agent_run_config.h"
#include "app/train/guarded.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "base/parallel.h"
#include "base/version.h"
#include "eval/evaluation.h"
#include "eval/report/report.h"
#include "policy/policy.h"

/// How a policy, a planner or a function is scored, whoever asks for it: a command or Python.

namespace slalom::train {

/// An evaluation that is ready to be driven, any number of times. A value, except that a planner's
/// agents use threads that must outlive it.
struct Scoring {
  eval::EvaluationTask task;
  eval::MakeAgent make_agent;
  eval::Provenance provenance;
  std::optional<eval::TrainingOverlap> training_overlap = std::nullopt;  ///< As in `Evaluation`.
  std::string guard{};                                                   ///< `GuardConfig::label`.
};

/// An evaluation and its provenance.
struct Scores {
  eval::Evaluation evaluation;
  eval::Provenance provenance;
};

/// Prepares to drive the agents of `make_agent` over `courses` with the task, collection and
/// protocol of `config`, under its guard: its `environment`, `courses`, `evaluation` and `guard`.
/// `provenance`: the driver and the name of the courses; the rest is filled in.
template <class Config>
Scoring Prepare(const Config& config, const sim::CourseSet& courses, eval::MakeAgent make_agent,
                eval::Provenance provenance) {
  provenance.collection = config.courses.collection;
  provenance.commit = base::Commit();
  provenance.config = config::ToToml(config);
  return {eval::ResolveEvaluation(config.evaluation, config.environment, courses),
          Guarded(std::move(make_agent), config.guard), std::move(provenance), std::nullopt,
          config.guard.label()};
}

/// Prepares to drive a policy over the courses of `courses_spec` likewise. `make_agent`: makers of
/// agents that drive with it (`MakeAgentsOf`). `trained`: the config that it was trained with; a
/// warning says how many of the courses that it, its teachers or its first policy (`learner.from`)
/// were trained on are driven here. Give none if they are not known or do not matter. Throws
/// `base::Error` if the policy does not fit the task (the error names `policy_source`) or the
/// courses cannot be read.
Scoring PreparePolicy(eval::MakeAgent make_agent, const policy::PolicySnapshot& policy,
                      const std::string& policy_source, const RunConfig& config,
                      const std::string& courses_spec, const std::optional<RunConfig>& trained);

/// Throws `base::Error` that names `policy_source` unless the beams of the task look where they
/// looked in training: a network knows them by their numbers.
void RequireSameFieldOfView(const std::string& policy_source, const sim::EnvironmentConfig& trained,
                            const sim::EnvironmentConfig& task);

/// Prepares to drive the classical planner `name`, or the oracle, likewise. `parallel`: threads on
/// which it plans. Throws `base::Error` if there is no such planner (the error lists them) or the
/// courses cannot be read.
Scoring PreparePlanner(const std::string& name, const AgentRunConfig& config,
                       const std::string& courses_spec, base::ParallelFor& parallel);

/// The provenance of its scores, which says what guards an agent.
eval::Provenance ProvenanceOf(const Scoring& scoring);

/// Runs `eval::EvaluateOnCourses`, with its errors, and shows a line of progress on standard error:
/// episodes, rate, time left and the success so far. Returns nothing if it was stopped before the
/// end.
std::optional<Scores> Score(const Scoring& scoring, base::ParallelFor& parallel,
                            std::stop_token stop);

/// Warns, before a training, if courses on which its policies will be scored are among the courses
/// that these will have been trained on, as `PreparePolicy` does.
void WarnOfTrainingOverlap(const sim::CourseSet& scored, const RunConfig& training);

}  // namespace slalom::train
