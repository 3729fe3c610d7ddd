#include "learner/method_rules.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "base/error.h"

namespace slalom::learner {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// What is refused of the defaults after a change.
std::string Refusal(const std::function<void(MethodConfig&)>& change) {
  MethodConfig method;
  change(method);
  try {
    RequireConsistent(method);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

void UseMbpo(MethodConfig& method) {
  method.model.kind = nn::ModelKind::kProbabilistic;
  method.imagination.kind = ImaginationKind::kMbpo;
}

TEST(MethodRules, AlgorithmsAreConsistent) {
  EXPECT_EQ(Refusal([](MethodConfig&) {}), "");
  EXPECT_THAT(Refusal([](MethodConfig& m) { m.learner.log_std_min = 3.0; }),
              StartsWith("learner.log_std_min is 3"));
  EXPECT_THAT(Refusal([](MethodConfig& m) { m.learner.dropped_quantiles = m.learner.quantiles; }),
              StartsWith("learner.dropped_quantiles is 25"));
}

TEST(MethodRules, AnAlgorithmCanUseTheOtherSections) {
  const auto refusal = [](const char* algorithm, auto change) {
    return Refusal([&](MethodConfig& method) {
      method.learner.algorithm = algorithm;
      change(method);
    });
  };
  const auto constrain = [](MethodConfig& m) { m.constraint.kind = ConstraintKind::kLagrangian; };
  const auto model = [](MethodConfig& m) { m.model.kind = nn::ModelKind::kDeterministic; };
  EXPECT_THAT(refusal("distillation", constrain), StartsWith("constraint.kind is set"));
  EXPECT_THAT(refusal("distillation", model), StartsWith("model.kind is set"));
  EXPECT_EQ(refusal("tqc", constrain), "");
  EXPECT_THAT(refusal("tqc", model), StartsWith("learner.algorithm is \"tqc\""));
  EXPECT_EQ(refusal("sac", model), "");
}

TEST(MethodRules, AConstraintHasAnEffect) {
  const auto refusal = [](const ConstraintConfig& config) {
    return Refusal([&](MethodConfig& method) { method.constraint = config; });
  };
  EXPECT_EQ(refusal({.kind = ConstraintKind::kFixed, .multiplier = 200.0}), "");
  EXPECT_THAT(refusal({.kind = ConstraintKind::kFixed}), StartsWith("constraint.multiplier is 0"));
  EXPECT_EQ(refusal({.kind = ConstraintKind::kLagrangian}), "");
  EXPECT_THAT(refusal({.kind = ConstraintKind::kLagrangian, .multiplier = 200.0}),
              StartsWith("constraint.multiplier is 200, expected at most"));
  EXPECT_THAT(refusal({.kind = ConstraintKind::kLagrangian, .learning_rate = 0.0}),
              HasSubstr("would never move"));
}

TEST(MethodRules, ElitesAreChosenFromTheEnsemble) {
  const auto refusal = [](int elites, double held_out) {
    return Refusal([&](MethodConfig& method) {
      method.model.ensemble = 2;
      method.model_training.elites = elites;
      method.model_training.held_out = held_out;
    });
  };
  EXPECT_EQ(refusal(2, 0.1), "");
  EXPECT_THAT(refusal(3, 0.1), StartsWith("model_training.elites is 3, expected at most"));
  EXPECT_THAT(refusal(1, 0.0), HasSubstr("held_out above 0"));
}

TEST(MethodRules, ImaginationNeedsAModelAlone) {
  EXPECT_EQ(Refusal(UseMbpo), "");
  const auto refusal = [](auto change) {
    return Refusal([&](MethodConfig& method) {
      UseMbpo(method);
      change(method);
    });
  };
  EXPECT_THAT(refusal([](MethodConfig& m) { m.model.kind = nn::ModelKind::kNone; }),
              HasSubstr("expected model.kind"));
  EXPECT_THAT(refusal([](MethodConfig& m) { m.constraint.kind = ConstraintKind::kLagrangian; }),
              HasSubstr("with constraint.kind = \"lagrangian\""));
  EXPECT_THAT(refusal([](MethodConfig& m) { m.learner.prioritized = true; }),
              HasSubstr("with learner.prioritized"));
  EXPECT_THAT(refusal([](MethodConfig& m) { m.imagination.imagined_batches = 0; }),
              StartsWith("imagination.imagined_batches is 0"));
}

TEST(MethodRules, RolloutsGoWithBatchesAndEachOther) {
  const auto refusal = [](auto change) {
    return Refusal([&](MethodConfig& method) {
      UseMbpo(method);
      change(method.imagination);
    });
  };
  EXPECT_THAT(refusal([](ImaginationConfig& c) { c.rollouts = 129; }),
              StartsWith("imagination.rollouts is 129"));
  EXPECT_THAT(refusal([](ImaginationConfig& c) { c.buffer_capacity = 127; }),
              StartsWith("imagination.buffer_capacity is 127"));
  EXPECT_THAT(refusal([](ImaginationConfig& c) { c.final_rollout_steps = 2; }),
              StartsWith("imagination.final_rollout_steps is 2"));
  EXPECT_THAT(refusal([](ImaginationConfig& c) { c.schedule_begin = 1; }),
              StartsWith("imagination.schedule_end is 0"));
  EXPECT_THAT(refusal([](ImaginationConfig& c) { c.real_ratio = 1.0; }),
              StartsWith("imagination.real_ratio is 1"));
}

}  // namespace
}  // namespace slalom::learner
