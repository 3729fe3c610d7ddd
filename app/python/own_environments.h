#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <span>
#include <vector>

#include "env/environment.h"

namespace slalom::python {

namespace py = pybind11;

/// Environments of the user's own, which are Python objects (`_Driven` of
/// app/python/slalom/actor.py): `reset(seed)` returns a state [S], `step(action)` a tuple of state
/// [S], reward, cost, terminated and truncated. Everything that they raise passes through.
///
/// Called without the interpreter's lock, which it takes for each batch step.
class OwnEnvironments : public env::BatchEnvironment {
 public:
  OwnEnvironments(std::vector<py::object> environments, const env::StepShape& shape);

  int batch_size() const override { return observations_.batch_size; }
  int num_courses() const override { return 1; }
  void Reset(int i, const env::EpisodeSpec& spec) override;
  void Step(std::span<const float> actions, std::span<env::StepResult> results) override;
  const env::ObservationBatch& observations() const override { return observations_; }
  env::StepShape shape() const override { return shape_; }
  base::Pose2 robot_pose(int) const override { return {}; }
  double motion_time(int) const override { return 0.0; }

 private:
  void Take(int i, const py::object& state);

  const std::vector<py::object> environments_;  // [B]
  const env::StepShape shape_;
  env::ObservationBatch observations_;
  std::vector<std::uint8_t> running_;  // [B]
};

}  // namespace slalom::python
