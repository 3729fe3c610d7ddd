#include <benchmark/benchmark.h>
#include <torch/torch.h>

#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "base/config.h"
#include "benchmarks/thread_seconds.h"
#include "policy/nn/kernels/blas.h"
#include "tests/learner/reference_network.h"
#include "tests/learner/written_td3.h"

/// TD3's update on one minibatch, for every network, done in three ways: by LibTorch eagerly, its
/// autograd and its Adam (`eager`); as losses on the hand-written networks, which autograd
/// differentiates (`losses`); and as shipped, with gradients written by hand (`kernels`). The
/// benchmark shows how many times as fast the hand-written code is. It uses one thread on the CPU,
/// and the first GPU if there is one.

namespace slalom::learner {
namespace {

using at::Tensor;

/// A network as LibTorch's modules have them: a leaf for each weight.
struct EagerNetwork {
  EagerNetwork(const nn::NetworkShape& of_shape, base::Random& random, at::Device device)
      : shape(of_shape) {
    std::vector<float> values(static_cast<std::size_t>(shape.num_parameters()));
    nn::InitialiseParameters(shape, random, values);
    for (const nn::ParameterSlot& slot : shape.Slots()) {
      const Tensor view = at::from_blob(values.data() + slot.offset, slot.shape, at::kFloat);
      parameters.push_back(view.clone().to(device).requires_grad_());
    }
  }

  /// A network with its own weights of the same values.
  EagerNetwork Copy() const {
    EagerNetwork copy = *this;
    for (Tensor& parameter : copy.parameters) parameter = parameter.detach().clone();
    return copy;
  }

  Tensor operator()(const Tensor& state, const Tensor& action = {}) const {
    return ReferenceForward(shape, parameters, state, action);
  }
  void Follow(const EagerNetwork& other, double rate) {
    const torch::NoGradGuard no_grad;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      parameters[i].lerp_(other.parameters[i], rate);
    }
  }

  nn::NetworkShape shape;
  std::vector<Tensor> parameters;
};

/// Fujimoto et al. 2018, algorithm 1, with the same additions as `Td3`.
class EagerTd3 {
 public:
  explicit EagerTd3(const AlgorithmContext& context)
      : config_(context.config),
        minibatch_(context.minibatch),
        noise_(config_.batch_size, 2, device()),
        actor_(context.spec.actor_shape(), weights_, device()),
        critics_{Critic(context), Critic(context)},
        actor_target_(actor_.Copy()),
        actor_average_(actor_.Copy()),
        critic_targets_{critics_[0].Copy(), critics_[1].Copy()},
        actor_optimiser_(actor_.parameters, config_.actor_learning_rate),
        critic_optimiser_(AllOf(critics_), config_.critic_learning_rate) {}

  void Update() {
    const Tensor& s = minibatch_.features;
    const Tensor& next_s = minibatch_.next_features;
    Tensor y;
    {
      const torch::NoGradGuard no_grad;
      const Tensor noise = noise_.Draw(random_, config_.target_noise, config_.noise_clip);
      const Tensor next_a = (actor_target_(next_s).tanh() + noise).clamp(-1.0, 1.0);
      const Tensor next_q =
          at::minimum(critic_targets_[0](next_s, next_a), critic_targets_[1](next_s, next_a));
      y = (minibatch_.reward + minibatch_.discount * next_q.squeeze(1)).unsqueeze(1);
    }
    const Tensor& a = minibatch_.actions;
    critic_optimiser_.zero_grad();
    (torch::mse_loss(critics_[0](s, a), y) + torch::mse_loss(critics_[1](s, a), y)).backward();
    critic_optimiser_.step();
    if (++num_updates_ % config_.policy_delay != 0) return;

    // Without gradients by the critic's weights, which nobody asks for.
    for (Tensor& parameter : critics_[0].parameters) parameter.set_requires_grad(false);
    actor_optimiser_.zero_grad();
    (-critics_[0](s, actor_(s).tanh()).mean()).backward();
    for (Tensor& parameter : critics_[0].parameters) parameter.set_requires_grad(true);
    actor_optimiser_.step();
    for (int k = 0; k < 2; ++k) critic_targets_[k].Follow(critics_[k], config_.tau);
    actor_target_.Follow(actor_, config_.tau);
    if (config_.average_rate > 0.0) actor_average_.Follow(actor_, config_.average_rate);
  }

