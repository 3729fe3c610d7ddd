#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string>

#include "app/watch/watch_server.h"
#include "base/file.h"
#include "metrics/listener.h"
#include "tests/support/scratch_directory.h"

/// Opens the page of `slalom watch` in headless Chromium and looks at what became of it. Skipped
/// where there is no Chromium (Debian: apt-get install chromium).

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::optional<std::string> FindBrowser() {
  for (const char* name : {"chromium", "chromium-browser", "google-chrome"}) {
    if (std::system(fmt::format("command -v {} >/dev/null 2>&1", name).c_str()) == 0) return name;
  }
  return std::nullopt;
}

class WatchBrowserTest : public ::testing::Test {
 protected:
  void SetUp() override {
    browser_ = FindBrowser();
    if (!browser_) GTEST_SKIP() << "no chromium here: apt-get install chromium";
    base::MakeDirectories(root() / "<b>one");
    base::WriteFileAtomically(root() / "<b>one/metrics.csv",
                              "training_s,steps,success_rate,episode_return,policy_entropy_nats\n"
                              "1,1000,,,\n2,20000,0.5,3,\n4,40000,0.75,12.5,\n");
  }

  fs::path root() const { return scratch_.path() / "runs"; }

  /// The page after three seconds of the browser's own time.
  std::string Open(const std::string& hash) {
    const auto dom = scratch_.path() / "dom.html";
    const std::string command = fmt::format(
        "HOME={0} {1} --headless --no-sandbox --disable-gpu --user-data-dir={0}/profile "
        "--window-size=1280,2000 --virtual-time-budget=3000 --dump-dom "
        "'http://127.0.0.1:{2}/{3}' >{4} 2>{0}/log",
        scratch_.path().string(), *browser_, listener_.port, hash, dom.string());
    EXPECT_EQ(std::system(command.c_str()), 0) << base::ReadFile(scratch_.path() / "log");
    return base::ReadFile(dom);
  }

  std::optional<std::string> browser_;
  const test::ScratchDirectory scratch_;
  const WatchPages pages_{
      root(),
      {.facts =
           [](const fs::path&) {
             return RunFacts{.max_steps = 80000, .lines = {{"Algorithm", "<i>td3</i>"}}};
           },
       .drives =
           [](const fs::path&) {
             return Drives{"<svg xmlns='http://www.w3.org/2000/svg'/>", "Driven just now", 1};
           }}};
  const metrics::Listener listener_ = metrics::Listen("127.0.0.1:0", "serve the page");
  const metrics::HttpServer server_{listener_.socket,
                                    [this](std::string_view path) { return pages_.Answer(path); }};
};

TEST_F(WatchBrowserTest, ShowsTheRunThatWasWrittenLast) {
  const std::string dom = Open("");
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_THAT(dom, HasSubstr("<h2 id=\"name\">&lt;b&gt;one</h2>"));
  EXPECT_THAT(dom, HasSubstr("class=\"state training\""));
  EXPECT_THAT(dom, HasSubstr("<span class=\"figure\">75.0 %</span>"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"figure\">40k</span>"));
  EXPECT_THAT(dom, HasSubstr("<span class=\"figure\">0:04</span>"));  // Half of the steps are left.
  EXPECT_THAT(dom, HasSubstr("data-chart=\"Episodes\""));
  EXPECT_THAT(dom, HasSubstr("data-chart=\"Return\""));
  EXPECT_THAT(dom, ::testing::Not(HasSubstr("data-chart=\"Entropy\"")));
  EXPECT_THAT(dom, HasSubstr("src=\"/run/%3Cb%3Eone.svg?1\""));
  EXPECT_THAT(dom, HasSubstr("&lt;i&gt;td3&lt;/i&gt;"));
}

TEST_F(WatchBrowserTest, SaysThatARunIsGone) {
  const std::string dom = Open("#two");
  EXPECT_THAT(dom, HasSubstr("The run two is no longer there."));
}

}  // namespace
}  // namespace slalom::watch
