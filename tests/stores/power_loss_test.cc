#include "tests/support/power_loss.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "base/file.h"
#include "tests/stores/stores.h"
#include "tests/support/scratch_directory.h"

/// The power fails before each call that changes a store. Whatever was not synced may be lost, and
/// what was promised before is there.

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

class PowerLossTest : public testing::TestWithParam<Store> {};

TEST_P(PowerLossTest, LeavesWhatWasPromised) {
  const ScratchDirectory scratch;
  const fs::path root = scratch.path() / "store";
  fs::create_directories(root);
  PowerLoss power(root);
  GetParam().use(
      root, [](int) {}, [&power](int number) { power.Promise(number); });
  const auto losses = power.Losses();
  ASSERT_GT(losses.size(), 3u);
  const fs::path left = scratch.path() / "left";
  for (const PowerLoss::Loss& loss : losses) {
    SCOPED_TRACE("power lost before " + loss.when);
    PowerLoss::Restore(loss.tree, left);
    const int promised = GetParam().name == "Ledger" ? 0 : loss.promised;
    ASSERT_NO_THROW(GetParam().check(left, promised));
    ASSERT_FALSE(HasFailure());
  }
}

// A source that opens files to write them has to sync them itself.
TEST(StoresTest, EverySourceThatWritesFilesByItselfIsOneOfAStore) {
  std::set<std::string> expected;
  for (const Store& store : Stores()) {
    if (!store.source.empty()) expected.insert(store.source);
  }
  const fs::path root = SLALOM_SOURCE_DIR;
  std::set<std::string> found;
  for (const char* folder : {"actor", "app", "env", "eval", "learner", "metrics", "planners",
                             "policy", "proto", "replay", "sim"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      if (entry.path().extension() != ".cc") continue;
      const std::string text = base::ReadFile(entry.path());
      for (const char* call : {"O_CREAT", "O_WRONLY", "O_RDWR", "std::ofstream", "fopen("}) {
        if (text.find(call) == std::string::npos) continue;
        found.insert(entry.path().lexically_relative(root).string());
      }
    }
  }
  EXPECT_EQ(found, expected);
}

INSTANTIATE_TEST_SUITE_P(Stores, PowerLossTest, testing::ValuesIn(Stores()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace slalom::test
