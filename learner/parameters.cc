#include "learner/parameters.h"

#include <ATen/ATen.h>

#include <span>
#include <vector>

namespace slalom::learner {

at::Tensor InitialParameters(const nn::NetworkShape& shape, int num_networks, base::Random& random,
                             at::Device device) {
  const std::int64_t size = shape.num_parameters();
  std::vector<float> host(static_cast<std::size_t>(num_networks * size));
  for (int i = 0; i < num_networks; ++i) {
    nn::InitialiseParameters(shape, random, std::span(host).subspan(i * size, size));
  }
  return at::from_blob(host.data(), {num_networks * size}, at::kFloat).clone().to(device);
}

}  // namespace slalom::learner
