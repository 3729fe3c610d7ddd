#include "learner/prediction_error.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::learner {

std::vector<double> PredictionErrors(const nn::TransitionModel& model, int member,
                                     const nn::FeatureMap& features,
                                     const replay::SampledRows& rows, at::Device device) {
  const nn::ModelShape& shape = model.shape();
  const int steps = rows.history - shape.history();
  SLALOM_CHECK_GE(steps, 1);
  const std::int64_t frame = shape.frame_size();
  const std::int64_t width = shape.network.num_inputs();
  const auto scan_of = [&](int sample, int age) {
    return rows.ranges_cm[static_cast<std::size_t>(sample) * rows.history + age];
  };
  const auto state_of = [&](int sample, int age) {
    return rows.state.data() +
           (static_cast<std::size_t>(sample) * rows.history + age) * env::kStateSize;
  };
  // Copies of the first frame stand before the start of an episode.
  const auto begins_with_copy = [&](int sample) {
    return std::equal(state_of(sample, 0), state_of(sample, 0) + env::kStateSize,
                      state_of(sample, 1)) &&
           std::equal(scan_of(sample, 0), scan_of(sample, 0) + rows.shape.num_beams,
                      scan_of(sample, 1));
  };
  std::vector<int> whole;
  for (int i = 0; i < rows.batch; ++i) {
    if (!begins_with_copy(i)) whole.push_back(i);
  }
  if (whole.empty()) return {};
  const auto num_samples = static_cast<std::int64_t>(whole.size());
  at::Tensor frames = at::zeros({num_samples, rows.history, frame}, at::kFloat);
  at::Tensor actions = at::zeros({steps, num_samples, 2}, at::kFloat);
  for (std::int64_t i = 0; i < num_samples; ++i) {
    for (int age = 0; age < rows.history; ++age) {
      const float* const state = state_of(whole[i], age);
      features.Write(scan_of(whole[i], age), state, /*mirrored=*/false,
                     frames.data_ptr<float>() + (i * rows.history + age) * frame);
      if (age < shape.history()) continue;
      float* const action =
          actions.data_ptr<float>() + ((age - shape.history()) * num_samples + i) * 2;
      action[0] = state[2];
      action[1] = state[3];
    }
  }
  frames = frames.to(device);
  actions = actions.to(device);
  at::Tensor input = at::zeros({num_samples, width + 2}, frames.options());
  at::Tensor stack = input.narrow(1, 0, width);
  stack.copy_(frames.narrow(1, 0, shape.history()).reshape({num_samples, width}));
  nn::ModelPass pass(shape, input);
  std::vector<double> errors;
  for (int step = 0; step < steps; ++step) {
    input.narrow(1, width, 2).copy_(actions[step]);
    model.Predict(pass, member, {}, stack);
    const at::Tensor predicted = stack.narrow(1, width - frame, shape.num_predicted);
    const at::Tensor truth =
        frames.select(1, shape.history() + step).narrow(1, 0, shape.num_predicted);
    errors.push_back(std::sqrt((predicted - truth).square().mean().item<double>()));
  }
  return errors;
}

}  // namespace slalom::learner
