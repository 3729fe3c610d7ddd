#include "policy/nn/autograd_networks.h"

#include <ATen/ATen.h>
#include <fmt/format.h>
#include <torch/csrc/autograd/autograd.h>
#include <torch/csrc/autograd/custom_function.h>

#include <algorithm>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/mutex.h"
#include "policy/nn/network.h"

namespace slalom::nn {
namespace {

/// Input and passes of one call.
struct Passes {
  Passes(const NetworkShape& shape, std::int64_t num_networks, at::Tensor empty, PassUse for_use,
         base::Random* dropout)
      : use(for_use), input(std::move(empty)) {
    for (std::int64_t k = 0; k < num_networks; ++k) {
      networks.emplace_back(shape, input, for_use, dropout);
    }
  }

  const PassUse use;
  at::Tensor input;  // [B, I + E]
  std::vector<NetworkPass> networks;
};

}  // namespace

/// The networks, and the passes that no graph holds. Graphs on a GPU are released by a thread of
/// LibTorch's, hence the mutex.
class AutogradNetworks::Networks {
 public:
  Networks(const NetworkShape& of_shape, const at::Tensor& all, base::Random* random)
      : shape(of_shape), leaf(all.detach().requires_grad_()), dropout(random) {
    const std::int64_t size = shape.num_parameters();
    SLALOM_CHECK_EQ(all.numel() % size, 0);
    for (std::int64_t k = 0; k < all.numel() / size; ++k) {
      networks.emplace_back(shape, all.narrow(0, k * size, size));
    }
  }

  std::unique_ptr<Passes> Take(std::int64_t batch, PassUse use) {
    {
      const base::MutexLock lock(mutex_);
      const auto found = std::find_if(free_.begin(), free_.end(), [&](const auto& passes) {
        return passes->use == use && passes->input.size(0) == batch;
      });
      if (found != free_.end()) {
        std::unique_ptr<Passes> passes = std::move(*found);
        free_.erase(found);
        return passes;
      }
    }
    const at::Tensor input =
        at::zeros({batch, shape.num_inputs() + shape.num_extra()}, leaf.options());
    return std::make_unique<Passes>(shape, std::ssize(networks), input, use, dropout);
  }

  void Return(std::unique_ptr<Passes> passes) {
    const base::MutexLock lock(mutex_);
    free_.push_back(std::move(passes));
  }

  /// [B, K, O]
  at::Tensor Forward(const at::Tensor& features, const at::Tensor& extra, Passes& passes) const {
    passes.input.narrow(1, 0, shape.num_inputs()).copy_(features);
    if (shape.num_extra() > 0) {
      passes.input.narrow(1, shape.num_inputs(), shape.num_extra()).copy_(extra);
    }
    std::vector<at::Tensor> outputs;
    for (std::size_t k = 0; k < networks.size(); ++k) {
      networks[k].Forward(passes.networks[k]);
      outputs.push_back(passes.networks[k].output());
    }
    return at::stack(outputs, 1);
  }

  const NetworkShape shape;
  const at::Tensor leaf;
  base::Random* const dropout;
  std::vector<Network> networks;

 private:
  base::Mutex mutex_;
  std::vector<std::unique_ptr<Passes>> free_ GUARDED_BY(mutex_);
};

/// The passes of a recorded call, which its graph keeps.
class AutogradNetworks::Call : public torch::CustomClassHolder {
 public:
  Call(std::shared_ptr<Networks> of_networks, std::int64_t batch)
      : networks(std::move(of_networks)), passes(networks->Take(batch, PassUse::kTraining)) {}
  ~Call() override { Finish(); }

  /// Gives the passes back.
  void Finish() {
    if (passes) networks->Return(std::move(passes));
  }

  const std::shared_ptr<Networks> networks;
  std::unique_ptr<Passes> passes;  // Null once differentiated.
};

struct AutogradNetworks::Apply : torch::autograd::Function<AutogradNetworks::Apply> {
  using Context = torch::autograd::AutogradContext;
  using Variables = torch::autograd::variable_list;

  static at::Tensor forward(Context* context, const at::Tensor& leaf, const at::Tensor& features,
                            const at::Tensor& extra, const std::shared_ptr<Networks>& networks) {
    const auto call = c10::make_intrusive<Call>(networks, features.size(0));
    context->saved_data["call"] = at::IValue::make_capsule(call);
    context->save_for_backward({leaf});
    return networks->Forward(features, extra, *call->passes);
  }

