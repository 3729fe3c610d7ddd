#include <ATen/Parallel.h>
#include <benchmark/benchmark.h>

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "base/check.h"
#include "base/config.h"
#include "base/random.h"
#include "benchmarks/network_products.h"
#include "benchmarks/thread_seconds.h"
#include "learner/learner.h"
#include "learner/minibatch.h"
#include "policy/network_agent.h"
#include "policy/nn/feature_map.h"
#include "policy/nn/kernels/blas.h"
#include "replay/table.h"

/// Updates of every method, and of every algorithm on every network beside the matrix products that
/// they cannot do without, measured in the same run on the same shapes, and the inference of a
/// policy. One thread, unless the name says otherwise.

namespace slalom {
namespace {

/// The config of a preset, with overrides, on the CPU.
train::RunConfig LoadPreset(const std::string& preset, std::vector<std::string> overrides = {}) {
  overrides.push_back("learner.device=cpu");
  return config::Load<train::RunConfig>(SLALOM_SOURCE_DIR "/configs/" + preset, overrides);
}

policy::PolicySpec FastSpec() { return train::MakePolicySpec(LoadPreset("fast.toml")); }

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
    return env::FrameView{ranges, state};
  };
  for (std::int64_t i = 0; i + kEpisodeSteps < num_frames; i += kEpisodeSteps + 1) {
    chunk.Clear();
    for (int step = 0; step < kEpisodeSteps; ++step) {
      const bool last = step + 1 == kEpisodeSteps;
      const env::StepResult result{
          .reward = 1.0f, .outcome = last ? env::Outcome::kSuccess : env::Outcome::kRunning};
      chunk.AddStep(0, step == 0, frame(), std::array{0.5f, -0.5f}, result);
    }
    chunk.AddFinal(0, frame());
    table.Insert(chunk);
  }
  return table;
}

/// Network passes of an algorithm's update, on average.
struct Work {
  const char* algorithm;
  double critics;           // Trained, each with a target that is computed.
  double action_gradients;  // Critics whose gradient by the action is taken.
  double actor_updates;
};
constexpr Work kWorks[] = {{"td3", 2.0, 0.5, 0.5},
                           {"ddpg", 1.0, 1.0, 1.0},
                           {"sac", 2.0, 2.0, 1.0},
                           {"tqc", 5.0, 5.0, 1.0}};

/// The products of an update.
Products ListProducts(const policy::PolicySpec& spec, const Work& work, std::int64_t batch) {
  const nn::NetworkShape actor = spec.actor_shape();
  const nn::NetworkShape critic = spec.critic_shape();
  Products products;
  // Q' and Q of all, then Q of pi(s).
  Add(ForwardProducts(critic, batch), 2 * work.critics + work.action_gradients, &products);
  Add(BackwardProducts(critic, batch), work.critics, &products);
  Add(ActionGradientProducts(critic, batch), work.action_gradients, &products);
  Add(ForwardProducts(actor, batch), 1 + work.actor_updates, &products);
  Add(BackwardProducts(actor, batch), work.actor_updates, &products);
  return products;
}

