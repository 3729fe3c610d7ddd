#include "app/train/drive_actor.h"

#include <gtest/gtest.h>

#include <span>
#include <string>

#include "app/train/run_config.h"
#include "policy/policy_spec.h"

namespace slalom::train {
namespace {

std::string PolicyOf(const policy::PolicySpec& spec,
                     const nn::Metadata& metadata = {
                         {proto::kIdentityMetadata, proto::PrintIdentity({})}}) {
  policy::PolicySnapshot snapshot = policy::ZeroSnapshot(spec);
  snapshot.version = 7;
  return policy::PrintPolicy(snapshot, metadata);
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
    const auto read = ReadPolicy(std::as_bytes(std::span(bytes)), specs.acting, {});
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
  const auto read = ReadPolicy(std::as_bytes(std::span(whole)), specs.whole, {});
  ASSERT_TRUE(read) << read.failure().text;
  EXPECT_NE(read->model_weights, nullptr);
  const std::string acting = PolicyOf(specs.acting);
  EXPECT_FALSE(ReadPolicy(std::as_bytes(std::span(acting)), specs.whole, {}));
}

TEST(DriveActorTest, APolicyOfAnotherRunIsRefusedByTheKeysThatDiffer) {
  const Specs specs;
  const proto::RunIdentity run = {{"courses.train", "\"dynamic-box\""}, {"run.seed", "2"}};
  const auto read = [&](const nn::Metadata& metadata) {
    const std::string bytes = PolicyOf(specs.whole, metadata);
    return ReadPolicy(std::as_bytes(std::span(bytes)), specs.whole, run);
  };
  EXPECT_TRUE(read({{proto::kIdentityMetadata, proto::PrintIdentity(run)}}));
  EXPECT_EQ(read({}).failure().text, "the policy received does not say its run");
  proto::RunIdentity other = run;
  other["run.seed"] = "3";
  other.erase("courses.train");
  const auto refused = read({{proto::kIdentityMetadata, proto::PrintIdentity(other)}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.failure().text,
            "the policy received is of another run: courses.train is the default, expected "
            "\"dynamic-box\"; run.seed is 3, expected 2");
}

}  // namespace
}  // namespace slalom::train
