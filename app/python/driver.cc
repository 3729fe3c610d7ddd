#include "app/python/driver.h"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "app/train/line_driver.h"
#include "base/error.h"
#include "policy/network_agent.h"

namespace slalom::python {
namespace {

namespace py = pybind11;

std::unique_ptr<train::LineDriver> MakeDriver(const std::string& policy, const std::string& planner,
                                              const std::vector<std::string>& profiles,
                                              const std::vector<std::string>& overrides) {
  return std::make_unique<train::LineDriver>(
      train::LineDriverOptions{policy, planner, profiles, overrides},
      [&policy](policy::PolicySnapshot snapshot, const train::RunConfig& config) {
        if (config.mpc.enabled) {
          throw base::Error(fmt::format(
              "{}: this policy plans with a transition model (mpc.enabled), which the Python "
              "package cannot do; drive with it by `slalom act`",
              policy));
        }
        return std::make_unique<policy::NetworkAgent>(std::move(snapshot));
      });
}

}  // namespace

void DefineDriver(py::module_& module) {
  using train::LineDriver;
  py::class_<LineDriver>(module, "Driver")
      .def(py::init(&MakeDriver), py::arg("policy"), py::arg("planner"), py::arg("profiles"),
           py::arg("overrides"), py::call_guard<py::gil_scoped_release>())
      .def("answer", &LineDriver::Answer, py::call_guard<py::gil_scoped_release>())
      .def("needs", &LineDriver::Needs);
}

}  // namespace slalom::python
