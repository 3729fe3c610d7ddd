#include "app/train/evaluate_policy.h"

#include <filesystem>
#include <memory>
#include <utility>

#include "app/train/training_overlap.h"
#include "base/config.h"
#include "base/log.h"
#include "base/random.h"
#include "base/version.h"
#include "policy/policy_agent.h"

namespace slalom::cli {
namespace {

/// What to call a policy in tables: its run, or its file where this has a name of its own.
std::string AgentName(const std::string& policy_source) {
  const std::filesystem::path path(policy_source);
  const std::string run = path.parent_path().filename().string();
  return path.stem() == "policy" && !run.empty() ? run : path.stem().string();
}

}  // namespace

PreparedRun PreparePolicy(const policy::PolicySnapshot& policy, const std::string& policy_source,
                          const train::RunConfig& config, const std::string& courses_spec,
                          const std::optional<train::CoursesConfig>& trained) {
  policy::RequireSameInterface(policy_source, policy.spec,
                               sim::MakeObservationSpec(config.environment),
                               config.environment.action);
  if (config.mpc.enabled && policy.version < config.mpc.learning_starts) {
    spdlog::warn(
        "{}: has had {} updates of mpc.learning_starts = {}, so it is scored without planning",
        policy_source, policy.version, config.mpc.learning_starts);
  }
  const sim::CourseSet courses = config.courses.Resolve(courses_spec);
  std::optional<eval::TrainingOverlap> overlap;
  if (trained) overlap = FindTrainingOverlap(courses, *trained);
  if (overlap && overlap->num_courses > 0) {
    spdlog::warn("{}: {}", policy_source, eval::DescribeOverlap(*overlap));
  }
  eval::Provenance provenance;
  provenance.agent = AgentName(policy_source);
  provenance.kind = "policy";
  provenance.source = policy_source;
  provenance.course_set = courses_spec;
  provenance.collection = config.courses.collection;
  provenance.commit = base::Commit();
  provenance.config = config::ToToml(config);
  const std::uint64_t seed =
      base::DeriveSeed(static_cast<std::uint64_t>(config.run.seed), "mpc of evaluations");
  return {eval::ResolveEvaluation(config.evaluation, config.environment, courses),
          [policy, mpc = config.mpc, seed](int, const sim::EnvironmentConfig&) {
            return policy::MakePolicyAgent(policy, mpc, seed);
          },
          std::move(provenance), std::move(overlap)};
}

std::optional<ScoredRun> EvaluatePolicy(const policy::PolicySnapshot& policy,
                                        const std::string& policy_source,
                                        const train::RunConfig& config,
                                        const std::string& courses_spec,
                                        const std::optional<train::CoursesConfig>& trained,
                                        base::ParallelFor& parallel, std::stop_token stop) {
  return RunScored(PreparePolicy(policy, policy_source, config, courses_spec, trained), parallel,
                   std::move(stop));
}

}  // namespace slalom::cli
