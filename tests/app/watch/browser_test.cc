#include "tests/support/browser.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "app/watch/run_page.h"
#include "app/watch/watch_server.h"
#include "base/file.h"
#include "metrics/http_server.h"
#include "tests/support/scratch_directory.h"

/// Opens the page of `slalom watch` in headless Chromium and looks at what became of it. Skipped
/// where there is no Chromium (Debian: apt-get install chromium).

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class WatchBrowserTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!test::Browser::Find()) GTEST_SKIP() << "no chromium here: apt-get install chromium";
    base::MakeDirectories(root() / "<b>one");
    base::WriteFileAtomically(root() / "<b>one/metrics.csv",
                              "training_s,steps,success_rate,episode_return,policy_entropy_nats\n"
                              "1,1000,,,\n2,20000,0.5,3,\n4,40000,0.75,12.5,\n");
  }

  fs::path root() const { return scratch_.path() / "runs"; }

  const test::ScratchDirectory scratch_;
  const test::Browser browser_{scratch_.path()};
  const WatchPages pages_{
      root(),
      {.facts =
           [](const fs::path&) {
             return RunFacts{.max_steps = 80000,
                             .lines = {{"Algorithm", "<i>td3</i>"}},
                             .changes = {{"courses.train", "\"<u>mine\""}}};
           },
       .drives =
           [](const fs::path&) {
             return Drives{"<svg xmlns='http://www.w3.org/2000/svg'/>", "Driven just now", 1};
           }}};
  const metrics::Listener listener_ = metrics::Listen("127.0.0.1:0", "serve the page");
  const metrics::HttpServer server_{listener_.socket,
                                    [this](std::string_view path) { return pages_.Answer(path); }};

  /// The live page.
  std::string Open(const std::string& hash) const {
    return browser_.Open(fmt::format("http://127.0.0.1:{}/{}", listener_.port, hash));
  }
};

TEST_F(WatchBrowserTest, ShowsTheRunThatWasWrittenLast) {
  const std::string dom = Open("");
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_THAT(dom, HasSubstr("<h2 id=\"name\">&lt;b&gt;one</h2>"));
  EXPECT_THAT(dom, HasSubstr("class=\"state training\""));
  EXPECT_THAT(dom, HasSubstr("<span class=\"figure\">75.0 %</span>"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"figure\">40k</span>"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"figure\">4 s</span>"));  // Half of the steps are left.
  EXPECT_THAT(dom, HasSubstr("data-chart=\"Training episodes\""));
  EXPECT_THAT(dom, HasSubstr("data-chart=\"Return\""));
  EXPECT_THAT(dom, ::testing::Not(HasSubstr("data-chart=\"Entropy\"")));
  EXPECT_THAT(dom, HasSubstr("src=\"/run/%3Cb%3Eone.svg?1\""));
  EXPECT_THAT(dom, HasSubstr("&lt;i&gt;td3&lt;/i&gt;"));
  EXPECT_THAT(dom, HasSubstr("data-change=\"courses.train\""));
  EXPECT_THAT(dom, HasSubstr("<code>\"&lt;u&gt;mine\"</code>"));
}

TEST_F(WatchBrowserTest, OpensAPageThatHoldsItsRunWithoutAServer) {
  base::WriteFileAtomically(root() / "<b>one/curve.csv",
                            "training_s,success_rate,success_low,success_high\n2,0.25,0.2,0.4\n"
                            "4,0.625,0.5,0.75\n");
  const std::string dom = browser_.Render(RunPage(root() / "<b>one", {.max_steps = 80000}));
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_THAT(dom, HasSubstr("<h2 id=\"name\">&lt;b&gt;one</h2>"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"figure\">62.5 %</span>"));  // The test score.
  EXPECT_THAT(dom, HasSubstr("data-chart=\"Test scores, 95 % intervals\""));
  EXPECT_THAT(dom, HasSubstr("data-point=\"0.625\""));
  EXPECT_THAT(dom, HasSubstr("<section id=\"drives\" hidden=\"\">"));
  EXPECT_THAT(dom, HasSubstr("<div id=\"changes\" hidden=\"\">"));
}

TEST_F(WatchBrowserTest, AxesHaveRoundNumbersAndHoldZero) {
  std::string rows = "training_s,steps,steps_per_s\n";
  for (int i = 1; i <= 33; ++i) rows += fmt::format("{},{},{}\n", 100 * i, 1000 * i, 30000 + i);
  base::WriteFileAtomically(root() / "<b>one/metrics.csv", rows);
  const std::string dom = browser_.Render(RunPage(root() / "<b>one", {}));
  const std::size_t begin = dom.find("data-chart=\"Simulation rate\"");
  ASSERT_NE(begin, std::string::npos);
  const std::string chart = dom.substr(begin, dom.find("</figure>", begin) - begin);
  for (const char* tick : {">0<", ">10k<", ">20k<", ">30k<", ">40k<", ">20<"}) {
    EXPECT_THAT(chart, HasSubstr(tick));  // Steps per second, and minutes.
  }
}

TEST_F(WatchBrowserTest, SaysThatARunIsGone) {
  const std::string dom = Open("#two");
  EXPECT_THAT(dom, HasSubstr("The run two is no longer there."));
}

}  // namespace
}  // namespace slalom::watch
