#include <ATen/ATen.h>
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "base/random.h"
#include "benchmarks/network_products.h"
#include "benchmarks/thread_seconds.h"
#include "nn/blas.h"
#include "nn/network.h"
#include "policy/network_agent.h"

/// Every network forward and backward, beside the matrix products that it cannot do without,
/// measured in the same run on the same shapes; and acting with it. One thread.

namespace slalom {
namespace {

constexpr int kBatch = 128;

struct Size {
  const char* name;
  int sectors;
  int width;
};
constexpr Size kPaper = {"paper", 0, 512};
constexpr Size kFast = {"fast", 72, 128};

policy::PolicySpec MakeSpec(const std::string& encoder, const Size& size, int history) {
  policy::PolicySpec spec;
  nn::NetworkConfig& network = spec.network;
  network.encoder = encoder == "beams" ? "cnn" : encoder;
  if (encoder == "beams") network.cnn_axis = "beams";
  network.encoder_layers = {size.width, size.width};
  if (encoder == "beams") network.encoder_layers = {32, 32, size.width};
  network.head_layers = {size.width, size.width};
  network.sectors = size.sectors;
  network.history = history;
  return spec;
}

void RunPass(benchmark::State& state, const std::string& encoder, const Size& size, int history,
             bool backward) {
  nn::SetMathThreads(1);
  const policy::PolicySpec spec = MakeSpec(encoder, size, history);
  const nn::NetworkShape shape =
      nn::CriticShape(spec.network, size.sectors == 0 ? 724 : size.sectors + 4);
  std::vector<float> initial(shape.num_parameters());
  base::Random random(1);
  nn::InitialiseParameters(shape, random, initial);
  const at::Tensor parameters = at::from_blob(initial.data(), {shape.num_parameters()}, at::kFloat);
  at::Tensor gradient = at::zeros_like(parameters);
  const nn::Network network(shape, parameters);
  nn::Network network_gradient(shape, gradient);
  const at::Tensor input = at::rand({kBatch, shape.num_inputs() + 2});
  nn::NetworkPass pass(shape, input, backward ? nn::PassUse::kTraining : nn::PassUse::kInference);
  Products products = ForwardProducts(shape, kBatch);
  if (backward) Add(BackwardProducts(shape, kBatch), 1.0, &products);
  const auto run = [&] {
    network.Forward(pass);
    if (!backward) return;
    pass.output_gradient().fill_(1.0 / kBatch);
    network.ParameterGradient(pass, network_gradient);
  };
  run();
  double passes_seconds = 0.0, products_seconds = 0.0;
  std::int64_t rounds = 0, passes = 0;
  for (auto _ : state) {
    // The products are measured between the passes, so both meet the same processor.
    state.PauseTiming();
    products_seconds += MeasureProducts(products, /*small_gemm=*/false, 0.003);
    state.ResumeTiming();
    const double begin = ThreadSeconds();
    double elapsed = 0.0;
    while (elapsed < 0.05) {
      run();
      ++passes;
      elapsed = ThreadSeconds() - begin;
    }
    passes_seconds += elapsed;
    ++rounds;
  }
  const double pass_each = passes_seconds / static_cast<double>(passes);
  const double products_each = products_seconds / static_cast<double>(rounds);
  state.counters["ms"] = 1e3 * pass_each;
  state.counters["sgemm_ms"] = 1e3 * products_each;
  state.counters["of_sgemm"] = products_each / pass_each;
  state.counters["MFLOP"] = CountFlops(products) * 1e-6;
}

/// Microseconds of an action, features of 720 beams included.
void RunAgent(benchmark::State& state, const std::string& encoder, const Size& size, int history,
              int batch) {
  nn::SetMathThreads(1);
  const policy::PolicySpec spec = MakeSpec(encoder, size, history);
  base::Random random(1);
  std::vector<float> weights(spec.actor_shape().num_parameters());
  nn::InitialiseParameters(spec.actor_shape(), random, weights);
  policy::NetworkAgent agent(
      {0, spec, std::make_shared<const std::vector<float>>(std::move(weights))});
  env::ObservationBatch observations;
  observations.Resize(batch, 720);
  for (auto& range : observations.ranges_cm)
    range = static_cast<std::uint16_t>(random.NextU64() % 501);
  std::vector<env::Action> actions(batch);
  agent.Act(observations, actions);
  double seconds = 0.0;
  for (auto _ : state) {
    const double begin = ThreadSeconds();
    agent.Act(observations, actions);
    seconds += ThreadSeconds() - begin;
    benchmark::DoNotOptimize(actions.data());
  }
  state.counters["us_per_observation"] =
      1e6 * seconds / (static_cast<double>(state.iterations()) * batch);
}

const bool kRegistered = [] {
  for (const Size& size : {kPaper, kFast}) {
    for (const char* const encoder : {"mlp", "cnn", "beams", "gru", "transformer"}) {
      for (const int history : {1, 4, 8}) {
        const std::string name =
            std::string(size.name) + "/" + encoder + "/" + std::to_string(history);
        for (const bool backward : {true, false}) {
          benchmark::RegisterBenchmark(
              ((backward ? "Train/" : "Infer/") + name).c_str(),
              [=](benchmark::State& state) { RunPass(state, encoder, size, history, backward); })
              ->Iterations(5)
              ->Unit(benchmark::kMillisecond);
        }
        for (const int batch : {1, 64}) {
          benchmark::RegisterBenchmark(
              ("Act/" + name + "/" + std::to_string(batch)).c_str(),
              [=](benchmark::State& state) { RunAgent(state, encoder, size, history, batch); })
              ->Unit(benchmark::kMicrosecond)
              ->MinTime(0.1);
        }
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace slalom
