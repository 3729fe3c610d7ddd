#include "app/python/evaluation.h"

#include <algorithm>
#include <cstdint>
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
#include "app/train/run_config.h"
#include "app/train/run_rules.h"
#include "app/train/scoring.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/parallel.h"
#include "eval/comparison/comparison.h"
#include "eval/comparison/printers.h"
#include "eval/comparison/report_page.h"
#include "eval/evaluation.h"
#include "eval/evaluation_config.h"
#include "eval/evaluation_task.h"
#include "eval/report/report.h"
#include "eval/report/result.h"
#include "policy/network_agent.h"
#include "sim/engines/physics.h"

namespace slalom::python {
namespace {

/// Asks a Python function for actions: of (ranges, state, odometry, first), the first two and the
/// last as `Policy.act` has them.
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
    py::array_t<double> odometry({batch, py::ssize_t{5}});
    double* out = odometry.mutable_data();
    for (const env::Odometry& each : observations.odometry) {
      const base::Pose2& pose = each.X_OR;
      for (const double number : {pose.p.x, pose.p.y, pose.yaw, each.linear, each.angular}) {
        *out++ = number;
      }
    }
    const py::array_t<std::uint8_t> first(batch, observations.first.data());
    const Array<float> chosen =
        py::cast<Array<float>>(function_(ranges, state, odometry, first.attr("view")("bool")));
    std::ranges::copy(env::NumbersOf(ActionsOf(chosen, observations.batch_size)), actions.begin());
  }

 private:
  py::function function_;
};

/// What is driven, and by which rules.
struct Request {
  std::string name;  ///< Of the agent in reports.
  std::string courses;
  std::vector<std::string> profiles;
  Settings task;
  std::optional<Settings> guard;  ///< None: no guard, whatever profiles say.
  Settings rules;
  std::string collection;
  std::uint64_t generator_seed = 1;
  int num_threads = 1;
  std::string physics;
  std::optional<py::function> progress;  ///< Called after each control step.

  /// Lays it over the defaults, or over the config that a policy was trained with.
  template <class Config>
  void LayOver(Config& config) const {
    for (const auto& [key, value] : task) eval::RefuseRuleOfTask(key);
    Task laid = TaskOf({config.environment, config.guard}, profiles, task);
    config.environment = std::move(laid.environment);
    config.guard = guard ? laid.guard : planners::GuardConfig{};
    const config::FieldList fields = config::ListFields(config);
    if (guard) LaySettings(*guard, fields);
    for (const auto& [key, value] : rules) config::SetField(key, value, key, fields);
    config.courses.collection = collection;
    config::SetField("courses.generator_seed", std::to_string(generator_seed),
                     "courses.generator_seed", fields);
  }
};

/// The task of a function that drives.
struct FunctionRunConfig {
  train::CollectionConfig courses;
  sim::EnvironmentConfig environment;
  eval::EvaluationConfig evaluation;
  planners::GuardConfig guard;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("courses", courses, "Where set names are looked up.");
    v.Section("environment", environment, "The task.");
    v.Section("evaluation", evaluation, "The rules.");
    v.Section("guard", guard, "A check of each action before the robot gets it.");
  }
};

/// Lets Ctrl-C end an evaluation, and tells how far it is.
eval::Progress ProgressOf(const Request& request) {
  return [&request](const eval::EpisodeCount& count) {
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (!request.progress) return;
    (*request.progress)(py::dict(py::arg("episodes") = count.all, py::arg("ended") = count.ended,
                                 py::arg("successes") = count.successes,
                                 py::arg("collisions") = count.collisions));
  };
}

/// Called without the interpreter's lock.
train::Scores Score(train::Scoring scoring, const Request& request, base::ParallelFor& parallel) {
  scoring.task.physics = engines::FindPhysics(request.physics);
  scoring.provenance.agent = request.name;
  scoring.provenance.profiles = request.profiles;
  auto evaluation =
      eval::EvaluateOnCourses(scoring.task, scoring.make_agent, &parallel, ProgressOf(request));
  evaluation->training_overlap = scoring.training_overlap;
  return {*std::move(evaluation), ProvenanceOf(scoring)};
}

