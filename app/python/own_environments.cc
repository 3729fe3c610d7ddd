#include "app/python/own_environments.h"

#include <algorithm>

#include "app/python/arrays.h"

namespace slalom::python {

OwnEnvironments::OwnEnvironments(std::vector<py::object> environments, const env::StepShape& shape)
    : environments_(std::move(environments)), shape_(shape), running_(environments_.size(), 0) {
  observations_.Resize(static_cast<int>(environments_.size()), shape.num_beams, shape.state_size);
}

void OwnEnvironments::Reset(int i, const env::EpisodeSpec& spec) {
  const py::gil_scoped_acquire acquire;
  // Gymnasium's seeds are not negative, and some environments take 31 bits only.
  Take(i, environments_[i].attr("reset")(spec.seed & 0x7fffffff));
  observations_.first[i] = 1;
  observations_.ended[i] = 0;
  running_[i] = 1;
}

void OwnEnvironments::Step(std::span<const float> actions, std::span<env::StepResult> results) {
  const py::gil_scoped_acquire acquire;
  const auto size = static_cast<std::size_t>(shape_.action_size);
  for (int i = 0; i < batch_size(); ++i) {
    if (!running_[i]) continue;
    py::array_t<float> action(static_cast<py::ssize_t>(size));
    std::ranges::copy(actions.subspan(i * size, size), action.mutable_data());
    const py::tuple step = environments_[i].attr("step")(action);
    Take(i, step[0]);
    const bool terminated = step[3].cast<bool>(), truncated = step[4].cast<bool>();
    results[i] = {.reward = step[1].cast<float>(),
                  .cost = step[2].cast<float>(),
                  .outcome = terminated  ? env::Outcome::kTerminated
                             : truncated ? env::Outcome::kTimeout
                                         : env::Outcome::kRunning};
    running_[i] = !results[i].ended();
    observations_.first[i] = 0;
    observations_.ended[i] = running_[i] ? 0 : 1;
  }
}

void OwnEnvironments::Take(int i, const py::object& state) {
  const auto numbers = state.cast<Array<float>>();
  RequireShape("an observation", numbers, {shape_.state_size});
  std::copy_n(numbers.data(), numbers.size(), observations_.mutable_state(i).begin());
}

}  // namespace slalom::python