/// A learner as a preset has it with a table to sample from, after its first updates.
class Updates {
 public:
  explicit Updates(const train::RunConfig& config)
      : table_(MakeTable(100'000)),
        spec_(train::MakePolicySpec(config)),
        batch_size_(config.method.learner.batch_size),
        learner_(config.method, spec_, 1) {
    for (int i = 0; i < 4; ++i) Run();
  }

  void Run() {
    const auto& specs = learner_.sample_specs();
    rows_.resize(specs.size());
    for (std::size_t i = 0; i < specs.size(); ++i) {
      SLALOM_CHECK(table_.SampleRows(specs[i], random_, &rows_[i]));
    }
    learner_.Update(rows_, 0.0);
  }

  const policy::PolicySpec& spec() const { return spec_; }
  std::int64_t batch_size() const { return batch_size_; }

 private:
  const replay::Table table_;
  const policy::PolicySpec spec_;
  const std::int64_t batch_size_;
  learner::Learner learner_;
  base::Random random_{2};
  std::vector<replay::SampledRows> rows_;
};

void RunUpdates(benchmark::State& state, const std::string& preset, const Work& work) {
  nn::SetMathThreads(1);
  Updates learner(LoadPreset(preset, {std::string("learner.algorithm=") + work.algorithm}));
  const Products products = ListProducts(learner.spec(), work, learner.batch_size());
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
    double elapsed = 0.0;
    // An even number, as TD3 trains its actor every second time.
    for (; elapsed < 0.2; updates += 2) {
      learner.Run();
      learner.Run();
      elapsed = ThreadSeconds() - begin;
    }
    updates_seconds += elapsed;
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

/// Updates of a method that has more than its algorithm: a constraint, or a model that it learns
/// from. One update includes the model's updates and imagined batches that one replayed batch leads
/// to.
void RunMethod(benchmark::State& state, const std::string& preset) {
  nn::SetMathThreads(1);
  train::RunConfig config = LoadPreset(preset);
  config.method.imagination.learning_starts = 0;
  Updates learner(config);
  const double begin = ThreadSeconds();
  for (auto _ : state) {
    learner.Run();
    learner.Run();
  }
  state.counters["updates/s"] =
      2.0 * static_cast<double>(state.iterations()) / (ThreadSeconds() - begin);
}

/// Updates by the clock with several threads (learner.threads) beside those with one, measured in
/// turn so that both meet the same machine: whether threads pay.
void RunByThreads(benchmark::State& state, train::RunConfig config) {
  using Clock = std::chrono::steady_clock;
  nn::SetMathThreads(1);
  config.method.learner.threads = 1;
  Updates one(config);
  config.method.learner.threads = static_cast<int>(state.range(0));
  Updates several(config);
  std::array<double, 2> seconds{};
  std::array<std::int64_t, 2> updates{};
  for (auto _ : state) {
    for (const int i : {0, 1}) {
      const Clock::time_point begin = Clock::now();
      double elapsed = 0.0;
      for (; elapsed < 0.05; updates[i] += 2) {
        for (int twice = 0; twice < 2; ++twice) (i == 0 ? one : several).Run();
        elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
      }
      seconds[i] += elapsed;
    }
  }
  const double alone = static_cast<double>(updates[0]) / seconds[0];
  const double together = static_cast<double>(updates[1]) / seconds[1];
  state.counters["updates/s"] = together;
  state.counters["one_thread/s"] = alone;
  state.counters["times"] = together / alone;
}

/// Microseconds of an action of a preset's actor by the number of environments. Includes reading
/// frames of 720 beams.
void RunActing(benchmark::State& state, const std::string& preset) {
  nn::SetMathThreads(1);
  const policy::PolicySpec spec = train::MakePolicySpec(LoadPreset(preset));
  base::Random random(1);
  std::vector<float> weights(spec.actor_shape().num_parameters());
  nn::InitialiseParameters(spec.actor_shape(), random, weights);
  policy::NetworkAgent agent(
      {0, spec, std::make_shared<const std::vector<float>>(std::move(weights))});
  const auto batch = static_cast<int>(state.range(0));
  env::ObservationBatch observations;
  observations.Resize(batch, spec.observation.num_beams);
  for (auto& range : observations.ranges_cm) {
    range = static_cast<std::uint16_t>(random.UniformInt(501));
  }
  std::vector<env::Action> actions(batch);
  agent.Act(observations, env::NumbersOf(actions));
  const double begin = ThreadSeconds();
  for (auto _ : state) agent.Act(observations, env::NumbersOf(actions));
  state.counters["us_per_observation"] =
      1e6 * (ThreadSeconds() - begin) / (static_cast<double>(state.iterations()) * batch);
}

void RegisterByThreads(const std::string& name, const std::string& preset,
                       const std::vector<std::string>& overrides) {
  benchmark::RegisterBenchmark(("UpdateByThreads/" + name).c_str(),
                               [preset, overrides](benchmark::State& state) {
                                 RunByThreads(state, LoadPreset(preset, overrides));
                               })
      ->Arg(2)
      ->UseRealTime()
      ->Unit(benchmark::kMillisecond);
}

const bool kRegistered = [] {
  RegisterByThreads("fast/mlp-without-norm/td3", "fast/td3-mlp.toml", {"network.layer_norm=false"});
  for (const std::string size : {"fast", "paper"}) {
    for (const char* const network : {"mlp", "mlp-h4", "cnn-h4", "gru-h4", "transformer-h4"}) {
      const std::string preset = size + "/td3-" + network + ".toml";
      const std::string name = size + "/" + network;
      for (const Work& work : kWorks) {
        benchmark::RegisterBenchmark(
            ("Update/" + name + "/" + work.algorithm).c_str(),
            [preset, work](benchmark::State& state) { RunUpdates(state, preset, work); })
            ->Unit(benchmark::kMillisecond);
      }
      benchmark::RegisterBenchmark(("Act/" + name).c_str(),
                                   [preset](benchmark::State& state) { RunActing(state, preset); })
          ->Arg(1)
          ->Arg(64)
          ->Unit(benchmark::kMicrosecond);
      for (const std::string algorithm : {"td3", "ddpg", "sac"}) {
        RegisterByThreads(name + "/" + algorithm, preset, {"learner.algorithm=" + algorithm});
      }
    }
    for (const char* const method :
         {"lagrangian", "dyna-deterministic", "dyna-probabilistic", "mbpo"}) {
      const std::string preset = size + "/" + method + "-mlp.toml";
      benchmark::RegisterBenchmark(("Update/" + size + "/mlp/" + method).c_str(),
                                   [preset](benchmark::State& state) { RunMethod(state, preset); })
          ->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

/// Sampling and pooling without learning.
void ReadMinibatch(benchmark::State& state) {
  const replay::Table table = MakeTable(300'000);
  const policy::PolicySpec spec = FastSpec();
  const nn::FeatureMap features(spec.observation, spec.network);
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

}  // namespace
}  // namespace slalom
