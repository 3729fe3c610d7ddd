#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "base/config.h"
#include "base/random.h"
#include "benchmarks/thread_seconds.h"
#include "learner/learner.h"
#include "learner/model_trainer.h"
#include "policy/nn/kernels/blas.h"
#include "policy/policy_agent.h"

/// Planning for 16 environments, beside the 200 ms that a control step of 5 Hz leaves, and updates
/// of transition models, as presets have them. One thread, by its processor time: other programs on
/// the machine do not count. Argument of a plan: its samples.

namespace slalom {
namespace {

train::RunConfig LoadPreset(const std::string& preset) {
  const std::vector<std::string> overrides = {"learner.device=cpu"};
  return config::Load<train::RunConfig>(SLALOM_SOURCE_DIR "/configs/" + preset, overrides);
}

void Plan(benchmark::State& state, const std::string& preset) {
  constexpr int kEnvironments = 16;
  nn::SetMathThreads(1);
  train::RunConfig config = LoadPreset(preset);
  config.mpc.samples = static_cast<int>(state.range(0));
  config.mpc.learning_starts = 0;
  const policy::PolicySpec spec = train::MakePolicySpec(config);
  const policy::PolicySnapshot snapshot = learner::Learner(config.method, spec, 1).Snapshot();
  const auto agent = policy::MakePolicyAgent(snapshot, config.mpc, 1);
  const int num_beams = spec.observation.num_beams;
  env::ObservationBatch observations;
  observations.Resize(kEnvironments, num_beams);
  base::Random random(1);
  for (auto& range : observations.ranges_cm) {
    range = static_cast<std::uint16_t>(random.UniformInt(501));
  }
  std::vector<env::Action> actions(kEnvironments);
  const double begin = ThreadSeconds();
  for (auto _ : state) agent->Act(observations, env::NumbersOf(actions));
  const double seconds = (ThreadSeconds() - begin) / static_cast<double>(state.iterations());
  const auto actor_size = static_cast<double>(snapshot.weights->size());
  const auto critic_size = static_cast<double>(snapshot.critic_weights->size());
  const auto model_size = static_cast<double>(spec.model_shape().num_member_parameters());
  const double flops = 2.0 * kEnvironments * config.mpc.samples * config.mpc.iterations *
                       (config.mpc.horizon * (actor_size + model_size) + actor_size + critic_size);
  state.counters["plans/s"] = kEnvironments / seconds;
  state.counters["share_of_5Hz"] = seconds / 0.2;
  state.counters["GFLOP/s"] = 1e-9 * flops / seconds;
}

void UpdateModel(benchmark::State& state, const std::string& preset) {
  nn::SetMathThreads(1);
  train::RunConfig config = LoadPreset(preset);
  config.method.model_training.updates_per_update = 1;
  const policy::PolicySpec spec = train::MakePolicySpec(config);
  const nn::FeatureMap features(spec.observation, spec.network);
  learner::ModelTrainer trainer(config.method.model_training, spec.model_shape(), features, 1.0,
                                false, at::kCPU, 1);
  // Learns from zeros, which cost what other numbers do.
  const double begin = ThreadSeconds();
  for (auto _ : state) trainer.Update();
  const double seconds = (ThreadSeconds() - begin) / static_cast<double>(state.iterations());
  state.counters["updates/s"] = 1.0 / seconds;
  state.counters["GFLOP/s"] = 1e-9 * 6.0 * config.method.model_training.batch_size *
                              static_cast<double>(spec.model_shape().num_parameters()) / seconds;
}

[[maybe_unused]] const bool registered = [] {
  for (const std::string size : {"fast", "paper"}) {
    for (const std::string kind : {"deterministic", "probabilistic"}) {
      const std::string name = size + "/mpc-" + kind + "-mlp";
      const std::string preset = name + ".toml";
      benchmark::RegisterBenchmark(("Plan/" + name).c_str(),
                                   [preset](benchmark::State& state) { Plan(state, preset); })
          ->Arg(256)
          ->Arg(64)
          ->Unit(benchmark::kMillisecond);
      benchmark::RegisterBenchmark(("UpdateModel/" + name).c_str(), [preset](
                                                                        benchmark::State& state) {
        UpdateModel(state, preset);
      })->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace slalom
