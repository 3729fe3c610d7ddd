#include "eval/service/score_log.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "base/file.h"
#include "tests/support/scratch_directory.h"

namespace slalom::eval {
namespace {

Figures Scored(double success_rate) {
  Figures figures;
  figures.num_episodes = 100;
  figures.success_rate.value = success_rate;
  return figures;
}

TEST(ScoreLog, KnowsTheBestOfItsCourseSetAfterARestart) {
  const test::ScratchDirectory directory;
  const std::filesystem::path path = directory.path() / "evaluator" / "scores.csv";
  {
    ScoreLog log(path, "static-test");
    EXPECT_EQ(log.best_before(), -1.0);
    EXPECT_FALSE(log.Append(Scored(0.25), 10, 1.0, true));
    EXPECT_FALSE(log.Append(Scored(0.75), 20, 1.0, true));
    EXPECT_FALSE(log.Append(Scored(0.5), 30, 1.0, true));
  }
  ScoreLog log(path, "static-test");
  EXPECT_DOUBLE_EQ(log.best_before(), 0.75);
  EXPECT_FALSE(log.Append(Scored(0.8), 40, 1.0, true));
  EXPECT_DOUBLE_EQ(ScoreLog(path, "static-test").best_before(), 0.8);
  EXPECT_EQ(ScoreLog(path, "dynamic-box-test").best_before(), -1.0);
}

TEST(ScoreLog, AScoreWhosePolicyWasNotSavedIsStillToBeBeaten) {
  const test::ScratchDirectory directory;
  const std::filesystem::path path = directory.path() / "scores.csv";
  {
    ScoreLog log(path, "static-test");
    EXPECT_FALSE(log.Append(Scored(0.5), 10, 1.0, true));
    EXPECT_FALSE(log.Append(Scored(0.75), 20, 1.0, false));
  }
  EXPECT_DOUBLE_EQ(ScoreLog(path, "static-test").best_before(), 0.5);
}

TEST(ScoreLog, AFileWithOtherColumnsIsSetAside) {
  const test::ScratchDirectory directory;
  const std::filesystem::path path = directory.path() / "scores.csv";
  const std::string other = "unix_s,policy_version\n1763000000,11\n";
  base::WriteFileAtomically(path, other);
  EXPECT_EQ(ScoreLog(path, "static-test").best_before(), -1.0);
  EXPECT_EQ(base::ReadFile(path.string() + ".before"), other);
  EXPECT_TRUE(base::ReadFile(path).ends_with(",kept\n"));
}

TEST(ScoreLog, LinesThatAreNoneAreNotReadAndStay) {
  const test::ScratchDirectory directory;
  const std::filesystem::path path = directory.path() / "scores.csv";
  { EXPECT_FALSE(ScoreLog(path, "static-test").Append(Scored(0.5), 10, 1.0, true)); }
  const std::string good = base::ReadFile(path);
  const std::string torn = "1763000000,11,static-test,500,0.99";
  const std::string wrong = "\n1763000000,11,static-test,500,best,,,,,,,,1\n";
  base::WriteFileAtomically(path, good + torn + wrong);
  EXPECT_DOUBLE_EQ(ScoreLog(path, "static-test").best_before(), 0.5);
  EXPECT_EQ(base::ReadFile(path), good + torn + wrong);
}

TEST(ScoreLog, TheLineAfterATornOneIsWhole) {
  const test::ScratchDirectory directory;
  const std::filesystem::path path = directory.path() / "scores.csv";
  { EXPECT_FALSE(ScoreLog(path, "static-test").Append(Scored(0.5), 10, 1.0, true)); }
  base::WriteFileAtomically(path, base::ReadFile(path) + "1763000000,11,static-te");
  { EXPECT_FALSE(ScoreLog(path, "static-test").Append(Scored(0.75), 12, 1.0, true)); }
  EXPECT_DOUBLE_EQ(ScoreLog(path, "static-test").best_before(), 0.75);
}

TEST(ScoreLog, ACourseSetsNameMayHoldACommaOrQuotes) {
  const test::ScratchDirectory directory;
  const std::filesystem::path path = directory.path() / "scores.csv";
  const std::string name = "my \"own\", and best.courses";
  { EXPECT_FALSE(ScoreLog(path, name).Append(Scored(0.5), 10, 1.0, true)); }
  EXPECT_DOUBLE_EQ(ScoreLog(path, name).best_before(), 0.5);
  EXPECT_EQ(ScoreLog(path, "my \"own\"").best_before(), -1.0);
}

}  // namespace
}  // namespace slalom::eval
