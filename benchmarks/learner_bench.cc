#include <ATen/Parallel.h>
#include <benchmark/benchmark.h>

#include <ctime>
#include <optional>
#include <vector>

#include "base/check.h"
#include "base/random.h"
#include "benchmarks/thread_seconds.h"
#include "learner/algorithm.h"
#include "learner/learner.h"
#include "learner/minibatch.h"
#include "policy/blas.h"
#include "policy/feature_map.h"
#include "policy/network_agent.h"
#include "policy/small_gemm.h"
#include "replay/table.h"

/// TD3 updates beside the matrix products that they cannot do without, measured in the same run on
/// the same shapes, and the inference of a policy. One thread.

namespace slalom {
namespace {

policy::PolicySpec FastSpec() {
  policy::PolicySpec spec;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {128, 128};
  spec.network.sectors = 72;
  spec.network.range_transform = "inverse";
  return spec;
}

/// A table of many random frames, so that sampling meets cold memory as in training.
replay::Table MakeTable(std::int64_t num_frames) {
  constexpr int kBeams = 720;
  constexpr int kEpisodeSteps = 50;
  replay::Table table({.capacity = num_frames}, kBeams);
  base::Random random(1);
  replay::Chunk chunk(kBeams);
  std::vector<std::uint16_t> ranges(kBeams);
  std::vector<float> state(env::kStateSize);
  const auto frame = [&] {
    for (auto& range : ranges) range = static_cast<std::uint16_t>(random.NextU64() % 501);
    for (float& value : state) value = static_cast<float>(random.Uniform(-1.0, 1.0));
    return env::FrameView{ranges, std::span(state).first<env::kStateSize>()};
  };
  for (std::int64_t i = 0; i + kEpisodeSteps < num_frames; i += kEpisodeSteps + 1) {
    chunk.Clear();
    for (int step = 0; step < kEpisodeSteps; ++step) {
      const bool last = step + 1 == kEpisodeSteps;
      const env::StepResult result{
          .reward = 1.0f, .outcome = last ? env::Outcome::kSuccess : env::Outcome::kRunning};
      chunk.AddStep(0, step == 0, frame(), {0.5f, -0.5f}, result);
    }
    chunk.AddFinal(0, frame());
    table.Insert(chunk);
  }
  return table;
}

/// One matrix product of an update, m x k by k x n.
struct Product {
  std::int64_t m, n, k;
  double per_update;
};

/// What an update does with its networks, on average.
struct Work {
  const char* algorithm;
  double critics;           // Trained, each with a target that is computed.
  double action_gradients;  // Critics whose gradient by the action is taken.
  double actor_updates;
};
constexpr Work kTd3 = {"td3", 2.0, 0.5, 0.5};  // Delay 2.
constexpr Work kDdpg = {"ddpg", 1.0, 1.0, 1.0};
constexpr Work kSac = {"sac", 2.0, 2.0, 1.0};

/// The products of an update: what the FLOPs "really needed" are counted from.
std::vector<Product> ListProducts(const policy::PolicySpec& spec, const Work& work,
                                  std::int64_t batch) {
  const policy::MlpShape actor = spec.actor_shape().mlp;
  const policy::MlpShape critic =
      policy::CriticShape(spec.network, actor.num_inputs / spec.network.history).mlp;
  std::vector<Product> products;
  for (int i = 0; i < critic.num_layers(); ++i) {
    const std::int64_t in = critic.layer_inputs(i);
    const std::int64_t before = i == 0 ? 0 : critic.hidden[i - 1];
    const std::int64_t out = critic.layer_outputs(i);
    // Q' and Q of all, then Q of pi(s).
    products.push_back({batch, out, in, 2 * work.critics + work.action_gradients});
    products.push_back({out, in, batch, work.critics});  // By the weights.
    if (i > 0) {
      const double through = i > critic.extra_layer ? work.action_gradients : 0.0;
      products.push_back({batch, before, out, work.critics + through});
    }
    if (i == critic.extra_layer) {
      products.push_back({batch, critic.num_extra, out, work.action_gradients});
    }
  }
  for (int i = 0; i < actor.num_layers(); ++i) {
    const std::int64_t in = actor.layer_inputs(i);
    const std::int64_t out = actor.layer_outputs(i);
    products.push_back({batch, out, in, 1 + work.actor_updates});
    products.push_back({out, in, batch, work.actor_updates});
    if (i > 0) products.push_back({batch, in, out, work.actor_updates});
  }
  return products;
}

double CountFlops(const std::vector<Product>& products) {
  double flops = 0.0;
  for (const Product& p : products)
    flops += p.per_update * 2.0 * static_cast<double>(p.m * p.n * p.k);
  return flops;
}

/// Seconds that the products of one update take by themselves, by our kernel or the BLAS.
double MeasureProducts(const std::vector<Product>& products, bool small_gemm, double seconds_each) {
  const policy::CpuFeatures cpu = policy::DetectCpuFeatures();
  double total = 0.0;
  for (const Product& p : products) {
    std::vector<float> a(p.m * p.k, 0.5f), b(p.k * p.n, 0.5f), c(p.m * p.n);
    const policy::GemmTask task{.m = p.m,
                                .n = p.n,
                                .k = p.k,
                                .a = a.data(),
                                .lda = p.k,
                                .b = b.data(),
                                .ldb = p.n,
                                .c = c.data(),
                                .ldc = p.n};
    const auto multiply = [&] {
      if (small_gemm && policy::SmallGemm(task, cpu)) return;
      policy::Sgemm(false, false, p.m, p.n, p.k, a.data(), p.k, b.data(), p.n, c.data(), p.n);
    };
    multiply();
    int count = 0;
    const double begin = ThreadSeconds();
    double elapsed = 0.0;
    while (elapsed < seconds_each) {
      for (int i = 0; i < 8; ++i) multiply();
      count += 8;
      elapsed = ThreadSeconds() - begin;
    }
    total += p.per_update * elapsed / count;
  }
  return total;
}

/// A learner with a table to sample from, after its first updates.
class Updates {
 public:
  Updates(const policy::PolicySpec& spec, bool layer_norm, const Work& work)
      : table_(MakeTable(300'000)), spec_(spec) {
    config_.device = "cpu";
    config_.average_rate = 0.001;
    config_.mirror = true;
    config_.algorithm = work.algorithm;
    spec_.network.layer_norm = layer_norm;
    spec_.distribution = learner::DistributionOf(config_);
    learner_.emplace(method_, spec_, 1);
    for (int i = 0; i < 20; ++i) Run();
  }

  void Run() {
    SLALOM_CHECK(table_.SampleRows(learner_->sample_specs()[0], random_, &rows_));
    learner_->Update({&rows_, 1}, 0.0);
  }

  const policy::PolicySpec& spec() const { return spec_; }
  std::int64_t batch_size() const { return config_.batch_size; }

 private:
  const replay::Table table_;
  policy::PolicySpec spec_;
  learner::MethodConfig method_;
  learner::LearnerConfig& config_ = method_.learner;
  std::optional<learner::Learner> learner_;
  base::Random random_{2};
  replay::SampledRows rows_;
};

void RunUpdates(benchmark::State& state, const policy::PolicySpec& spec, bool layer_norm,
                const Work& work = kTd3) {
  policy::SetMathThreads(1);
  Updates learner(spec, layer_norm, work);
  const std::vector<Product> products = ListProducts(learner.spec(), work, learner.batch_size());
  double updates_seconds = 0.0;
  double products_seconds = 0.0;
  double small_gemm_seconds = 0.0;
  std::int64_t rounds = 0;
  std::int64_t updates = 0;
  for (auto _ : state) {
    // The products are measured between the updates, so both meet the same processor.
    state.PauseTiming();
    products_seconds += MeasureProducts(products, /*small_gemm=*/false, 0.002);
    small_gemm_seconds += MeasureProducts(products, /*small_gemm=*/true, 0.002);
    state.ResumeTiming();
    const double begin = ThreadSeconds();
    for (int i = 0; i < 40; ++i) learner.Run();
    updates_seconds += ThreadSeconds() - begin;
    updates += 40;
    ++rounds;
  }
  const double products_each = products_seconds / static_cast<double>(rounds);
  const double update_each = updates_seconds / static_cast<double>(updates);
  state.counters["updates/s"] = 1.0 / update_each;
  state.counters["sgemm_alone/s"] = 1.0 / products_each;
  state.counters["of_sgemm"] = products_each / update_each;
  state.counters["MFLOP"] = CountFlops(products) * 1e-6;
  state.counters["sgemm_GFLOP/s"] = CountFlops(products) / products_each * 1e-9;
  state.counters["small_gemm_GFLOP/s"] =
      CountFlops(products) * static_cast<double>(rounds) / small_gemm_seconds * 1e-9;
}

void Td3UpdateFast(benchmark::State& state) { RunUpdates(state, FastSpec(), false); }
void Td3UpdateFastLayerNorm(benchmark::State& state) { RunUpdates(state, FastSpec(), true); }
void Td3UpdatePaper(benchmark::State& state) { RunUpdates(state, {}, false); }
void DdpgUpdateFast(benchmark::State& state) { RunUpdates(state, FastSpec(), true, kDdpg); }
void DdpgUpdatePaper(benchmark::State& state) { RunUpdates(state, {}, false, kDdpg); }
void SacUpdateFast(benchmark::State& state) { RunUpdates(state, FastSpec(), true, kSac); }
void SacUpdatePaper(benchmark::State& state) { RunUpdates(state, {}, false, kSac); }
BENCHMARK(Td3UpdateFast)->Unit(benchmark::kMillisecond);
BENCHMARK(Td3UpdateFastLayerNorm)->Unit(benchmark::kMillisecond);
BENCHMARK(Td3UpdatePaper)->Unit(benchmark::kMillisecond);
BENCHMARK(DdpgUpdateFast)->Unit(benchmark::kMillisecond);
BENCHMARK(DdpgUpdatePaper)->Unit(benchmark::kMillisecond);
BENCHMARK(SacUpdateFast)->Unit(benchmark::kMillisecond);
BENCHMARK(SacUpdatePaper)->Unit(benchmark::kMillisecond);

/// By the clock, with so many threads in each product: whether a second one pays.
void Td3UpdateByThreads(benchmark::State& state, const policy::PolicySpec& spec) {
  policy::SetMathThreads(static_cast<int>(state.range(0)));
  Updates learner(spec, false, kTd3);
  for (auto _ : state) learner.Run();
  policy::SetMathThreads(1);
}
BENCHMARK_CAPTURE(Td3UpdateByThreads, fast, FastSpec())
    ->Arg(1)
    ->Arg(2)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Td3UpdateByThreads, paper, policy::PolicySpec{})
    ->Arg(1)
    ->Arg(2)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

/// Sampling and pooling without learning.
void ReadMinibatch(benchmark::State& state) {
  const replay::Table table = MakeTable(300'000);
  const policy::PolicySpec spec = FastSpec();
  const policy::FeatureMap features(spec.observation, spec.network);
  learner::MinibatchReader reader(features, 1, 1.0, /*mirror=*/true, 1.0);
  const replay::SampleSpec sample = {.batch = 128, .n_step = 4};
  learner::Minibatch minibatch(sample.batch, 1, features.frame_size(), at::kCPU);
  base::Random random(2);
  replay::SampledRows rows;
  for (auto _ : state) {
    if (!table.SampleRows(sample, random, &rows)) state.SkipWithError("empty table");
    reader.Read(rows, random, minibatch);
  }
}
BENCHMARK(ReadMinibatch)->Unit(benchmark::kMicrosecond);

void NetworkAgentAct(benchmark::State& state) {
  policy::SetMathThreads(1);
  const policy::PolicySpec spec = FastSpec();
  base::Random random(1);
  std::vector<float> weights(spec.actor_shape().num_parameters());
  policy::InitialiseParameters(spec.actor_shape(), random, weights);
  policy::NetworkAgent agent(
      {0, spec, std::make_shared<const std::vector<float>>(std::move(weights))});
  env::ObservationBatch observations;
  observations.Resize(64, 720);
  for (auto& range : observations.ranges_cm)
    range = static_cast<std::uint16_t>(random.NextU64() % 501);
  std::vector<env::Action> actions(64);
  for (auto _ : state) {
    agent.Act(observations, actions);
    benchmark::DoNotOptimize(actions.data());
  }
}
BENCHMARK(NetworkAgentAct)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace slalom
