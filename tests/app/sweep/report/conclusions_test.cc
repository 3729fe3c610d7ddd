#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "app/sweep/report/report.h"
#include "app/sweep/report/report_content.h"
#include "base/error.h"
#include "tests/app/sweep/fake_sweep.h"

namespace slalom::sweep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(ConclusionsTest, AVerdictIsOnTheWholeInterval) {
  const auto judge = [](double low, double high, ConclusionKind kind, double limit) {
    return Judge({0.5 * (low + high), eval::Interval{low, high}}, kind, limit);
  };
  using enum ConclusionKind;
  using enum ConclusionVerdict;
  EXPECT_EQ(judge(0.1, 0.3, kAbove, 0.0), kHolds);
  EXPECT_EQ(judge(-0.1, 0.3, kAbove, 0.0), kCannotTell);
  EXPECT_EQ(judge(-0.3, -0.1, kAbove, 0.0), kDoesNotHold);
  EXPECT_EQ(judge(-0.3, 0.04, kBelow, 0.05), kHolds);
  EXPECT_EQ(judge(0.04, 0.06, kBelow, 0.05), kCannotTell);
  EXPECT_EQ(judge(0.06, 0.07, kBelow, 0.05), kDoesNotHold);
  EXPECT_EQ(judge(-0.04, 0.04, kWithin, 0.05), kHolds);
  EXPECT_EQ(judge(-0.06, 0.04, kWithin, 0.05), kCannotTell);
  EXPECT_EQ(judge(-0.2, -0.06, kWithin, 0.05), kDoesNotHold);
  EXPECT_EQ(judge(0.06, 0.2, kWithin, 0.05), kDoesNotHold);
  EXPECT_EQ(Judge({0.5, std::nullopt}, kAbove, 0.0), kCannotTell);
}

/// The same outcomes on four times as many courses.
std::vector<std::string> FourTimes(const std::vector<std::string>& outcomes) {
  std::vector<std::string> all;
  for (int k = 0; k < 4; ++k) all.insert(all.end(), outcomes.begin(), outcomes.end());
  return all;
}

/// Rows TD3 and SAC with two seeds each on the same twelve courses. On each course SAC succeeds in
/// half of the episodes fewer than TD3 and takes 14 s, not 10. Row DDPG has not been trained.
test::FakeSweep MakeSweep() {
  test::FakeSweep sweep({"method"}, {"test", "train"});
  for (const std::string method : {"TD3", "SAC", "DDPG"}) {
    for (const int seed : {1, 2}) {
      const std::size_t cell = sweep.AddTraining({method}, seed);
      if (method == "TD3") sweep.Evaluate(cell, "test", FourTimes({"SSSS", "SSSC", "SSSS"}));
      if (method == "SAC") sweep.Evaluate(cell, "test", FourTimes({"SSCC", "SCCC", "SSCC"}), 14.0);
      if (method != "DDPG") sweep.Evaluate(cell, "train", {"SSSS", "SSSS"});
    }
  }
  return sweep;
}

ConclusionVerdict VerdictOn(const Conclusion& conclusion) {
  test::FakeSweep sweep = MakeSweep();
  sweep.plan.conclusions = {conclusion};
  return JudgeConclusions(sweep.plan, sweep.Results()).at(0).verdict;
}

TEST(ConclusionsTest, RowsAreComparedOnTheCoursesThatBothDrove) {
  test::FakeSweep sweep = MakeSweep();
  sweep.plan.conclusions = {{.text = "SAC is worse",
                             .score = "test",
                             .rows = {"SAC"},
                             .than = {"TD3"},
                             .kind = ConclusionKind::kBelow,
                             .limit = -0.4}};
  const auto judged = JudgeConclusions(sweep.plan, sweep.Results());
  const ConclusionFigure& figure = judged.at(0).figures.at(0);
  // 2/4, 1/4 and 2/4 less 4/4, 3/4 and 4/4: the difference is one half on each course, so it has no
  // spread and nothing is known of other courses.
  ASSERT_TRUE(figure.estimate);
  EXPECT_DOUBLE_EQ(figure.estimate->value, -0.5);
  EXPECT_FALSE(figure.estimate->interval);
  EXPECT_EQ(figure.verdict, ConclusionVerdict::kCannotTell);
}

