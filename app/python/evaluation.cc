#include "app/python/evaluation.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/python/arrays.h"
#include "app/python/policy.h"
#include "app/python/task.h"
#include "base/config.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/version.h"
#include "eval/evaluation.h"
#include "eval/report/report.h"
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

Scores Evaluate(const py::object& driver, const std::string& name, const std::string& courses,
                const Settings& trained, const std::vector<std::string>& profiles,
                const Settings& task_settings, const Settings& rules_settings,
                const std::string& collection, std::uint64_t generator_seed, int num_threads,
                const std::string& physics) {
  const sim::EnvironmentConfig environment = TaskOf(trained, profiles, task_settings);
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
  const auto interrupt = [](const eval::EpisodeCount&) {
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  };
  std::optional<eval::Evaluation> evaluation;
  {
    const py::gil_scoped_release release;
    evaluation = eval::EvaluateOnCourses(task, make_agent, &parallel, interrupt);
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
}

}  // namespace slalom::python
