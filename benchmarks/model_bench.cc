#include <benchmark/benchmark.h>

#include <ctime>
#include <memory>
#include <vector>

#include "base/random.h"
#include "benchmarks/thread_seconds.h"
#include "learner/model_trainer.h"
#include "policy/blas.h"
#include "policy/mpc_agent.h"

/// Planning for 16 environments, beside the 200 ms that a control step of 5 Hz leaves, and updates
/// of transition models. One thread, by its processor time: other programs on the machine do not
/// count. Arguments: 1 for the paper's sizes, 0 for those of configs/fast.toml; then samples.

namespace slalom {
namespace {

policy::PolicySpec MakeSpec(bool paper, const char* kind) {
  policy::PolicySpec spec;
  spec.planning.model.kind = kind;
  if (paper) return spec;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {128, 128};
  spec.network.sectors = 72;
  spec.network.range_transform = "inverse";
  spec.planning.model.encoder_layers = {};
  spec.planning.model.head_layers = {128, 128};
  return spec;
}

std::shared_ptr<const std::vector<float>> RandomWeights(const policy::NetworkShape& shape,
                                                        base::Random& random) {
  std::vector<float> weights(shape.num_parameters());
  policy::InitialiseParameters(shape, random, weights);
  return std::make_shared<const std::vector<float>>(std::move(weights));
}

void Plan(benchmark::State& state) {
  constexpr int kEnvironments = 16;
  policy::SetMathThreads(1);
  policy::MpcConfig config;
  config.samples = static_cast<int>(state.range(1));
  config.learning_starts = 0;
  policy::PolicySnapshot snapshot;
  snapshot.spec = MakeSpec(state.range(0) != 0, "deterministic");
  base::Random random(1);
  snapshot.weights = RandomWeights(snapshot.spec.actor_shape(), random);
  snapshot.critic_weights = RandomWeights(snapshot.spec.critic_shape(), random);
  snapshot.model_weights = RandomWeights(snapshot.spec.model_shape().network, random);
  policy::MpcAgent agent(config, snapshot, 1);
  env::ObservationBatch observations;
  observations.Resize(kEnvironments, 720);
  for (auto& range : observations.ranges_cm) {
    range = static_cast<std::uint16_t>(random.UniformInt(501));
  }
  std::vector<env::Action> actions(kEnvironments);
  const double begin = ThreadSeconds();
  for (auto _ : state) agent.Act(observations, actions);
  const double seconds = (ThreadSeconds() - begin) / static_cast<double>(state.iterations());
  const double rolled = static_cast<double>(config.samples) * config.horizon;
  const double flops =
      2.0 * kEnvironments *
      (rolled * static_cast<double>(snapshot.weights->size() + snapshot.model_weights->size()) +
       config.samples *
           static_cast<double>(snapshot.weights->size() + snapshot.critic_weights->size()));
  state.counters["cpu_ms"] = 1e3 * seconds;
  state.counters["share_of_5Hz"] = seconds / 0.2;
  state.counters["GFLOP/s"] = 1e-9 * flops / seconds;
}
BENCHMARK(Plan)->Args({0, 256})->Args({0, 64})->Args({1, 256})->Args({1, 64})->Args({1, 32})->Unit(
    benchmark::kMillisecond);

void UpdateModel(benchmark::State& state) {
  policy::SetMathThreads(1);
  const policy::PolicySpec spec =
      MakeSpec(state.range(0) != 0, state.range(1) != 0 ? "probabilistic" : "deterministic");
  const policy::FeatureMap features(spec.observation, spec.network);
  learner::ModelTrainer trainer({.updates_per_update = 1}, spec.model_shape(), features, 1.0, false,
                                at::kCPU, 1);
  // Learns from zeros, which cost what other numbers do.
  const double begin = ThreadSeconds();
  for (auto _ : state) trainer.Update();
  const double seconds = (ThreadSeconds() - begin) / static_cast<double>(state.iterations());
  state.counters["updates/s"] = 1.0 / seconds;
  state.counters["GFLOP/s"] =
      1e-9 * 6.0 * 128 * static_cast<double>(spec.model_shape().num_parameters()) / seconds;
}
BENCHMARK(UpdateModel)->ArgsProduct({{0, 1}, {0, 1}})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace slalom
