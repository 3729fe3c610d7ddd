#include "base/machine.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>

namespace slalom::base {
namespace {

rlim_t Limit() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  return limit.rlim_cur;
}

TEST(DescriptorLimitTest, IsRaisedAsFarAsIsUsefulAndNeverLowered) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlim_t most = std::min<rlim_t>(before.rlim_max, 65536);
  const rlimit low{.rlim_cur = 64, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  EXPECT_EQ(DescriptorLimit(), 64) << "the one in force, not the hard one";
  RaiseDescriptorLimit();
  EXPECT_EQ(Limit(), most);
  const rlimit high{.rlim_cur = before.rlim_max, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &high), 0);
  RaiseDescriptorLimit();
  EXPECT_EQ(Limit(), before.rlim_max);
  setrlimit(RLIMIT_NOFILE, &before);
}

TEST(IsLocalHostTest, IsThisMachineToItself) {
  for (const char* host : {"localhost", "127.0.0.1", "127.9.0.2", "::1", "[::1]"}) {
    EXPECT_TRUE(IsLocalHost(host)) << host;
  }
  for (const char* host : {"", "10.0.0.1", "1.0.0.127", "::", "100::", "[::2]", "local", "[127"}) {
    EXPECT_FALSE(IsLocalHost(host)) << host;
  }
}

}  // namespace
}  // namespace slalom::base
