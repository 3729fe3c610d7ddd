#include "learner/run/fence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::run {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(FenceTest, IsHeldWhileItsFileIsWhatItWas) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path file = scratch.path() / "claim-1";
  EXPECT_TRUE(Fence().IsHeld());
  EXPECT_THROW(Fence{file}, base::Error);
  base::WriteFileAtomically(file, "mine");
  const Fence fence(file);
  fence.RequireHeld();
  {
    const test::FailingCalls failing({.function = "stat", .path = "*/claim-1", .error = EIO},
                                     scratch.path() / "calls");
    EXPECT_TRUE(fence.IsHeld()) << "that it cannot be seen says nothing";
    EXPECT_EQ(failing.num_calls(), 1);
  }
  base::WriteFileAtomically(file, "another's");
  EXPECT_FALSE(fence.IsHeld());
  base::WriteFileAtomically(file, "mine");
  EXPECT_TRUE(fence.IsHeld());
  std::filesystem::remove(file);
  EXPECT_THAT([&] { fence.RequireHeld(); }, ThrowsMessage<base::Error>(HasSubstr(file.string())));
}

}  // namespace
}  // namespace slalom::run