TEST(ConclusionsTest, OneHoldsIfItHoldsForEachRow) {
  Conclusion conclusion{
      .text = "a row alone", .score = "test", .rows = {"TD3", "SAC"}, .limit = 0.2};
  EXPECT_EQ(VerdictOn(conclusion), ConclusionVerdict::kHolds);
  conclusion.limit = 0.7;
  EXPECT_EQ(VerdictOn(conclusion), ConclusionVerdict::kDoesNotHold);  // Not for SAC.
  conclusion.limit = 0.2;
  conclusion.rows = {"TD3", "DDPG"};
  EXPECT_EQ(VerdictOn(conclusion), ConclusionVerdict::kMissing);
}

TEST(ConclusionsTest, ARowMayBeHeldAgainstItselfOnOtherCourses) {
  Conclusion conclusion{.text = "test courses are harder",
                        .score = "train",
                        .rows = {"SAC"},
                        .than = {"SAC"},
                        .than_score = "test",
                        .limit = 0.3};
  EXPECT_EQ(VerdictOn(conclusion), ConclusionVerdict::kHolds);
  conclusion.kind = ConclusionKind::kWithin;
  EXPECT_EQ(VerdictOn(conclusion), ConclusionVerdict::kDoesNotHold);
}

TEST(ConclusionsTest, TheReportHasATableOfThem) {
  test::FakeSweep sweep = MakeSweep();
  sweep.plan.conclusions = {{.text = "TD3 | good", .score = "test", .rows = {"TD3"}, .limit = 0.5},
                            {.text = "SAC slower",
                             .score = "test",
                             .quantity = "traversal_time_s",
                             .rows = {"SAC"},
                             .than = {"TD3"},
                             .kind = ConclusionKind::kWithin,
                             .limit = 0.5}};
  const std::string text = sweep.Report("report.md");
  EXPECT_THAT(text, HasSubstr("| TD3 \\| good | TD3 on on test: success 91.7 ("));
  EXPECT_THAT(text, HasSubstr(") % | above 50 | holds |\n"));
  EXPECT_THAT(text, HasSubstr("| SAC slower | SAC less TD3 on on test: traversal 4.0 s | within ± "
                              "0.5 | cannot tell |\n"));
}

TEST(PageBlocksTest, ThoseOfThePlansAreFilled) {
  test::FakeSweep sweep = MakeSweep();
  sweep.plan.conclusions = {{.text = "TD3 is good", .score = "test", .rows = {"TD3"}}};
  const ReportContent content = sweep.Content();
  const auto fill = [&](const std::string& page) {
    return FillBlocks(page, "page.markdown", std::span(&content, 1));
  };
  const std::string end = "<!-- end of sweep -->\n";
  EXPECT_EQ(fill("a\n<!-- sweep table fake -->\nold\n" + end +
                 "b\n<!-- sweep table other "
                 "-->\nkept\n" +
                 end + "c\n"),
            "a\n<!-- sweep table fake -->\n\n" + MarkdownOf(CrossTables(content).front()) + "\n" +
                end + "b\n<!-- sweep table other -->\nkept\n" + end + "c\n");
  const std::string page = fill("<!-- sweep summary fake -->\n" + end +
                                "<!-- sweep conclusions "
                                "-->\n" +
                                end);
  EXPECT_THAT(page, HasSubstr("- Cells: 0 of 6 done"));
  EXPECT_EQ(fill(page), page);
  EXPECT_THAT(fill("<!-- sweep conclusions fake -->\n" + end), HasSubstr("| TD3 is good |"));
  const std::string kept = "<!-- sweep conclusions other -->\nkept\n" + end;
  EXPECT_THAT(fill(page + kept), HasSubstr(kept));
  const auto fails = [&](const std::string& text, const std::string& what) {
    EXPECT_THAT([&] { (void)fill(text); }, ThrowsMessage<base::Error>(HasSubstr(what)));
  };
  fails("a\n<!-- sweep tabel fake -->\n" + end,
        "page.markdown:2: the block is of the kind 'tabel'");
  fails("<!-- sweep table fake -->\nold\n", "page.markdown:1: the block has no end");
  fails("a\n", "page.markdown: has no block of these plans");
}

}  // namespace
}  // namespace slalom::sweep
