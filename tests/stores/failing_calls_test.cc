#include "tests/support/failing_calls.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <limits>

#include "tests/stores/stores.h"
#include "tests/support/scratch_directory.h"

/// Each call that a store makes of the C library fails, once and for ever. What was promised before
/// and in spite of it is there afterwards.

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

constexpr int kForEver = std::numeric_limits<int>::max();
constexpr int kMostCalls = 12;  // Of one function, from the first one on.

constexpr FailingCall kFaults[] = {
    {.function = "open", .error = EMFILE},
    {.function = "openat", .error = EMFILE},
    {.function = "fopen", .error = EIO},
    {.function = "readdir", .error = EIO},
    {.function = "stat", .error = EIO},
    {.function = "lstat", .error = ESTALE},
    {.function = "fstat", .error = EIO},
    {.function = "read", .error = EIO},
    {.function = "read", .error = 0},
    {.function = "write", .error = ENOSPC},
    {.function = "write", .error = 0},
    {.function = "pwritev", .error = ENOSPC},
    {.function = "pwritev", .error = 0},
    {.function = "f*sync", .error = EIO},
    {.function = "rename", .error = ESTALE},
    {.function = "link", .error = EEXIST},
    {.function = "unlink*", .error = EIO},
    {.function = "remove", .error = EIO},
    {.function = "mkdir", .error = ENOSPC},
    {.function = "truncate", .error = EIO},
    {.function = "posix_fallocate", .error = ENOSPC},
    {.function = "mmap", .error = ENOMEM},
};

class FailingCallsTest : public testing::TestWithParam<Store> {
 protected:
  /// Uses the store beside a fault. Returns how many such calls there were.
  int Use(FailingCall fault) {
    const std::string what = fmt::format("{} fails with {}, call {} to {}", fault.function,
                                         fault.error, fault.first, fault.last);
    SCOPED_TRACE(what);
    const ScratchDirectory scratch;
    const fs::path root = scratch.path() / "store";
    const std::string pattern = root.string() + "*";
    fault.path = pattern;
    fs::create_directories(root);
    int promised = 0;
    int calls = 0;
    {
      const FailingCalls failing(fault, scratch.path() / "calls");
      EXPECT_NO_THROW(GetParam().use(root, [&promised](int number) { promised = number; }, {}));
      calls = failing.num_calls();
    }
    EXPECT_NO_THROW(GetParam().check(root, promised));
    return calls;
  }
};

TEST_P(FailingCallsTest, CostNothingThatWasPromised) {
  int all_calls = 0;
  for (FailingCall fault : kFaults) {
    fault.first = fault.last = kForEver;
    const int calls = Use(fault);
    all_calls += calls;
    for (int call = 1; call <= std::min(calls, kMostCalls); ++call) {
      fault.first = fault.last = call;
      Use(fault);
      // A short transfer is no failure.
      fault.last = kForEver;
      if (fault.error != 0 && call % 4 == 1) Use(fault);
      ASSERT_FALSE(HasFailure());
    }
  }
  EXPECT_GT(all_calls, 10);
}

INSTANTIATE_TEST_SUITE_P(Stores, FailingCallsTest, testing::ValuesIn(Stores()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace slalom::test
