#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "app/python/arrays.h"
#include "env/observation.h"
#include "policy/network_agent.h"
#include "policy/policy.h"

namespace slalom::python {

/// A policy that drives, with the metadata of its file.
class Policy {
 public:
  explicit Policy(const std::string& path)
      : path_(path), loaded_(policy::LoadPolicy(path)), agent_(loaded_.snapshot) {}

  const std::string& path() const { return path_; }
  const policy::LoadedPolicy& loaded() const { return loaded_; }
  const policy::PolicySpec& spec() const { return loaded_.snapshot.spec; }

  /// `first`: [B], whether a frame is the first of an episode.
  py::array_t<float> Act(const py::array& given_ranges, const Array<float>& state,
                         const Array<bool>& first) {
    const Array<std::uint16_t> ranges = RangesOf(given_ranges);
    const py::ssize_t batch = ranges.ndim() > 0 ? ranges.shape(0) : 0;
    const env::StepShape shape = spec().step_shape();
    RequireShape("ranges", ranges, {batch, shape.num_beams});
    RequireShape("state", state, {batch, shape.state_size});
    RequireShape("first", first, {batch});
    py::array_t<float> actions({batch, static_cast<py::ssize_t>(shape.action_size)});
    if (batch == 0) return actions;
    float* const out = actions.mutable_data();
    const py::gil_scoped_release release;
    const bool is_new = frames_.batch_size != batch;
    if (is_new) frames_.Resize(static_cast<int>(batch), shape.num_beams, shape.state_size);
    std::copy_n(ranges.data(), ranges.size(), frames_.ranges_cm.begin());
    std::copy_n(state.data(), state.size(), frames_.state.begin());
    for (py::ssize_t i = 0; i < batch; ++i) frames_.first[i] = is_new || first.data()[i];
    agent_.Act(frames_, {out, static_cast<std::size_t>(batch * shape.action_size)});
    return actions;
  }

 private:
  const std::string path_;
  const policy::LoadedPolicy loaded_;
  policy::NetworkAgent agent_;
  env::ObservationBatch frames_;
};

}  // namespace slalom::python
