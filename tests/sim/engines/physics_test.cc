#include "sim/engines/physics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/error.h"

// Compiled twice: with the engines that are installed, and without any.

namespace slalom::engines {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string ErrorOf(std::string_view list) {
  try {
    FindPhysicsList(list);
  } catch (const base::Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Physics, SlalomsOwnIsAlwaysThere) {
  const auto found = FindPhysicsList("slalom");
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].name, "slalom");
  EXPECT_FALSE(found[0].make_bodies);
}

TEST(Physics, RefusesNamesThatItDoesNotKnow) {
  for (const char* list : {"bullet", "", "slalom,", "slalom ode", "ODE"}) {
    EXPECT_THAT(ErrorOf(list),
                HasSubstr("expected slalom, ode, mujoco, several of them with commas, or all"))
        << list;
  }
  EXPECT_THAT(ErrorOf("slalom,slalom"), HasSubstr("names slalom twice"));
}

TEST(Physics, SaysWhatToInstallForOneThatWasNotBuilt) {
  for (const PhysicsInfo& info : KnownPhysics()) {
    if (info.is_built_in) continue;
    EXPECT_THAT(ErrorOf(info.name), AllOf(HasSubstr("built without it"),
                                          HasSubstr("apt-get install " + std::string(info.package)),
                                          HasSubstr("again")));
    EXPECT_THAT(ErrorOf("all"), HasSubstr("built without it"));
  }
}

TEST(Physics, ComesWithItsVersionSlalomsFirst) {
  for (const PhysicsInfo& info : KnownPhysics()) {
    if (!info.is_built_in || info.package.empty()) continue;
    const auto found = FindPhysicsList(std::string(info.name) + ",slalom");
    ASSERT_EQ(found.size(), 2u);
    EXPECT_EQ(found[0].name, "slalom");
    EXPECT_EQ(found[1].name, info.name);
    EXPECT_THAT(found[1].version, ::testing::MatchesRegex("[0-9]+[.][0-9]+[.][0-9]+"));
    EXPECT_TRUE(found[1].make_bodies);
  }
}

}  // namespace
}  // namespace slalom::engines