 private:
  using Pair = std::array<EagerNetwork, 2>;

  at::Device device() const { return minibatch_.input.device(); }
  EagerNetwork Critic(const AlgorithmContext& context) {
    return {context.spec.critic_shape(), weights_, device()};
  }
  static std::vector<Tensor> AllOf(const Pair& pair) {
    std::vector<Tensor> all = pair[0].parameters;
    all.insert(all.end(), pair[1].parameters.begin(), pair[1].parameters.end());
    return all;
  }

  const LearnerConfig config_;
  Minibatch& minibatch_;
  base::Random weights_{1}, random_{2};
  Noise noise_;
  EagerNetwork actor_;
  Pair critics_;
  EagerNetwork actor_target_, actor_average_;
  Pair critic_targets_;
  torch::optim::Adam actor_optimiser_, critic_optimiser_;
  int num_updates_ = 0;
};

/// Arguments of an algorithm's constructor for a preset, with a minibatch of random numbers.
struct Scene {
  Scene(const std::string& preset, at::Device device)
      : run(config::Load<train::RunConfig>(SLALOM_SOURCE_DIR "/configs/" + preset, {})),
        spec(train::MakePolicySpec(run)),
        frame_size(nn::FeatureMap(spec.observation, spec.network).frame_size()),
        minibatch(run.method.learner.batch_size, spec.network.history, frame_size, device),
        totals(device),
        context{.config = run.method.learner,
                .spec = spec,
                .seed = 1,
                .initial_weights = weights,
                .minibatch = minibatch,
                .totals = totals,
                .constraint = nullptr} {
    // Which only `kernels` has.
    run.method.learner.preactivation_penalty = 0.0;
    for (Tensor* t : {&minibatch.features, &minibatch.next_features, &minibatch.actions}) {
      t->uniform_(-1.0, 1.0);
    }
    minibatch.reward.uniform_(-1.0, 1.0);
    minibatch.discount.fill_(0.96);
    minibatch.dropout = &dropout;
  }

  train::RunConfig run;
  policy::PolicySpec spec;
  int frame_size;
  Minibatch minibatch;
  Totals totals;
  base::Random weights{1}, dropout{2};
  AlgorithmContext context;
};

/// Processor time on the CPU, or the clock's time if a GPU computes, [s].
double Seconds(at::Device device) {
  if (device.is_cpu()) return ThreadSeconds();
  torch::cuda::synchronize();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

template <class Update>
void Measure(benchmark::State& state, at::Device device, const Update& update) {
  for (int i = 0; i < 4; ++i) update();
  double seconds = 0.0;
  std::int64_t updates = 0;
  for (auto _ : state) {
    const double begin = Seconds(device);
    // An even number, as TD3 trains its actor every second time.
    do {
      for (int i = 0; i < 2; ++i) update();
      updates += 2;
    } while (Seconds(device) - begin < 0.3);
    seconds += Seconds(device) - begin;
  }
  state.counters["updates/s"] = static_cast<double>(updates) / seconds;
}

void RunTd3(benchmark::State& state, const std::string& preset, const std::string& way,
            at::Device device) {
  nn::SetMathThreads(1);
  Scene scene(preset, device);
  if (way == "eager") {
    EagerTd3 td3(scene.context);
    return Measure(state, device, [&] { td3.Update(); });
  }
  const std::unique_ptr<Algorithm> td3 =
      way == "losses" ? std::make_unique<WrittenTd3>(scene.context) : MakeAlgorithm(scene.context);
  Measure(state, device, [&] {
    scene.totals.CountUpdate();
    td3->Update(1.0);
  });
}

const bool kRegistered = [] {
  std::vector<at::Device> devices = {at::kCPU};
  if (torch::cuda::is_available()) devices.emplace_back(at::kCUDA);
  for (const at::Device device : devices) {
    for (const std::string size : {"fast", "paper"}) {
      for (const std::string network : {"mlp", "mlp-h4", "cnn-h4", "gru-h4", "transformer-h4"}) {
        for (const std::string way : {"eager", "losses", "kernels"}) {
          benchmark::RegisterBenchmark(
              ("Td3/" + device.str() + "/" + size + "/" + network + "/" + way).c_str(),
              [=](benchmark::State& state) {
                RunTd3(state, size + "/td3-" + network + ".toml", way, device);
              })
              ->Iterations(1)
              ->Unit(benchmark::kMillisecond);
        }
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace slalom::learner
