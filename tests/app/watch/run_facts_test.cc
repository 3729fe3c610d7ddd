#include "app/watch/run_facts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/train/run_config.h"
#include "app/watch/run_page.h"
#include "base/config.h"
#include "base/file.h"
#include "tests/support/scratch_directory.h"

namespace slalom::watch {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

class RunFactsTest : public ::testing::Test {
 protected:
  RunFacts FactsAfterWriting(const std::string& config) const {
    base::WriteFileAtomically(scratch_.path() / "config.toml", config);
    return FactsOf(scratch_.path());
  }

  const test::ScratchDirectory scratch_;
};

TEST_F(RunFactsTest, HaveEveryKeyThatIsNotAtItsDefault) {
  train::RunConfig config;
  EXPECT_THAT(FactsAfterWriting(config::ToToml(config)).changes, IsEmpty());
  config.environment.reward.success = 33.5;
  config.method.learner.algorithm = "tqc";
  config.network.head_layers = {48, 32};
  const RunFacts facts = FactsAfterWriting(config::ToToml(config));
  EXPECT_THAT(facts.changes, ElementsAre(Pair("environment.reward.success", "33.5"),
                                         Pair("learner.algorithm", "\"tqc\""),
                                         Pair("network.head_layers", "[48, 32]")));
  EXPECT_THAT(facts.lines, Contains(Pair("Algorithm", "tqc")));
  EXPECT_THAT(RunPage(scratch_.path(), facts),
              HasSubstr("[\"environment.reward.success\",\"33.5\"]"));
}

TEST_F(RunFactsTest, NameTheStages) {
  const RunFacts facts = FactsAfterWriting(
      "[distillation]\nstages = { b.courses.fresh = \"wall\", a.courses.fresh = \"box\", "
      "a.courses.train = \"\", b.courses.train = \"\" }\n");
  ASSERT_EQ(facts.stages.size(), 2u);
  EXPECT_EQ(facts.stages[0].name, "a");
  EXPECT_EQ(facts.stages[1].directory, scratch_.path() / "stages/b");
}

TEST_F(RunFactsTest, SayWhyTheConfigCannotBeRead) {
  const RunFacts facts = FactsAfterWriting("[run]\nnonsense = 1\n");
  EXPECT_THAT(facts.lines,
              ElementsAre(Pair("config.toml", HasSubstr("config.toml:2: unknown key"))));
  EXPECT_THAT(facts.changes, IsEmpty());
}

}  // namespace
}  // namespace slalom::watch