/// The scores of a policy on the task that it was trained for, as `slalom evaluate` has them.
train::Scores EvaluatePolicy(const Policy& policy, const Request& request) {
  const py::gil_scoped_release release;
  base::ParallelFor parallel(request.num_threads);
  const policy::PolicySnapshot& snapshot = policy.loaded().snapshot;
  const auto trained = train::TrainedConfig(policy.loaded().metadata, policy.path());
  train::RunConfig config;
  if (trained) config = *trained;
  train::RequireCourses(config, "slalom.evaluate");
  request.LayOver(config);
  if (trained) {
    train::RequireSameFieldOfView(policy.path(), trained->environment, config.environment);
  }
  const auto make_agent = [&snapshot](const sim::CourseEnvironments&) {
    return std::make_unique<policy::NetworkAgent>(snapshot);
  };
  return Score(
      train::PreparePolicy(make_agent, snapshot, policy.path(), config, request.courses, trained),
      request, parallel);
}

train::Scores EvaluateFunction(const py::function& function, const Request& request) {
  const py::gil_scoped_release release;
  base::ParallelFor parallel(request.num_threads);
  FunctionRunConfig config;
  request.LayOver(config);
  const auto make_agent = [&function](const sim::CourseEnvironments&) {
    const py::gil_scoped_acquire acquire;
    return std::make_unique<CallableAgent>(function);
  };
  return Score(train::Prepare(config, config.courses.Resolve(request.courses), make_agent,
                              {.agent = request.name,
                               .kind = "python",
                               .source = request.name,
                               .course_set = request.courses}),
               request, parallel);
}

/// The scores of the classical planner `planner`, on the task that `slalom evaluate --agent` gives
/// it.
train::Scores EvaluatePlanner(const std::string& planner, const Request& request) {
  const py::gil_scoped_release release;
  base::ParallelFor parallel(request.num_threads);
  const train::AgentRunConfig config = train::ResolveAgentRun(
      [&request](train::AgentRunConfig& defaults) { request.LayOver(defaults); });
  return Score(train::PreparePlanner(planner, config, request.courses, parallel), request,
               parallel);
}

/// Writes the report on evaluations, as `slalom report` does, and returns its tables.
std::string Report(const std::vector<std::string>& evaluations, const std::string& directory) {
  std::vector<eval::Result> results;
  results.reserve(evaluations.size());
  for (const std::string& path : evaluations) results.push_back(eval::ReadResult(path));
  eval::RequireSameProtocol(results);
  const eval::Comparison comparison = eval::CompareResults(results, eval::AgentsOf(results));
  eval::WriteReport(comparison, directory);
  return eval::MarkdownOf(comparison.groups);
}

}  // namespace

void DefineEvaluation(py::module_& module) {
  using train::Scores;
  py::class_<Request>(module, "Request")
      .def(py::init([](std::string name, std::string courses, std::vector<std::string> profiles,
                       Settings task, std::optional<Settings> guard, Settings rules,
                       std::string collection, std::uint64_t generator_seed, int num_threads,
                       std::string physics, std::optional<py::function> progress) {
             RequireThreads(num_threads);
             return Request{std::move(name),       std::move(courses), std::move(profiles),
                            std::move(task),       std::move(guard),   std::move(rules),
                            std::move(collection), generator_seed,     num_threads,
                            std::move(physics),    std::move(progress)};
           }),
           py::kw_only(), py::arg("name"), py::arg("courses"), py::arg("profiles"),
           py::arg("settings"), py::arg("guard"), py::arg("rules"), py::arg("collection"),
           py::arg("generator_seed"), py::arg("threads"), py::arg("physics"), py::arg("progress"));
  py::class_<Scores>(module, "Scores")
      .def("text", [](const Scores& self) { return eval::TextReport(self.evaluation); })
      .def("json",
           [](const Scores& self) { return eval::JsonReport(self.evaluation, self.provenance); })
      .def("course_csv", [](const Scores& self) { return eval::CourseCsv(self.evaluation); })
      .def("episode_csv", [](const Scores& self) { return eval::EpisodeCsv(self.evaluation); })
      .def("write", [](const Scores& self, const std::string& directory) {
        eval::WriteReports(self.evaluation, self.provenance, directory);
      });
  module.def("evaluate_policy", &EvaluatePolicy);
  module.def("evaluate_function", &EvaluateFunction);
  module.def("evaluate_planner", &EvaluatePlanner);
  module.def("planners", &planners::PlannerNames);
  module.def("report", &Report);
}

}  // namespace slalom::python
