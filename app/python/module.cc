#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/python/actor.h"
#include "app/python/arrays.h"
#include "app/python/driver.h"
#include "app/python/evaluation.h"
#include "app/python/policy.h"
#include "app/python/task.h"
#include "app/python/vector_environment.h"
#include "base/config.h"
#include "base/error.h"
#include "base/log.h"
#include "base/version.h"
#include "policy/network_agent.h"
#include "policy/policy.h"
#include "sim/courses/course_sets.h"
#include "sim/engines/physics.h"

/// The part of the Python package that is C++; app/python/slalom/ is the rest, which users see.

namespace slalom::python {
namespace {

/// A read-only view of numbers that `owner` owns, which lives as long as the view.
template <class T>
py::array View(const py::object& owner, std::span<const T> numbers,
               std::vector<py::ssize_t> shape) {
  py::array view(py::dtype::of<T>(), std::move(shape), numbers.data(), owner);
  view.attr("setflags")(py::arg("write") = false);
  return view;
}
template <class T>
py::array View(const py::object& owner, std::span<const T> numbers) {
  return View(owner, numbers, {static_cast<py::ssize_t>(numbers.size())});
}
py::array FlagView(const py::object& owner, std::span<const std::uint8_t> flags) {
  return View(owner, flags).attr("view")("bool");
}

py::dict FrameViews(const py::object& owner, const env::ObservationBatch& frames) {
  py::dict views;
  views["ranges"] = View(owner, std::span(frames.ranges_cm), {frames.batch_size, frames.num_beams});
  views["state"] = View(owner, std::span(frames.state), {frames.batch_size, frames.state_size});
  return views;
}

std::unique_ptr<VectorEnvironment> MakeEnvironment(
    const std::string& courses, int num_environments, const std::vector<std::string>& profiles,
    const Settings& settings, const std::string& collection, std::uint64_t generator_seed,
    int num_threads, const std::string& autoreset, const std::string& physics) {
  if (num_environments < 1 || num_environments > 65536) {
    throw base::Error(
        fmt::format("num_envs is {}, expected a number from 1 to 65536", num_environments));
  }
  RequireThreads(num_threads);
  VectorConfig config;
  config.environment = TaskOf({}, profiles, settings).environment;
  config.courses = sim::ResolveCourses(courses, collection, generator_seed);
  config.num_environments = num_environments;
  config.num_threads = num_threads;
  if (!base::ParseEnum(autoreset, config.autoreset)) {
    throw base::Error(fmt::format(
        "autoreset_mode is '{}', expected 'SameStep', 'NextStep' or 'Disabled'", autoreset));
  }
  config.physics = engines::FindPhysics(physics);
  return std::make_unique<VectorEnvironment>(config);
}

/// [B, N + S]: the paper's observation of each frame.
py::array_t<float> ObservationsOf(const nn::FeatureMap& features, const py::array& given_ranges,
                                  const Array<float>& state) {
  const Array<std::uint16_t> ranges = RangesOf(given_ranges);
  const py::ssize_t batch = ranges.ndim() > 0 ? ranges.shape(0) : 0;
  const py::ssize_t num_beams = features.num_beams(), size = features.frame_size();
  RequireShape("ranges", ranges, {batch, num_beams});
  RequireShape("state", state, {batch, size - num_beams});
  py::array_t<float> observations({batch, size});
  float* const out = observations.mutable_data();
  const py::gil_scoped_release release;
  for (py::ssize_t i = 0; i < batch; ++i) {
    features.Write(ranges.data() + i * num_beams, state.data() + i * (size - num_beams),
                   /*mirrored=*/false, out + i * size);
  }
  return observations;
}

/// The actor's tensors by name, as its file has them. They share the policy's memory.
py::dict WeightsOf(const py::object& self) {
  const auto& policy = self.cast<const Policy&>();
  py::dict weights;
  const std::span<const float> numbers(*policy.loaded().snapshot.weights);
  for (const nn::ParameterSlot& slot : policy.spec().actor_shape().Slots()) {
    weights[py::str(slot.name)] =
        View(self, numbers.subspan(slot.offset, slot.size()),
             std::vector<py::ssize_t>(slot.shape.begin(), slot.shape.end()));
  }
  return weights;
}

void DefineEnvironment(py::module_& module) {
  using Environment = VectorEnvironment;
  py::class_<Environment>(module, "VectorEnvironment")
      .def(py::init(&MakeEnvironment), py::arg("courses"), py::arg("num_envs"), py::arg("profiles"),
           py::arg("settings"), py::arg("collection"), py::arg("generator_seed"),
           py::arg("threads"), py::arg("autoreset"), py::arg("physics"),
           py::call_guard<py::gil_scoped_release>())
      .def("seed", &Environment::Seed)
      .def("reset", &Environment::Reset, py::arg("i"), py::arg("course") = py::none(),
           py::arg("seed") = py::none())
      .def("step",
           [](Environment& self, const Array<float>& actions) {
             const auto given = ActionsOf(actions, self.size());
             const py::gil_scoped_release release;
             return self.Step(given);
           })
      .def("pose",
           [](const Environment& self, int i) {
             const base::Pose2 pose = self.robot_pose(i);
             return std::make_tuple(pose.p.x, pose.p.y, pose.yaw);
           })
      .def_property_readonly("course_names", &Environment::course_names)
      .def_property_readonly("num_beams",
                             [](const Environment& self) { return self.observations().num_beams; })
      .def_property_readonly(
          "state_bounds",
          [](const Environment& self) {
            std::vector<float> bounds;
            env::ForEachNumber(self.config().observation, [&](const env::StateField& field, auto&) {
              bounds.push_back(field.source == env::StateSource::kActions ? 1.0f : INFINITY);
            });
            return bounds;
          })
      .def_property_readonly(
          "range_clip_cm",
          [](const Environment& self) { return 100.0 * self.config().observation.range_clip; })
      .def_property_readonly(
          "task", [](const Environment& self) { return config::ToToml(Task{self.config()}); })
      .def("views",
           [](const py::object& owner) {
             const auto& self = owner.cast<const Environment&>();
             py::dict views;
             views["observations"] = FrameViews(owner, self.observations());
             views["final_observations"] = FrameViews(owner, self.final_observations());
             views["rewards"] = View(owner, self.rewards());
             views["costs"] = View(owner, self.costs());
             views["terminations"] = FlagView(owner, self.terminations());
             views["truncations"] = FlagView(owner, self.truncations());
             views["ended"] = FlagView(owner, self.ended());
             views["outcomes"] = View(owner, self.outcomes());
             views["final_courses"] = View(owner, self.final_courses());
             views["final_lengths"] = View(owner, self.final_lengths());
             views["final_returns"] = View(owner, self.final_returns());
             views["courses"] = View(owner, self.courses());
             return views;
           })
      .def("observe",
           [](const Environment& self, const py::array& ranges, const Array<float>& state) {
             return ObservationsOf(self.features(), ranges, state);
           });
}

void DefinePolicy(py::module_& module) {
  py::class_<Policy>(module, "Policy")
      .def(py::init<const std::string&>())
      .def("act", &Policy::Act)
      .def("weights", &WeightsOf)
      .def_property_readonly("metadata", [](const Policy& self) { return self.loaded().metadata; })
      .def_property_readonly("version",
                             [](const Policy& self) { return self.loaded().snapshot.version; })
      .def_property_readonly("num_beams",
                             [](const Policy& self) { return self.spec().observation.num_beams; })
      .def_property_readonly("state_size",
                             [](const Policy& self) { return self.spec().observation.state_size; })
      .def_property_readonly("history",
                             [](const Policy& self) { return self.spec().network.history; })
      .def_property_readonly("standstill",
                             [](const Policy& self) {
                               self.spec().RequireCourses("standstill");
                               const env::Action action = self.spec().actions.Standstill();
                               return std::array{action.linear, action.angular};
                             })
      .def("speeds", [](const Policy& self, const Array<float>& actions) {
        const auto given = ActionsOf(actions, static_cast<int>(actions.shape(0)));
        py::array_t<double> speeds({actions.shape(0), actions.shape(1)});
        double* out = speeds.mutable_data();
        for (const env::Action& action : given) {
          *out++ = self.spec().actions.linear_mps(action);
          *out++ = self.spec().actions.angular_radps(action);
        }
        return speeds;
      });
}

/// Throws ImportError if NumPy's arrays are laid out otherwise than this pybind11 knows them: it
/// would read them wrongly, and say nothing.
void RequireKnownNumpy() {
  const std::string numpy = py::str(py::module_::import("numpy").attr("__version__"));
  if (PYBIND11_VERSION_HEX >= 0x020C0000 || numpy.starts_with("1.")) return;
  throw py::import_error(fmt::format(
      "slalom was built by pybind11 {}.{}, which does not know NumPy {}. In your virtual "
      "environment: "
      "pip install pybind11, then run ./slalom python again, which builds slalom with it; or pip "
      "install 'numpy<2'",
      PYBIND11_VERSION_MAJOR, PYBIND11_VERSION_MINOR, numpy));
}

}  // namespace

PYBIND11_MODULE(_slalom, module) {
  RequireKnownNumpy();
  base::InitLog();  // Warnings go to standard error.
  py::register_exception<base::Error>(module, "Error", PyExc_ValueError);
  module.attr("__version__") = base::Version();
  module.attr("commit") = base::Commit();
  module.def("course_sets", [](const std::string& collection) {
    return sim::ListCourseSets(
        collection.empty() ? std::nullopt : std::optional<std::filesystem::path>(collection));
  });
  DefineEnvironment(module);
  DefinePolicy(module);
  DefineDriver(module);
  DefineEvaluation(module);
  DefineActor(module);
}

}  // namespace slalom::python
