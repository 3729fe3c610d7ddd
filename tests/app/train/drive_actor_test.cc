#include "app/train/drive_actor.h"

#include <gtest/gtest.h>

#include <span>
#include <string>

#include "app/train/run_config.h"
#include "policy/policy_spec.h"

namespace slalom::train {
namespace {

std::string PolicyOf(const policy::PolicySpec& spec) {
  policy::PolicySnapshot snapshot = policy::ZeroSnapshot(spec);
  snapshot.version = 7;
  return policy::PrintPolicy(snapshot, {});
}

/// A run whose policies carry a model, and the spec of its actors if they do not plan.
struct Specs {
  Specs() {
    RunConfig config;
    config.method.model.kind = nn::ModelKind::kDeterministic;
    whole = MakePolicySpec(config);
    acting = whole;
    acting.planning = {};
  }
  policy::PolicySpec whole;
  policy::PolicySpec acting;
};

TEST(DriveActorTest, AnActorThatDoesNotPlanLeavesOutAModelThatComesAllTheSame) {
  const Specs specs;
  for (const policy::PolicySpec& spec : {specs.whole, specs.acting}) {
    const std::string bytes = PolicyOf(spec);
    const auto read = ReadPolicy(std::as_bytes(std::span(bytes)), specs.acting);
    ASSERT_TRUE(read) << read.failure().text;
    EXPECT_EQ(read->version, 7);
    EXPECT_EQ(read->model_weights, nullptr);
    EXPECT_EQ(read->critic_weights, nullptr);
    EXPECT_EQ(policy::PrintSpec(read->spec, 7), policy::PrintSpec(specs.acting, 7));
  }
}

TEST(DriveActorTest, AnActorThatPlansNeedsTheModel) {
  const Specs specs;
  const std::string whole = PolicyOf(specs.whole);
  const auto read = ReadPolicy(std::as_bytes(std::span(whole)), specs.whole);
  ASSERT_TRUE(read) << read.failure().text;
  EXPECT_NE(read->model_weights, nullptr);
  const std::string acting = PolicyOf(specs.acting);
  EXPECT_FALSE(ReadPolicy(std::as_bytes(std::span(acting)), specs.whole));
}

}  // namespace
}  // namespace slalom::train
