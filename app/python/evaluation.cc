#include "app/python/evaluation.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/python/arrays.h"
#include "app/python/policy.h"
#include "app/python/task.h"
#include "app/train/agent_run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/parallel.h"
#include "base/version.h"
#include "eval/evaluation.h"
#include "eval/report/comparison.h"
#include "eval/report/report.h"
#include "eval/report/report_page.h"
#include "eval/report/result.h"
#include "sim/courses/course_sets.h"
#include "sim/engines/physics.h"

namespace slalom::python {
namespace {

/// Asks a Python function for actions: of (ranges, state, first), as `Policy.act` has them.
class CallableAgent : public env::Agent {
 public:
  explicit CallableAgent(py::function function) : function_(std::move(function)) {}
  ~CallableAgent() override {
    const py::gil_scoped_acquire acquire;
    function_ = {};
  }

  void Act(const env::ObservationBatch& observations, std::span<float> actions) override {
    const py::gil_scoped_acquire acquire;
    const py::ssize_t batch = observations.batch_size, beams = observations.num_beams;
    // Copies, as a function may keep its arguments.
    const py::array_t<std::uint16_t> ranges({batch, beams}, observations.ranges_cm.data());
    const py::array_t<float> state({batch, py::ssize_t{observations.state_size}},
                                   observations.state.data());
    const py::array_t<std::uint8_t> first(batch, observations.first.data());
    const Array<float> chosen =
        py::cast<Array<float>>(function_(ranges, state, first.attr("view")("bool")));
    std::ranges::copy(env::NumbersOf(ActionsOf(chosen, observations.batch_size)), actions.begin());
  }

 private:
  py::function function_;
};

/// An evaluation with its provenance, as `slalom evaluate` prints and writes it.
struct Scores {
  eval::Evaluation evaluation;
  eval::Provenance provenance;
};

/// The keys of an evaluation's rules.
struct Rules {
  eval::EvaluationConfig evaluation;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("evaluation", evaluation, "The rules.");
  }
};

/// Lets Ctrl-C end an evaluation.
void RaiseSignals(const eval::EpisodeCount&) {
  const py::gil_scoped_acquire acquire;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

Scores Evaluate(const py::object& driver, const std::string& name, const std::string& courses,
                const Settings& trained, const std::vector<std::string>& profiles,
                const Settings& task_settings, const Settings& rules_settings,
                const std::string& collection, std::uint64_t generator_seed, int num_threads,
                const std::string& physics) {
  const sim::EnvironmentConfig environment = TaskOf({}, trained, profiles, task_settings);
  Rules rules;
  const config::FieldList fields = config::ListFields(rules);
  for (const auto& [key, value] : rules_settings) config::SetField(key, value, key, fields);
  eval::EvaluationTask task = eval::ResolveEvaluation(
      rules.evaluation, environment, sim::ResolveCourses(courses, collection, generator_seed));
  task.physics = engines::FindPhysics(physics);

  eval::MakeAgent make_agent;
  const bool is_policy = py::isinstance<Policy>(driver);
  if (is_policy) {
    const policy::PolicySnapshot& snapshot = driver.cast<const Policy&>().loaded().snapshot;
    policy::RequireSameInterface(name, snapshot.spec, sim::MakeObservationSpec(environment),
                                 environment.action);
    make_agent = [snapshot](const sim::CourseEnvironments&) {
      return std::make_unique<policy::NetworkAgent>(snapshot);
    };
  } else {
    make_agent = [function = driver.cast<py::function>()](const sim::CourseEnvironments&) {
      const py::gil_scoped_acquire acquire;
      return std::make_unique<CallableAgent>(function);
    };
  }
  base::ParallelFor parallel(num_threads);
  std::optional<eval::Evaluation> evaluation;
  {
    const py::gil_scoped_release release;
    evaluation = eval::EvaluateOnCourses(task, make_agent, &parallel, RaiseSignals);
  }
  return {*std::move(evaluation),
          {.agent = name,
           .kind = is_policy ? "policy" : "python",
           .source = name,
           .profiles = profiles,
           .course_set = courses,
           .collection = collection,
           .commit = std::string(base::Commit()),
           .config = config::ToToml(Task{environment}) + config::ToToml(rules)}};
}

/// The scores of the classical planner `name`, on the task that `slalom evaluate --agent` gives it.
Scores EvaluatePlanner(const std::string& name, const std::string& agent,
                       const std::string& courses, const std::vector<std::string>& profiles,
                       const Settings& task_settings, const Settings& rules_settings,
                       const std::string& collection, std::uint64_t generator_seed, int num_threads,
                       const std::string& physics) {
  const train::AgentRunConfig config = train::ResolveAgentRun([&](train::AgentRunConfig& task) {
    task.environment = TaskOf(task.environment, {}, profiles, task_settings);
    const config::FieldList fields = config::ListFields(task);
    for (const auto& [key, value] : rules_settings) config::SetField(key, value, key, fields);
  });
  const py::gil_scoped_release release;
  base::ParallelFor parallel(num_threads);
  const eval::MakeAgent make_agent = train::MakePlanners(agent, config.planners, parallel);
  eval::EvaluationTask task =
      eval::ResolveEvaluation(config.evaluation, config.environment,
                              sim::ResolveCourses(courses, collection, generator_seed));
  task.physics = engines::FindPhysics(physics);
  auto evaluation = eval::EvaluateOnCourses(task, make_agent, &parallel, RaiseSignals);
  return {*std::move(evaluation),
          {.agent = name,
           .kind = "planner",
           .source = agent,
           .profiles = profiles,
           .course_set = courses,
           .collection = collection,
           .commit = std::string(base::Commit()),
           .config = config::ToToml(config)}};
}

/// Writes the report on evaluations, as `slalom report` does, and returns its tables.
std::string Report(const std::vector<std::string>& evaluations, const std::string& directory) {
  std::vector<eval::Result> results;
  results.reserve(evaluations.size());
  for (const std::string& path : evaluations) results.push_back(eval::ReadResult(path));
  eval::RequireSameProtocol(results);
  const std::filesystem::path place = directory;
  const std::string tables = eval::MarkdownComparison(results);
  base::MakeDirectories(place);
  base::WriteFileAtomically(place / "report.md", tables);
  base::WriteFileAtomically(place / "report.csv", eval::CsvComparison(results));
  base::WriteFileAtomically(place / "report.html", eval::ReportPage(results));
  return tables;
}

}  // namespace

void DefineEvaluation(py::module_& module) {
  py::class_<Scores>(module, "Scores")
      .def("text", [](const Scores& self) { return eval::TextReport(self.evaluation); })
      .def("json",
           [](const Scores& self) { return eval::JsonReport(self.evaluation, self.provenance); })
      .def("course_csv", [](const Scores& self) { return eval::CourseCsv(self.evaluation); })
      .def("episode_csv", [](const Scores& self) { return eval::EpisodeCsv(self.evaluation); })
      .def("write", [](const Scores& self, const std::string& directory) {
        eval::WriteReports(self.evaluation, self.provenance, directory);
      });
  module.def("evaluate", &Evaluate);
  module.def("evaluate_planner", &EvaluatePlanner);
  module.def("planners", &planners::PlannerNames);
  module.def("report", &Report);
}

}  // namespace slalom::python
