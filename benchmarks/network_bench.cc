#include <ATen/ATen.h>
#include <benchmark/benchmark.h>

#include <ctime>
#include <string>
#include <vector>

#include "base/random.h"
#include "benchmarks/thread_seconds.h"
#include "policy/blas.h"
#include "policy/network.h"
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
  policy::NetworkConfig& network = spec.network;
  network.encoder = encoder == "beams" ? "cnn" : encoder;
  if (encoder == "beams") network.cnn_axis = "beams";
  network.encoder_layers = {size.width, size.width};
  if (encoder == "beams") network.encoder_layers = {32, 32, size.width};
  network.head_layers = {size.width, size.width};
  network.sectors = size.sectors;
  network.history = history;
  return spec;
}

/// One matrix product, m x k by k x n.
struct Product {
  std::int64_t m, n, k;
  double count;
};

/// The products of a network's layers.
class Products {
 public:
  explicit Products(bool backward) : backward_(backward) {}

  /// `count` layers y = x w^T: x [m, k], w [n, k]; and backward the gradients by w and, unless it
  /// is the first, by x.
  void Add(std::int64_t m, std::int64_t n, std::int64_t k, double count = 1.0, bool first = false) {
    if (count <= 0.0) return;
    list_.push_back({m, n, k, count});
    if (!backward_) return;
    list_.push_back({n, k, m, count});
    if (!first) list_.push_back({m, k, n, count});
  }

  const std::vector<Product>& list() const { return list_; }

 private:
  bool backward_;
  std::vector<Product> list_;
};

/// What the FLOPs "really needed" are counted from: of a critic, its action beside the features.
std::vector<Product> ListProducts(const policy::NetworkShape& shape, std::int64_t batch,
                                  bool backward) {
  const policy::NetworkConfig& config = shape.config;
  const std::int64_t frame = shape.frame_size, history = config.history, rows = batch * history;
  const std::int64_t width = config.encoder_layers.back();
  Products products(backward);
  if (config.encoder == "gru") {
    products.Add(rows, 3 * width, frame, 1, true);
    products.Add(rows, 3 * width, width);
    products.Add(batch, 3 * width, width, 2.0 * static_cast<double>(history - 1));
  } else if (config.encoder == "transformer") {
    products.Add(rows, width, frame, 1, true);
    products.Add(rows, 3 * width, width);
    products.Add(rows, width, width);
    products.Add(rows, 4 * width, width);
    products.Add(rows, width, 4 * width);
    products.Add(rows, 2 * width, width);  // The last block: keys and values of all,
    products.Add(batch, width, width, 2);  // the rest of the newest.
    products.Add(batch, 4 * width, width);
    products.Add(batch, width, 4 * width);
  } else if (config.encoder == "cnn" && config.cnn_axis == "time") {
    products.Add(batch, width, 3 * frame, static_cast<double>(history - 2), true);
    products.Add(batch, width, history == 1 ? frame : 2 * frame, history == 1 ? 1 : 2, true);
    products.Add(batch, width, history * width);
  } else if (config.encoder == "cnn") {
    const std::int64_t first = (frame - 4 - 5) / 2 + 1, second = (first - 3) / 2 + 1;
    const std::int64_t channels = config.encoder_layers[0];
    products.Add(batch * first, channels, 5 * history, 1, true);
    products.Add(batch * second, channels, 3 * channels);
    products.Add(batch, width, second * channels + 4 * history);
  }
  for (int i = 0; i < shape.mlp.num_layers(); ++i) {
    products.Add(batch, shape.mlp.layer_outputs(i), shape.mlp.layer_inputs(i), 1,
                 i == 0 && !shape.has_encoder());
  }
  return products.list();
}

double CountFlops(const std::vector<Product>& products) {
  double flops = 0.0;
  for (const Product& p : products) flops += p.count * 2.0 * static_cast<double>(p.m * p.n * p.k);
  return flops;
}

/// Seconds that the products take by the BLAS alone.
double MeasureProducts(const std::vector<Product>& products) {
  double total = 0.0;
  for (const Product& p : products) {
    std::vector<float> a(p.m * p.k, 0.5f), b(p.k * p.n, 0.5f), c(p.m * p.n);
    const auto multiply = [&] {
      policy::Sgemm(false, false, p.m, p.n, p.k, a.data(), p.k, b.data(), p.n, c.data(), p.n);
    };
    multiply();
    int count = 0;
    const double begin = ThreadSeconds();
    double elapsed = 0.0;
    while (elapsed < 0.003) {
      multiply();
      ++count;
      elapsed = ThreadSeconds() - begin;
    }
    total += p.count * elapsed / count;
  }
  return total;
}

void RunPass(benchmark::State& state, const std::string& encoder, const Size& size, int history,
             bool backward) {
  policy::SetMathThreads(1);
  const policy::PolicySpec spec = MakeSpec(encoder, size, history);
  const policy::NetworkShape shape =
      policy::CriticShape(spec.network, size.sectors == 0 ? 724 : size.sectors + 4);
  std::vector<float> initial(shape.num_parameters());
  base::Random random(1);
  policy::InitialiseParameters(shape, random, initial);
  const at::Tensor parameters = at::from_blob(initial.data(), {shape.num_parameters()}, at::kFloat);
  at::Tensor gradient = at::zeros_like(parameters);
  const policy::Network network(shape, parameters);
  policy::Network network_gradient(shape, gradient);
  const at::Tensor input = at::rand({kBatch, shape.num_inputs() + 2});
  policy::NetworkPass pass(shape, input,
                           backward ? policy::PassUse::kTraining : policy::PassUse::kInference);
  const std::vector<Product> products = ListProducts(shape, kBatch, backward);
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
    products_seconds += MeasureProducts(products);
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
  policy::SetMathThreads(1);
  const policy::PolicySpec spec = MakeSpec(encoder, size, history);
  base::Random random(1);
  std::vector<float> weights(spec.actor_shape().num_parameters());
  policy::InitialiseParameters(spec.actor_shape(), random, weights);
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
