#include "app/python/actor.h"

#include <pybind11/stl.h>

#include <numeric>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "app/python/own_environments.h"
#include "app/train/drive_actor.h"
#include "app/train/service_process.h"
#include "base/error.h"
#include "policy/network_agent.h"

namespace slalom::python {
namespace {

/// The actor of an environment of the user's own: `actor::ActorService` as in `slalom actor`.
class Actor {
 public:
  /// Throws `base::Error` if the config is unusable or for courses.
  Actor(const std::string& config, const std::vector<std::string>& overrides,
        const std::optional<std::string>& name)
      : process_(transport::Role::kActor, {config, overrides, name}) {
    if (task().is_own()) return;
    throw base::Error(
        "task.observation_size is 0, expected the size of your environment's observations: courses "
        "are driven by `slalom actor`");
  }

  const train::TaskConfig& task() const { return process_.config().task; }
  int num_environments() const { return process_.config().actor.num_environments; }
  const std::string& name() const { return process_.name(); }

  /// Called with the interpreter's lock, which it gives up while it waits and sends.
  py::dict Run(std::vector<py::object> environments) {
    const train::RunConfig& config = process_.config();
    OwnEnvironments own(std::move(environments), train::StepShapeOf(config));
    policy::NetworkAgent agent(policy::ZeroSnapshot(train::MakePolicySpec(config)));
    // What a signal's handler raises ends the actor as a stop does, and is raised then.
    std::optional<py::error_already_set> raised;
    const auto look_for_signals = [&] {
      const py::gil_scoped_acquire acquire;
      if (PyErr_CheckSignals() == 0) return;
      raised.emplace();
      stop_.request_stop();
    };
    actor::StepAccount account;
    {
      const py::gil_scoped_release release;
      account = train::DriveActor(process_, own, agent, "own", stop_.get_token(), look_for_signals);
    }
    if (raised) throw *raised;
    py::dict steps;
    steps["made"] = account.made;
    steps["accepted"] = account.accepted;
    steps["kept"] = account.pending;
    steps["lost"] = std::accumulate(account.lost.begin(), account.lost.end(), std::int64_t{0});
    return steps;
  }

  void Stop() { stop_.request_stop(); }
  /// The next run starts without the stop that ended the last one.
  void ForgetStop() { stop_ = std::stop_source(); }

 private:
  train::ServiceProcess process_;
  std::stop_source stop_;
};

}  // namespace

void DefineActor(py::module_& module) {
  py::class_<Actor>(module, "Actor")
      .def(py::init<const std::string&, const std::vector<std::string>&,
                    const std::optional<std::string>&>())
      .def_property_readonly("num_envs", &Actor::num_environments)
      .def_property_readonly("name", &Actor::name)
      .def_property_readonly("observation_size",
                             [](const Actor& self) { return self.task().observation_size; })
      .def_property_readonly("action_low", [](const Actor& self) { return self.task().action_low; })
      .def_property_readonly("action_high",
                             [](const Actor& self) { return self.task().action_high; })
      .def("run", &Actor::Run)
      .def("stop", &Actor::Stop)
      .def("forget_stop", &Actor::ForgetStop);
}

}  // namespace slalom::python
