#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/error.h"
#include "config/config.h"
#include "train/run_config.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

TEST(PresetsTest, EveryOnePrintsToItselfAndDescribesALearnerThatCanBeMade) {
  const fs::path root = fs::path(SLALOM_SOURCE_DIR) / "configs";
  int count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    const fs::path path = entry.path();
    if (path.extension() != ".toml" || path.parent_path().filename() == "planners") continue;
    ++count;
    try {
      const auto config =
          config::Load<RunConfig>(path, std::vector<std::string>{"learner.device=cpu"});
      const std::string printed = config::ToToml(config);
      RunConfig again;
      config::ReadToml(printed, path.string() + " (printed)", config::ListFields(again));
      EXPECT_EQ(config::ToToml(again), printed) << path;
      RequireCombination(config);
      const learner::Learner learner(config.method, MakePolicySpec(config), 1);
      EXPECT_TRUE(learner.healthy()) << path;
    } catch (const base::Error& error) {
      ADD_FAILURE() << path << ": " << error.what();
    }
  }
  EXPECT_GE(count, 30);
}

}  // namespace
}  // namespace slalom::train
