#include "tests/support/browser.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <regex>

#include "base/file.h"
#include "eval/comparison/comparison.h"
#include "eval/comparison/report_page.h"
#include "tests/eval/report/made_evaluation.h"
#include "tests/support/scratch_directory.h"

/// Opens the page of a report in headless Chromium, without a network, and looks at what became of
/// it. Skipped where there is no Chromium (Debian: apt-get install chromium).

namespace slalom::eval {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// The report in which each result is an agent.
std::string PageOf(std::span<const Result> results) {
  return ReportPage(CompareResults(results, AgentsOf(results)));
}

class BrowserTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!test::Browser::Find()) GTEST_SKIP() << "no chromium here: apt-get install chromium";
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

  std::string Render(const std::string& page, const std::string& hash = "",
                     const test::Window& window = {}) const {
    return browser_.Render(page, hash, window);
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

  const test::ScratchDirectory scratch_;
  const test::Browser browser_{scratch_.path()};
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
    dom = Render(PageOf(same_protocol));
  }
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_EQ(Count(dom, "data-drawn=\"true\""), 11);
  for (std::size_t r = 0; r < 2; ++r) {
    const auto expect = [&](const std::string& key, const Estimate& estimate) {
      const std::string cell = Attribute(
          dom, fmt::format("data-result=\"{}\" data-figure=\"{}\"", r, key), "data-value");
      ASSERT_NE(cell, "") << key;
      EXPECT_NEAR(std::stod(cell), estimate.value, 1e-12) << key;
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
  EXPECT_EQ(Count(dom, "class=\"course clickable\""), 20);
  EXPECT_EQ(Count(dom, "2 courses</text>") + Count(dom, "5 courses</text>"), 2);
  EXPECT_GE(Count(dom, "episodes</text>"), 4);
  EXPECT_EQ(Attribute(dom, "id=\"trajectory-canvas\"", "data-tracks"), "2");
  EXPECT_NE(Attribute(dom, "id=\"trajectory-canvas\"", "data-obstacles"), "");
  // A name is text, whatever is in it.
  EXPECT_THAT(dom, HasSubstr("&lt;b&gt;teb&lt;/b&gt;"));
  EXPECT_EQ(Count(dom, "<b>"), 0);
}

TEST_F(BrowserTest, PlaysAnEpisodeWithScanAndMovingObstacles) {
  const std::string page = PageOf(Read({{"reactive", testing::DriveCourses(2)}}));
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

TEST_F(BrowserTest, HidesWhatIsEmpty) {
  // One agent that never failed, on courses too few for bins of difficulty.
  std::vector<Result> results = Read({{"perfect", testing::MakeEvaluation({1.0, 1.0})}});
  const std::string dom = Render(PageOf(results));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  const auto is_hidden = [&dom](const std::string& near) {
    const std::size_t at = dom.find(near);
    EXPECT_NE(at, std::string::npos) << near;
    return dom.substr(at, dom.find('>', at) - at).find(" hidden=\"\"") != std::string::npos;
  };
  for (const char* id : {"versus", "failures", "difficulty", "drawn", "survival", "agent-choice"}) {
    EXPECT_TRUE(is_hidden(fmt::format(" id=\"{}\"", id))) << id;
  }
  for (const char* id : {"figures", "courses", "times", "traversal", "trajectories", "episode"}) {
    EXPECT_FALSE(is_hidden(fmt::format(" id=\"{}\"", id))) << id;
  }
  for (const char* link : {"versus", "failures", "difficulty", "drawn"}) {
    EXPECT_TRUE(is_hidden(fmt::format("href=\"#{}\"", link))) << link;
  }
  EXPECT_FALSE(is_hidden("href=\"#times\""));
  EXPECT_EQ(Count(dom, "data-figure=\"survival_time_s\""), 0);
  EXPECT_EQ(Count(dom, "data-overlap="), 0);
  // Where no episode was recorded there is none to play.
  results[0].tracks.clear();
  const std::string untracked = Render(PageOf(results));
  EXPECT_THAT(untracked, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_THAT(untracked, HasSubstr("<section id=\"episode\" hidden=\"\""));
  EXPECT_THAT(untracked, HasSubstr("<a href=\"#episode\" hidden=\"\""));
}

TEST_F(BrowserTest, ListsEveryFailureAndPlaysTheOneThatIsClicked) {
  const std::vector<Result> results =
      Read({{"dwa", testing::MakeEvaluation({0.0, 0.0, 0.5, 1.0})},
            {"teb", testing::MakeEvaluation({0.3, 0.3, 1.0, 0.9})}});
  // What the list must hold, and the last of those that were recorded, which is clicked.
  std::vector<std::string> failures;
  std::string recorded;
  for (std::size_t c = 0; c < 4; ++c) {
    for (const Result& result : results) {
      for (std::size_t k = 0; k < result.courses[c].episodes.size(); ++k) {
        if (result.courses[c].episodes[k].outcome == env::Outcome::kSuccess) continue;
        failures.push_back(fmt::format("{}/{}/{}", result.agent, result.courses[c].name, k));
        for (const sim::EpisodeTrack& track : result.tracks) {
          const bool is_it =
              track.course == result.courses[c].name && track.episode == static_cast<int>(k);
          if (is_it) recorded = failures.back();
        }
      }
    }
  }
  ASSERT_GT(failures.size(), 12u);
  ASSERT_NE(recorded, "");
  test::Window window;
  window.script = fmt::format(
      "document.getElementById('more-failures').click();"
      "document.querySelector('button[data-episode=\"{}\"]').click();",
      recorded);
  const std::string dom = Render(PageOf(results), "", window);
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_EQ(Count(dom, "class=\"link\" data-episode=\""), static_cast<int>(failures.size()));
  for (const std::string& failure : failures) {
    EXPECT_THAT(dom, HasSubstr(fmt::format("data-episode=\"{}\"", failure)));
  }
  const std::string canvas = "id=\"episode-canvas\"";
  EXPECT_EQ(Attribute(dom, canvas, "data-episode"), recorded);
  EXPECT_GT(std::stod(Attribute(dom, canvas, "data-time")), 0.0);
}

TEST_F(BrowserTest, SetsOneAgentAgainstAnother) {
  const std::vector<double> easy(10, 0.9);
  const std::vector<double> hard{0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9};
  const std::vector<Result> results = Read({{"dwa", testing::MakeEvaluation(easy)},
                                            {"teb", testing::MakeEvaluation(hard)},
                                            {"mppi", testing::MakeEvaluation(easy)}});
  const auto expect = [](const std::string& dom, const std::string& key, const Estimate& estimate) {
    const auto number = [&](const char* name) {
      return std::stod(Attribute(dom, fmt::format("data-difference=\"{}\"", key), name));
    };
    EXPECT_NEAR(number("data-value"), estimate.value, 1e-12) << key;
    EXPECT_NEAR(number("data-low"), estimate.interval->low, 1e-12) << key;
    EXPECT_NEAR(number("data-high"), estimate.interval->high, 1e-12) << key;
  };
  const std::string page = PageOf(results);
  const std::string dom = Render(page);
  const Group group = CompareResults(results, AgentsOf(results)).groups.front();
  const AgentPair& pair = group.pairs.front();
  for (const char* key : {"success_rate", "traversal_time_s", "barn_score"}) {
    expect(dom, key, *pair.differences[*FindQuantity(key)]);
  }
  // The table of all pairs has their verdicts, which are those of the comparison.
  EXPECT_EQ(Count(dom, "data-pair="), 3);
  EXPECT_EQ(Attribute(dom, "data-pair=\"0 1\"", "data-pair"), "0 1");
  EXPECT_EQ(Attribute(dom, "data-verdict=", "data-verdict"), ToString(pair.verdict));
  EXPECT_EQ(std::stod(Attribute(dom, "data-p=", "data-p")), pair.corrected_p_value);
  // Every course is in one dot, and in a bar if it tells them apart.
  int num_courses = 0;
  int num_dots = 0;
  const std::regex dot("data-courses=\"([0-9]+)\"");
  for (std::sregex_iterator it(dom.begin(), dom.end(), dot), end; it != end; ++it, ++num_dots) {
    num_courses += std::stoi((*it)[1]);
  }
  EXPECT_EQ(num_courses, 10);
  EXPECT_EQ(Count(dom, "class=\"pair-dot clickable\""), num_dots);
  int num_different = 0;
  int only_first = 0;
  for (std::size_t c = 0; c < 10; ++c) {
    int difference = 0;
    for (std::size_t k = 0; k < 5; ++k) {
      const bool first = results[0].courses[c].episodes[k].outcome == env::Outcome::kSuccess;
      const bool second = results[1].courses[c].episodes[k].outcome == env::Outcome::kSuccess;
      difference += first - second;
      only_first += first && !second;
    }
    num_different += difference != 0;
  }
  EXPECT_EQ(Count(dom, "class=\"pair-bar clickable\""), num_different);
  EXPECT_THAT(dom, HasSubstr(fmt::format("only dwa in {},", only_first)));
  // The other way round, chosen on the page.
  test::Window window;
  window.script =
      "const b = document.getElementById('versus-b'); b.value = '0';"
      "b.dispatchEvent(new Event('change'));";
  const std::string turned = Render(page, "", window);
  const auto [low, high] = *pair.difference().interval;
  expect(turned, "success_rate", {-pair.difference().value, Interval{-high, -low}});
}

TEST_F(BrowserTest, FollowsTheSystemsColoursAndTheButtonAndPrintsInLight) {
  const std::string page = PageOf(Read({{"dwa", testing::MakeEvaluation({0.5, 0.5})}}));
  const std::string note =
      "document.body.dataset.ground += getComputedStyle(document.body).backgroundColor;";
  test::Window window;
  window.script = "document.body.dataset.ground = '';" + note +
                  "document.getElementById('theme').click();" + note +
                  "dispatchEvent(new Event('beforeprint'));" + note +
                  "dispatchEvent(new Event('afterprint'));" + note;
  const std::string light = "rgb(245, 247, 249)";
  const std::string dark = "rgb(15, 19, 23)";
  EXPECT_EQ(Attribute(Render(page, "", window), "data-ground", "data-ground"),
            light + dark + light + dark);
  window.is_dark = true;
  EXPECT_EQ(Attribute(Render(page, "", window), "data-ground", "data-ground"),
            dark + light + light + light);
}

TEST_F(BrowserTest, OnAPhoneNothingRunsOutOrOverlaps) {
  const std::vector<double> half(40, 0.5);
  std::vector<Result> results =
      Read({{"a-policy-with-quite-a-long-name", testing::MakeEvaluation(half)},
            {"another-policy-with-a-long-name", testing::MakeEvaluation(half)},
            {"teb", testing::MakeEvaluation(half)}});
  // Numbers of obstacles with four digits, which make long labels.
  sim::CourseSet courses = results[0].course_set_data;
  for (std::size_t c = 0; c < courses.courses.size(); ++c) {
    sim::Course course = *courses.courses[c];
    course.circles.resize(1000 + 25 * c, course.circles.front());
    courses.courses[c] = std::make_shared<const sim::Course>(std::move(course));
  }
  for (Result& result : results) result.course_set_data = courses;
  for (const int width : {390, 1280}) {
    const std::string script = std::string(test::kFindClashes) + R"(
      const table = document.getElementById('figures-table').parentNode;
      if (table.scrollWidth > table.clientWidth) clashes += 'the table is cut; ';
      parent.postMessage(`${innerWidth} px: ${clashes}none else`, '*');)";
    EXPECT_EQ(browser_.PostedInFrame(PageOf(results), width, script),
              fmt::format("{} px: none else", width));
  }
}

TEST_F(BrowserTest, ShowsAgentsOfSeveralSeedsOnAPageThatFitsAPhone) {
  const std::vector<double> some{0.2, 0.4, 0.6, 0.8, 0.9, 0.5};
  const std::vector<Result> results =
      Read({{"a", testing::MakeEvaluation(some)},
            {"b", testing::MakeEvaluation(std::vector<double>(6, 0.5))},
            {"c", testing::MakeEvaluation(std::vector<double>(6, 0.7))}});
  const std::vector<AgentResults> agents{{"a-policy-with-quite-a-long-name", {0, 1}},
                                         {"<b>c</b>", {2}}};
  const Comparison comparison = CompareResults(results, agents);
  const std::string page = ReportPage(comparison);
  const std::string dom = Render(page);
  EXPECT_THAT(dom, HasSubstr("data-ready=\"true\""));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_EQ(Count(dom, "<b>"), 0);
  EXPECT_EQ(std::stod(Attribute(dom, "data-difference=\"success_rate\"", "data-value")),
            comparison.groups[0].pairs[0].difference().value);
  EXPECT_THAT(dom, HasSubstr("2 seeds, 60 episodes"));
  for (const int width : {390, 1280}) {
    const std::string script = std::string(test::kFindClashes) +
                               "parent.postMessage(`${innerWidth} px: ${clashes}none else`, '*');";
    EXPECT_EQ(browser_.PostedInFrame(page, width, script), fmt::format("{} px: none else", width));
  }
}

TEST_F(BrowserTest, ShowsTheSettingsInWhichAgentsDifferAndNoSectionIfNoneDoes) {
  std::vector<Result> results = Read(
      {{"a", testing::MakeEvaluation({0.5, 0.5})}, {"b", testing::MakeEvaluation({0.7, 0.5})}});
  EXPECT_THAT(Render(PageOf(results)), HasSubstr("<a href=\"#settings\" hidden"));
  results[0].settings = {{"dwa.speed", "0.5"}, {"dwa.name", "\"x\""}};
  results[1].settings = {{"dwa.speed", "\"<i>2\""}, {"dwa.name", "\"x\""}};
  const std::string dom = Render(PageOf(results));
  EXPECT_EQ(Count(dom, "data-setting="), 1);
  EXPECT_EQ(Attribute(dom, "data-setting=", "data-setting"), "dwa.speed");
  EXPECT_THAT(dom, HasSubstr("Settings in which the planners differ"));
  EXPECT_THAT(dom, HasSubstr("<code>\"&lt;i&gt;2\"</code>"));
  EXPECT_THAT(dom, Not(HasSubstr("<a href=\"#settings\" hidden")));
}

TEST_F(BrowserTest, ShowsSuccessByRandomisedField) {
  sim::EnvironmentConfig task;
  task.randomize = {{"lidar.offset_x", {"[-0.1, 0.1]", ""}},
                    {"robot.friction", {"['cone', 'gazebo']", ""}}};
  const std::vector<Result> results = Read({{"a", testing::DriveCourses(3, task)}});
  const std::string dom = Render(PageOf(results));
  EXPECT_THAT(dom, HasSubstr("<div id=\"errors\" hidden=\"\"></div>"));
  EXPECT_THAT(dom, Not(HasSubstr("<a href=\"#drawn\" hidden")));
  EXPECT_EQ(Count(dom, "data-drawn-field=\"lidar.offset_x\""), 1) << "of 6 episodes";
  EXPECT_EQ(Count(dom, "data-drawn-field=\"robot.friction\""), 2);
  EXPECT_EQ(Count(dom, "<td>gazebo</td>"), 1);
  EXPECT_EQ(Count(dom, " of 6</span>"), 1);
}

TEST_F(BrowserTest, WarnsOfAPolicyThatWasTrainedOnItsTest) {
  std::vector<Result> results = Read({{"td3", testing::MakeEvaluation({0.5, 0.5})}});
  results[0].training_overlap = TrainingOverlap{1, 2, "<i>static-train</i>"};
  const std::string dom = Render(PageOf(results));
  EXPECT_EQ(Attribute(dom, "data-overlap=", "data-overlap"), "1");
  EXPECT_THAT(dom, HasSubstr("td3 was trained on 1 of these 2 courses of made"));
  EXPECT_THAT(dom, HasSubstr("&lt;i&gt;static-train&lt;/i&gt;"));
  results[0].training_overlap = TrainingOverlap{0, 2, "static-train"};
  EXPECT_EQ(Count(Render(PageOf(results)), "data-overlap="), 0);
}

TEST_F(BrowserTest, SaysOnThePageWhatWentWrong) {
  std::string page = PageOf(Read({{"dwa", testing::MakeEvaluation({0.5})}}));
  const std::string mark = "\"circles\":[";
  page.replace(page.find(mark), mark.size(), "\"circles\":7,\"x\":[");
  const std::string dom = Render(page);
  EXPECT_THAT(dom, Not(HasSubstr("data-ready=\"true\"")));
  EXPECT_THAT(dom, Not(HasSubstr("<div id=\"errors\" hidden=\"\"></div>")));
}

}  // namespace
}  // namespace slalom::eval
