#include <ATen/ATen.h>
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "base/random.h"
#include "benchmarks/network_products.h"
#include "benchmarks/thread_seconds.h"
#include "policy/network_agent.h"
#include "policy/nn/feature_map.h"
#include "policy/nn/kernels/blas.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/network.h"

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
  SLALOM_CHECK(base::ParseEnum(encoder == "beams" ? "cnn" : encoder, network.encoder));
  if (encoder == "beams") network.cnn_axis = nn::CnnAxis::kBeams;
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

/// Microseconds of an action, features of 720 beams included: by `NetworkAgent` and, beside it in
/// the same run, by the network that is trained, which goes through LibTorch and a BLAS.
void RunAgent(benchmark::State& state, const std::string& encoder, const Size& size, int history,
              int batch) {
  nn::SetMathThreads(1);
  const policy::PolicySpec spec = MakeSpec(encoder, size, history);
  const nn::NetworkShape shape = spec.actor_shape();
  base::Random random(1);
  std::vector<float> weights(shape.num_parameters());
  nn::InitialiseParameters(shape, random, weights);
  const nn::FeatureMap features(spec.observation, spec.network);
  const nn::Network network(shape, nn::ViewWeights(weights));
  const at::Tensor input = at::zeros({batch, shape.num_inputs()});
  nn::NetworkPass pass(shape, input, nn::PassUse::kInference);
  policy::NetworkAgent agent({0, spec, std::make_shared<const std::vector<float>>(weights)});
  env::ObservationBatch observations;
  observations.Resize(batch, 720);
  for (auto& range : observations.ranges_cm)
    range = static_cast<std::uint16_t>(random.NextU64() % 501);
  std::vector<env::Action> actions(batch);
  const auto act = [&] { agent.Act(observations, env::NumbersOf(actions)); };
  const auto act_as_trained = [&] {
    features.PushFrames(observations, history, input.data_ptr<float>());
    network.Forward(pass);
    nn::Tanh(pass.output());
  };
  // Seconds of one call, over about a millisecond.
  const auto measure = [](const auto& call) {
    call();
    const double begin = ThreadSeconds();
    double elapsed = 0.0;
    int calls = 0;
    while (elapsed < 1e-3) {
      for (int i = 0; i < 4; ++i) call();
      calls += 4;
      elapsed = ThreadSeconds() - begin;
    }
    return elapsed / calls;
  };
  double seconds = 0.0, seconds_as_trained = 0.0;
  for (auto _ : state) {
    seconds += measure(act);
    seconds_as_trained += measure(act_as_trained);
  }
  const double scale = 1e6 / static_cast<double>(state.iterations());
  state.counters["us_per_act"] = scale * seconds;
  state.counters["us_by_libtorch"] = scale * seconds_as_trained;
  state.counters["us_per_observation"] = scale * seconds / batch;
  // New weights are brought into the order in which they are read, once for each snapshot.
  state.counters["us_new_weights"] = 1e6 * measure([&] { agent.SetSnapshot(agent.snapshot()); });
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
        for (const int batch : {1, 32}) {
          benchmark::RegisterBenchmark(
              ("Act/" + name + "/" + std::to_string(batch)).c_str(),
              [=](benchmark::State& state) { RunAgent(state, encoder, size, history, batch); })
              ->Iterations(60)
              ->Unit(benchmark::kMicrosecond);
        }
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace slalom