  static Variables backward(Context* context, const Variables& output_gradients) {
    base::ThrowIf(
        at::GradMode::is_enabled(),
        "AutogradNetworks: a double backward (create_graph) was asked for, but networks have "
        "first derivatives only");
    Call& call = static_cast<Call&>(*context->saved_data["call"].toCapsule());
    base::ThrowIf(
        !call.passes,
        "AutogradNetworks: a second backward through one call (retain_graph) was asked for; "
        "expected one, or a call for each loss, as a backward pass uses up what the call left");
    context->get_saved_variables();  // Throws if the weights have moved since the call.
    const Networks& networks = *call.networks;
    const std::int64_t size = networks.shape.num_parameters();
    at::Tensor by_parameters, by_extra;
    if (context->needs_input_grad(0)) {
      by_parameters = at::empty(networks.leaf.sizes(), networks.leaf.options());
    }
    for (std::size_t k = 0; k < networks.networks.size(); ++k) {
      NetworkPass& pass = call.passes->networks[k];
      const Network& network = networks.networks[k];
      pass.output_gradient().copy_(output_gradients[0].select(1, static_cast<std::int64_t>(k)));
      // In this order: the other gradient uses up the pass.
      if (context->needs_input_grad(2)) {
        network.ExtraGradient(pass);
        if (k == 0) {
          by_extra = pass.extra_gradient().clone();
        } else {
          by_extra.add_(pass.extra_gradient());
        }
      }
      if (by_parameters.defined()) {
        Network gradient(networks.shape,
                         by_parameters.narrow(0, static_cast<std::int64_t>(k) * size, size));
        network.ParameterGradient(pass, gradient);
      }
    }
    call.Finish();
    return {by_parameters, at::Tensor(), by_extra, at::Tensor()};
  }
};

AutogradNetworks::AutogradNetworks(const NetworkShape& shape, const at::Tensor& parameters,
                                   base::Random* dropout)
    : networks_(std::make_shared<Networks>(shape, parameters, dropout)) {}

at::Tensor AutogradNetworks::operator()(const at::Tensor& features, const at::Tensor& extra) const {
  const NetworkShape& shape = networks_->shape;
  const std::int64_t num_extra = extra.defined() ? extra.size(1) : 0;
  SLALOM_CHECK_EQ(features.size(1), static_cast<std::int64_t>(shape.num_inputs()));
  SLALOM_CHECK_EQ(num_extra, static_cast<std::int64_t>(shape.num_extra()));
  if (num_extra > 0) SLALOM_CHECK_EQ(extra.size(0), features.size(0));
  if (!at::GradMode::is_enabled()) {
    std::unique_ptr<Passes> passes = networks_->Take(features.size(0), PassUse::kInference);
    at::Tensor outputs = networks_->Forward(features, extra, *passes);
    networks_->Return(std::move(passes));
    return outputs;
  }
  base::ThrowIf(
      features.requires_grad(),
      "AutogradNetworks: the features require a gradient, but networks have gradients by their "
      "parameters and by their extra inputs only; expected features.detach()");
  return Apply::apply(networks_->leaf, features,
                      num_extra > 0 ? extra : at::empty({features.size(0), 0}, features.options()),
                      networks_);
}

void AutogradNetworks::Differentiate(const at::Tensor& loss, at::Tensor& gradient) const {
  base::ThrowIf(
      loss.numel() != 1,
      "AutogradNetworks: the loss has the shape [{}], expected one number, such as its mean()",
      fmt::join(loss.sizes(), ", "));
  at::Tensor found;
  try {
    if (loss.requires_grad()) {
      found = torch::autograd::grad({loss}, {networks_->leaf}, {}, /*retain_graph=*/false,
                                    /*create_graph=*/false, /*allow_unused=*/true)
                  .front();
    }
  } catch (const c10::Error& error) {
    throw base::Error(
        "AutogradNetworks: no gradient of this loss; expected one that is differentiated once, "
        "without retain_graph, and before its weights move. LibTorch says: {}",
        error.what_without_backtrace());
  }
  base::ThrowIf(
      !found.defined(),
      "AutogradNetworks: the loss does not depend on the networks whose parameters are to move; "
      "expected one of their values, without detach(), NoGradGuard or target networks between");
  gradient.copy_(found);
}

const at::Tensor& AutogradNetworks::parameters() const { return networks_->leaf; }

}  // namespace slalom::nn
