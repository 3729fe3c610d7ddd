#include "tests/sim/courses/barn_data.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <optional>

#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(BarnData, IsNowhereWhereNobodySaysWhere) {
  for (const char* value : {static_cast<const char*>(nullptr), ""}) {
    const BarnData data = FindBarnData(value);
    EXPECT_EQ(data.directory, std::nullopt);
    EXPECT_EQ(data.fault, "");
  }
}

TEST(BarnData, ADirectoryThatIsNotThereIsAFault) {
  const BarnData data = FindBarnData("/nonexistent/worlds");
  EXPECT_NE(data.directory, std::nullopt);
  EXPECT_THAT(data.fault, HasSubstr("is '/nonexistent/worlds', which is not a directory"));
}

TEST(BarnData, EveryMissingFileIsNamed) {
  const test::ScratchDirectory scratch;
  std::filesystem::create_directory(scratch.path() / "sample_worlds");
  for (const char* file : BarnFiles()) std::ofstream(scratch.path() / file) << "";
  EXPECT_EQ(FindBarnData(scratch.path().c_str()).fault, "");
  for (const char* file : BarnFiles()) {
    std::filesystem::remove(scratch.path() / file);
    EXPECT_THAT(FindBarnData(scratch.path().c_str()).fault,
                HasSubstr("which lacks " + std::string(file) + "; see docs/courses.md"));
    std::ofstream(scratch.path() / file) << "";
  }
  std::filesystem::remove(scratch.path() / "splits.json");
  std::filesystem::remove(scratch.path() / "dynamic_box.csv");
  EXPECT_THAT(FindBarnData(scratch.path().c_str()).fault,
              AllOf(HasSubstr("lacks dynamic_box.csv, splits.json;"), Not(HasSubstr("wall"))));
}

}  // namespace
}  // namespace slalom::sim
