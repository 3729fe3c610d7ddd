#include "tests/support/power_loss.h"

#include <gtest/gtest.h>

#include <filesystem>

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

INSTANTIATE_TEST_SUITE_P(Stores, PowerLossTest, testing::ValuesIn(Stores()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace slalom::test
