#include "app/watch/watch_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "app/watch/run_page.h"
#include "base/error.h"
#include "base/file.h"
#include "tests/support/scratch_directory.h"

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

class WatchPagesTest : public ::testing::Test {
 protected:
  void MakeRun(const std::string& name) {
    base::MakeDirectories(root() / name);
    base::WriteFileAtomically(
        root() / name / "metrics.csv",
        "training_s,steps,success_rate,policy_entropy_nats\n1,100,0.5,\n2,200,0.75,\n");
  }

  fs::path root() const { return scratch_.path() / "runs"; }

  metrics::HttpAnswer Get(const std::string& path) const { return pages_.Answer(path); }
  Json GetJson(const std::string& path) const { return Json::parse(Get(path).body); }

  const test::ScratchDirectory scratch_;
  Drives drives_;
  const WatchPages pages_{scratch_.path() / "runs",
                          {.facts =
                               [](const fs::path&) {
                                 return RunFacts{.max_steps = 400, .lines = {{"Algorithm", "td3"}}};
                               },
                           .drives = [this](const fs::path&) { return drives_; }}};
};

TEST_F(WatchPagesTest, ThePageIsWholeAndLoadsNothingFromElsewhere) {
  const metrics::HttpAnswer page = Get("/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.type, "text/html; charset=utf-8");
  for (const char* mark : {"/*DATA*/", "@STYLE@", "@SCRIPT@", "src=\"", "https:", "@import"}) {
    EXPECT_THAT(page.body, Not(HasSubstr(mark)));
  }
  EXPECT_THAT(page.body, HasSubstr("default-src 'none'; style-src 'unsafe-inline'; "
                                   "script-src 'unsafe-inline'; connect-src 'self'; "
                                   "img-src 'self' data:\">"));
  EXPECT_THAT(page.body, HasSubstr("--paper"));          // The report's style.
  EXPECT_THAT(page.body, HasSubstr("function update"));  // The script.
}

TEST_F(WatchPagesTest, ARunIsShownWithItsCurvesAndFacts) {
  MakeRun("one");
  const Json run = GetJson("/run/one.json");
  EXPECT_EQ(run["name"], "one");
  EXPECT_EQ(run["state"], "training");
  EXPECT_EQ(run["stage"], "");
  EXPECT_EQ(run["left_s"], 2.0);  // Half of the steps in 2 s.
  EXPECT_EQ(run["curves"]["success_rate"], Json({0.5, 0.75}));
  EXPECT_FALSE(run["curves"].contains("policy_entropy_nats")) << "a column without a number";
  EXPECT_EQ(run["facts"][0][1], "td3");
  EXPECT_EQ(run["drives"]["number"], 0);
  EXPECT_EQ(run["scores"], Json::object());
  base::WriteFileAtomically(root() / "one/curve.csv",
                            "training_s,success_rate,traversal_time_s\n2,0.5,\n");
  EXPECT_EQ(GetJson("/run/one.json")["scores"],
            Json({{"training_s", {2.0}}, {"success_rate", {0.5}}}));
}

TEST_F(WatchPagesTest, APageOfARunHoldsItsDataAndNothingThatEndsItsScript) {
  MakeRun("one");
  const std::string page = RunPage(root() / "one", {.lines = {{"Algorithm", "</script><b>"}}});
  EXPECT_THAT(page, HasSubstr("\"name\":\"one\""));
  EXPECT_THAT(page, HasSubstr("\"success_rate\":[0.5,0.75]"));
  EXPECT_THAT(page, HasSubstr("\\u003c/script>\\u003cb>"));
  EXPECT_THAT(page, Not(HasSubstr("\"state\":")));
  EXPECT_THROW(RunPage(root() / "two", {}), base::Error);
}

TEST_F(WatchPagesTest, RunsAreListedAndFoundByTheirNameWhateverItIs) {
  MakeRun("plain");
  MakeRun("50% <b>\"x\" #2");
  const Json runs = GetJson("/runs.json")["runs"];
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0]["name"], "50% <b>\"x\" #2");
  EXPECT_EQ(runs[1]["steps"], 200.0);
  EXPECT_EQ(GetJson("/run/50%25%20%3Cb%3E%22x%22%20%232.json")["steps"], 200.0);
}

TEST_F(WatchPagesTest, NothingElseCanBeAskedFor) {
  MakeRun("one");
  base::WriteFileAtomically(scratch_.path() / "metrics.csv", "steps\n1\n");
  for (const char* path :
       {"", "/x", "/run/", "/run/.json", "/run/two.json", "/run/..json", "/run/../one.json",
        "/run/%2e%2e.json", "/run/%2e%2e%2f.json", "/run/one/.json", "/run/one%2f.json",
        "/run/%.json", "/run/%6.json", "/one/metrics.csv", "/run/one", "/run.json", "/run/.svg"}) {
    EXPECT_EQ(Get(path).status, 404) << path;
  }
}

TEST_F(WatchPagesTest, ARunThatIsDeletedIsGoneAndTheOthersStay) {
  MakeRun("one");
  MakeRun("two");
  EXPECT_EQ(Get("/run/one.json").status, 200);
  fs::remove_all(root() / "one");
  EXPECT_EQ(Get("/run/one.json").status, 404);
  EXPECT_EQ(GetJson("/runs.json")["runs"].size(), 1u);
  fs::remove_all(root());
  EXPECT_EQ(GetJson("/runs.json")["runs"].size(), 0u);
}

TEST_F(WatchPagesTest, ThePictureIsThereOnceItIsDriven) {
  MakeRun("one");
  drives_.note = "No policy yet";
  EXPECT_EQ(Get("/run/one.svg").status, 404);
  EXPECT_EQ(GetJson("/run/one.json")["drives"]["note"], "No policy yet");
  drives_ = {"<svg/>", "Driven", 3};
  const metrics::HttpAnswer picture = Get("/run/one.svg");
  EXPECT_EQ(picture.type, "image/svg+xml");
  EXPECT_EQ(picture.body, "<svg/>");
  EXPECT_EQ(GetJson("/run/one.json")["drives"]["number"], 3);
}

}  // namespace
}  // namespace slalom::watch
