#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.h"
#include "tests/app/sweep/fake_sweep.h"
#include "tests/support/browser.h"
#include "tests/support/scratch_directory.h"

/// Opens the report's page in a browser. Skipped where there is none.

namespace slalom::sweep {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

int Count(const std::string& text, const std::string& what) {
  int count = 0;
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; ++at) ++count;
  return count;
}

class SweepPageTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!test::Browser::Find()) GTEST_SKIP() << "no chromium here: apt-get install chromium";
  }

  test::ScratchDirectory scratch_;
  test::Browser browser_{scratch_.path()};
};

/// Rows with long names, snapshots, and more lines than one figure takes.
test::FakeSweep MakeWide() {
  test::FakeSweep fake({"method", "learning rate"}, {"static-test", "generated", "training"});
  for (const char* method : {"a-method-with-quite-a-long-name", "another-method-with-a-long-name",
                             "TD3 with everything that there is"}) {
    for (const char* rate : {"1e-5", "1e-4", "1e-3"}) {
      for (const int seed : {1, 2}) {
        const std::size_t cell = fake.AddTraining({method, rate}, seed);
        fake.AddSnapshot(cell, 1000);
        fake.FinishTraining(cell);
        base::MakeDirectories(CellDirectory(fake.store(), fake.cell(cell).id).run());
        base::WriteFileAtomically(
            CellDirectory(fake.store(), fake.cell(cell).id).run() / "metrics.csv",
            "training_s,steps,updates\n10000,1000,1\n");
        fake.FinishTraining(cell, 30000.0);
        for (const Score& score : fake.plan.scores) {
          fake.Evaluate(cell, score.name, {"SSC", "SCC", "SSS"}, 10.0, 1000);
          fake.Evaluate(cell, score.name, {"SSS", seed == 1 ? "SCC" : "SSS", "SSS"});
        }
      }
    }
  }
  Reference reference;
  reference.source = "Somebody and others, a year, a conference with a long name";
  reference.score = "generated";
  reference.rows = {"TD3 with everything that there is / 1e-4"};
  reference.values = {0.5};
  fake.plan.references.push_back(reference);
  return fake;
}

TEST_F(SweepPageTest, DrawsSuccessOverANumericAxisBesideThePublishedNumbers) {
  const std::string dom = browser_.Render(test::MakeTrainingSets().Report("report.html"));
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_EQ(Count(dom, "data-figure=\"axis\""), 2);
  // Two rows with results on each of two scores; the published numbers of rows that have some.
  EXPECT_EQ(Count(dom, "data-point=\""), 4);
  EXPECT_THAT(dom, HasSubstr("data-point=\"0.6"));
  EXPECT_EQ(Count(dom, "data-published=\""), 3);  // One is of a row without results.
  EXPECT_EQ(Count(dom, "data-figure=\"dots\""), 0);
  EXPECT_EQ(Count(dom, "data-figure=\"profile\""), 2);
  EXPECT_EQ(Count(dom, "data-pair=\""), 2);
  // Three seeds and one.
  EXPECT_EQ(Count(dom, "data-verdict=\"too few seeds to tell\""), 2);
  EXPECT_EQ(Count(dom, "a clear difference"), 0);
  EXPECT_THAT(dom, HasSubstr("A &lt;fake&gt; sweep"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"sub partial\">1 of 3 seeds, 20 episodes</span>"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"published-value\">43 ± 2</span>"));
  EXPECT_THAT(dom, HasSubstr("no space left\non the device</pre>"));
  EXPECT_THAT(dom, HasSubstr("<li>10, seed 2, test: failed</li>"));
}

TEST_F(SweepPageTest, DrawsDotsWhereNoAxisIsNumeric) {
  test::FakeSweep fake({"method"}, {"test"});
  for (const char* method : {"TD3", "SAC"}) {
    fake.Evaluate(fake.AddTraining({method}, 1), "test", {"SSC", "SCC"});
  }
  const std::string dom = browser_.Render(fake.Report("report.html"));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_EQ(Count(dom, "data-figure=\"axis\""), 0);
  EXPECT_EQ(Count(dom, "data-figure=\"dots\""), 1);
  EXPECT_EQ(Count(dom, "data-point=\"0.5\""), 2);
}

TEST_F(SweepPageTest, RoundsHalvesAsTheOtherFormsDo) {
  test::FakeSweep fake({"learner.n_step"}, {"test"});
  std::vector<std::string> outcomes(9, "SSSCCCCC");
  outcomes.push_back("SSCCCCCC");  // 29 of 80 episodes: 36.25 %.
  fake.Evaluate(fake.AddTraining({"4"}, 1), "test", outcomes);
  fake.Evaluate(fake.AddTraining({"8"}, 1), "test", std::vector<std::string>(10, "SCCCCCCC"));
  const std::string dom = browser_.Render(fake.Report("report.html"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"value\">36.3</span>"));
  EXPECT_THAT(dom, HasSubstr("data-note=\"true\">Best row: n_step 4, with 36.3 % success"));
  EXPECT_THAT(dom, HasSubstr("against n_step 8"));
}

TEST_F(SweepPageTest, AnAxisIsLabelledAsInThePlan) {
  const std::string dom = browser_.Render(MakeWide().Report("report.html"));
  EXPECT_THAT(dom, HasSubstr("class=\"faint\">1e-4</text>"));
  EXPECT_EQ(Count(dom, "data-figure=\"axis\""), 3);
  EXPECT_EQ(Count(dom, "data-figure=\"steps\""), 3);
  EXPECT_EQ(Count(dom, "data-figure=\"seconds\""), 3);
}

TEST_F(SweepPageTest, ASweepThatHasNotBegunHasAPage) {
  test::FakeSweep fake({"courses"}, {"test"});
  fake.AddTraining({"5"}, 1);
  fake.AddTraining({"10"}, 1);
  const std::string dom = browser_.Render(fake.Report("report.html"));
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_EQ(Count(dom, "<li>"), 2);
}

TEST_F(SweepPageTest, SaysOnThePageWhatWentWrong) {
  std::string page = test::MakeTrainingSets().Report("report.html");
  const std::string mark = "\"scores\":[";
  page.replace(page.find(mark), mark.size(), "\"scores\":7,\"x\":[");
  EXPECT_THAT(browser_.Render(page), Not(HasSubstr("<div id=\"errors\" hidden=\"\"></div>")));
}

TEST_F(SweepPageTest, OnAPhoneNothingRunsOutOrOverlaps) {
  const std::string script = std::string(test::kFindClashes) + R"(
    clashes += document.getElementById('errors').textContent;
    for (const table of document.querySelectorAll('.figures-table')) {
      const box = table.parentNode;
      if (box.scrollWidth > box.clientWidth) clashes += 'a table is cut; ';
    }
    parent.postMessage(`${innerWidth} px: ${clashes}none else`, '*');)";
  for (const auto& page :
       {MakeWide().Report("report.html"), test::MakeTrainingSets().Report("report.html"),
        test::MakeArchitectures().Report("report.html")}) {
    for (const int width : {390, 1280}) {
      EXPECT_EQ(browser_.PostedInFrame(page, width, script),
                fmt::format("{} px: none else", width));
    }
  }
}

}  // namespace
}  // namespace slalom::sweep
