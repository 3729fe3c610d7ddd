#include <ATen/ATen.h>

#include "learner/algorithm.h"
#include "learner/deterministic_actor.h"

namespace slalom::learner {
namespace {

/// Learns the actions that teachers show in the states that the learner's own policy visits:
/// DAgger (Ross, Gordon and Bagnell 2011, algorithm 3.1) with the mean squared distance as its
/// loss, as policies of several tasks are distilled into one (Rusu et al. 2016, "Policy
/// Distillation"). A replayed row's action is the teacher's (actor/teachers.h). There are no
/// critics, and rewards are not read.
class Distillation : public Algorithm {
 public:
  explicit Distillation(const AlgorithmContext& context);

  void Update(double rate) override;

  const at::Tensor& td_errors() const override { return none_; }
  int num_critics() const override { return 0; }
  const at::Tensor& actor_parameters() const override { return actor_.parameters(); }
  const at::Tensor& average_parameters() const override {
    return config_.average_rate > 0.0 ? actor_.average_parameters() : actor_.parameters();
  }
  const at::Tensor& critic_parameters() const override { return none_; }
  const at::Tensor& ActNext() override { return actor_.ActNext(); }

  void StartFrom(const at::Tensor& actor_parameters) override {
    actor_.StartFrom(actor_parameters);
  }

  void SaveState(nn::TensorMap& tensors) const override { actor_.SaveState(tensors); }
  void LoadState(const nn::TensorFile& file) override { actor_.LoadState(file); }

 private:
  const LearnerConfig config_;
  Minibatch& minibatch_;
  Totals& totals_;
  DeterministicActor actor_;
  at::Tensor none_;      // [0]
  at::Tensor distance_;  // [B, A], from the teachers' actions to the policy's.
};

Distillation::Distillation(const AlgorithmContext& context)
    : config_(context.config),
      minibatch_(context.minibatch),
      totals_(context.totals),
      actor_(context.spec.actor_shape(), context.spec.distribution, context.initial_weights,
             context.minibatch),
      none_(at::zeros({0}, context.minibatch.input.options())),
      distance_(at::zeros_like(context.minibatch.actions)) {}

void Distillation::Update(double rate) {
  totals_.CountActorUpdate();
  // phi <- argmin mean |pi(s) - a*|^2, where a* is the teacher's action
  at::sub_out(distance_, actor_.Act(minibatch_.features), minibatch_.actions);
  const auto batch = static_cast<double>(distance_.size(0));
  totals_[Total::kActorQ].sub_(distance_.square().sum(), 1.0 / batch);
  distance_.mul_(2.0 / batch);
  // Nothing reads the target actor.
  actor_.PolicyGradientStep(distance_, config_.preactivation_penalty,
                            rate * config_.actor_learning_rate, /*polyak_rate=*/0.0,
                            PolicyAverageRate(config_, totals_), totals_[Total::kActorNorm]);
}

}  // namespace

std::unique_ptr<Algorithm> MakeDistillation(const AlgorithmContext& context) {
  return std::make_unique<Distillation>(context);
}

}  // namespace slalom::learner
