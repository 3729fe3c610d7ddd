#include "train/update_budget.h"

#include <gtest/gtest.h>

#include "base/random.h"

namespace slalom::train {
namespace {

TEST(UpdateBudgetTest, NothingIsDueBeforeLearningStarts) {
  UpdateBudget budget(0.25, 100);
  EXPECT_FALSE(budget.update_due());
  budget.AddSteps(103);
  EXPECT_FALSE(budget.update_due());
  budget.AddSteps(1);
  EXPECT_TRUE(budget.update_due());
  budget.AddUpdate();
  EXPECT_FALSE(budget.update_due());
}

TEST(UpdateBudgetTest, GreedyUpdatesHoldTheRatioWhateverTheChunks) {
  base::Random random(1);
  for (const double ratio : {1.0 / 64, 0.25, 1.0, 3.0}) {
    UpdateBudget budget(ratio, 500);
    for (int chunk = 0; chunk < 300; ++chunk) {
      budget.AddSteps(static_cast<std::int64_t>(random.UniformInt(100)));
      while (budget.update_due()) budget.AddUpdate();
      const double earned =
          ratio * static_cast<double>(std::max<std::int64_t>(0, budget.steps() - 500));
      EXPECT_LE(static_cast<double>(budget.updates()), earned);
      EXPECT_GT(static_cast<double>(budget.updates()), earned - 1.0);
    }
  }
}

TEST(UpdateBudgetTest, RestoreGoesOnWhereItStood) {
  UpdateBudget budget(0.5, 0);
  budget.Restore(100, 50);
  EXPECT_FALSE(budget.update_due());
  budget.AddSteps(2);
  EXPECT_TRUE(budget.update_due());
}

}  // namespace
}  // namespace slalom::train
