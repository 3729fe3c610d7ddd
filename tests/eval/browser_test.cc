#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>

#include "base/file.h"
#include "eval/report_page.h"
#include "tests/eval/made_evaluation.h"
#include "tests/support/scratch_directory.h"

/// Opens the page of a report in headless Chromium, without a network, and looks at what became of
/// it. Skipped where there is no Chromium (Debian: apt-get install chromium).

namespace slalom::eval {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::optional<std::string> FindBrowser() {
  for (const char* name : {"chromium", "chromium-browser", "google-chrome"}) {
    if (std::system(fmt::format("command -v {} >/dev/null 2>&1", name).c_str()) == 0) return name;
  }
  return std::nullopt;
}

class BrowserTest : public ::testing::Test {
 protected:
  void SetUp() override {
    browser_ = FindBrowser();
    if (!browser_) GTEST_SKIP() << "no chromium here: apt-get install chromium";
  }

  std::vector<Result> Read(const std::vector<std::pair<std::string, Evaluation>>& evaluations) {
    std::vector<Result> results;
    for (const auto& [agent, evaluation] : evaluations) {
      const auto directory = scratch_.path() / std::to_string(results.size());
      WriteReports(evaluation, testing::MakeProvenance(agent), directory);
      results.push_back(ReadResult(directory));
    }
    return results;
  }

  /// The page as it stands after its scripts ran for three seconds of the browser's own time.
  std::string Render(const std::string& page, const std::string& hash = "") {
    const auto file = scratch_.path() / "report.html";
    const auto dom = scratch_.path() / "dom.html";
    base::WriteFileAtomically(file, page);
    const std::string command = fmt::format(
        "HOME={0} {1} --headless --no-sandbox --disable-gpu --user-data-dir={0}/profile "
        "--host-resolver-rules='MAP * ~NOTFOUND' --window-size=1280,2000 "
        "--virtual-time-budget=3000 --dump-dom 'file://{2}{3}' >{4} 2>{0}/log",
        scratch_.path().string(), *browser_, file.string(), hash, dom.string());
    EXPECT_EQ(std::system(command.c_str()), 0) << base::ReadFile(scratch_.path() / "log");
    return base::ReadFile(dom);
  }

  static int Count(const std::string& text, const std::string& what) {
    int count = 0;
    for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; ++at) ++count;
    return count;
  }

  /// The value of `name` in the first element that holds `near`; empty: there is none.
  static std::string Attribute(const std::string& dom, const std::string& near,
                               const std::string& name) {
    const std::size_t at = dom.find(near);
    if (at == std::string::npos) return "";
    const std::size_t begin = dom.rfind('<', at);
    const std::string element = dom.substr(begin, dom.find('>', at) - begin);
    std::smatch match;
    const std::regex pattern(name + "=\"([^\"]*)\"");
    return std::regex_search(element, match, pattern) ? match[1].str() : "";
  }

  std::optional<std::string> browser_;
  test::ScratchDirectory scratch_;
};

TEST_F(BrowserTest, DrawsEverySectionWithTheFiguresOfTheResults) {
  const std::vector<double> easy(10, 0.9);
  const std::vector<double> hard{0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9};
  const std::vector<Result> results = Read({{"dwa", testing::MakeEvaluation(easy)},
                                            {"<b>teb</b>", testing::MakeEvaluation(hard)},
                                            {"mppi", testing::DriveCourses(2)}});
  std::string dom;
  {
    std::vector<Result> same_protocol = results;
    same_protocol[2].protocol = results[0].protocol;
    dom = Render(ReportPage(same_protocol));
  }
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_EQ(Count(dom, "data-drawn=\"true\""), 6);
  for (std::size_t r = 0; r < 2; ++r) {
    const auto expect = [&](const std::string& key, const Estimate& estimate) {
      const std::string cell = Attribute(
          dom, fmt::format("data-result=\"{}\" data-figure=\"{}\"", r, key), "data-value");
      ASSERT_NE(cell, "") << key;
      EXPECT_DOUBLE_EQ(std::stod(cell), estimate.value) << key;
    };
    const Figures& set = results[r].set;
    expect("success_rate", set.success_rate);
    expect("collision_rate", set.collision_rate);
    expect("timeout_rate", set.timeout_rate);
    expect("traversal_time_s", *set.traversal_time);
    expect("survival_time_s", *set.survival_time);
    expect("barn_score", set.barn_score);
    EXPECT_THAT(dom, HasSubstr(fmt::format("<span class=\"value\">{:.1f}</span>",
                                           100.0 * set.success_rate.value)));
  }
  // The third result is on other courses, which are chosen in the header.
  EXPECT_EQ(Attribute(dom, "data-result=\"2\"", "data-value"), "");
  EXPECT_EQ(Count(dom, "<option value=\"1\">driven</option>"), 1);
  EXPECT_EQ(Count(dom, "class=\"course\""), 20);
  EXPECT_EQ(Count(dom, "2 courses</text>") + Count(dom, "5 courses</text>"), 2);
  EXPECT_GE(Count(dom, "episodes</text>"), 4);
  EXPECT_EQ(Attribute(dom, "id=\"trajectory-canvas\"", "data-tracks"), "2");
  EXPECT_NE(Attribute(dom, "id=\"trajectory-canvas\"", "data-obstacles"), "");
  // A name is text, whatever is in it.
  EXPECT_THAT(dom, HasSubstr("&lt;b&gt;teb&lt;/b&gt;"));
  EXPECT_EQ(Count(dom, "<b>"), 0);
}

TEST_F(BrowserTest, PlaysAnEpisodeWithScanAndMovingObstacles) {
  const std::string page = ReportPage(Read({{"reactive", testing::DriveCourses(2)}}));
  const std::string still = Render(page);
  const auto of_canvas = [](const std::string& dom, const std::string& name) {
    return Attribute(dom, "id=\"episode-canvas\"", name);
  };
  EXPECT_EQ(of_canvas(still, "data-time"), "0");
  EXPECT_EQ(of_canvas(still, "data-beams"), "90");
  EXPECT_EQ(of_canvas(still, "data-moving"), "2");
  const std::string played = Render(page, "#play");
  EXPECT_THAT(played, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  // Three seconds of the browser's clock went by, which runs as fast as it can and is not exact.
  EXPECT_GT(std::stod(of_canvas(played, "data-time")), 1.0);
}

TEST_F(BrowserTest, SaysOnThePageWhatWentWrong) {
  std::string page = ReportPage(Read({{"dwa", testing::MakeEvaluation({0.5})}}));
  const std::string mark = "\"circles\":[";
  page.replace(page.find(mark), mark.size(), "\"circles\":7,\"x\":[");
  const std::string dom = Render(page);
  EXPECT_THAT(dom, Not(HasSubstr("data-ready=\"true\"")));
  EXPECT_THAT(dom, Not(HasSubstr("<div id=\"errors\" hidden=\"\"></div>")));
}

}  // namespace
}  // namespace slalom::eval
