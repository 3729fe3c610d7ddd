#include "app/train/training_figure.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

namespace slalom::train {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const std::string kMetrics =
    "training_s,steps,success_rate,collision_rate,timeout_rate,episode_return,policy_entropy_nats\n"
    "10,1000,,,,,\n"
    "50,5000,0.5,0.5,0,-20,\n"
    "100,10000,0.9,0.1,0,30,\n";
const std::string kCurve =
    "training_s,steps,updates,success_rate,success_low,success_high,collision_rate,timeout_rate,"
    "traversal_time_s\n"
    "50,5000,10,0.4,0.2,0.6,0.6,0,\n"
    "100,10000,20,0.95,0.9,0.98,0.05,0,9.5\n";

TEST(TrainingFigureTest, ShowsEpisodesReturnAndScoresOverSecondsAndSteps) {
  const std::string svg = DrawTrainingFigure("my-run", kMetrics, kCurve);
  for (const char* text : {">my-run<", ">Training episodes, with exploration noise<",
                           ">success 90.0 %<", ">Return of training episodes<", ">mean return 30<",
                           ">Scores on the test courses, with 95 % intervals<", ">success 95.0 %<",
                           ">training time [s]<", ">steps<", ">10k<"}) {
    EXPECT_THAT(svg, HasSubstr(text));
  }
  // The first panel's success: 0.5 at half of the time, 0.9 at its end; y from 250 to 100.
  EXPECT_THAT(svg, HasSubstr("class=\"line green\" d=\"M337.0 175.0L610.0 115.0\""));
}

TEST(TrainingFigureTest, WithoutScoresHasNoPanelForThem) {
  EXPECT_THAT(DrawTrainingFigure("r", kMetrics, ""), Not(HasSubstr("Scores")));
}

TEST(TrainingFigureTest, LeavesOutWhatCannotBeRead) {
  // A cell that is no number, a row cut short, a last line still being written, no such column.
  const std::string svg = DrawTrainingFigure(
      "r", "training_s,success_rate\n10,0.5\n20,oops\n30\nx,0.5\n40,1.0\n50,0.7", "");
  EXPECT_THAT(svg, HasSubstr("d=\"M200.5 155.0L610.0 80.0\""));  // 10 and 40 of 40 s.
  EXPECT_THAT(svg, Not(HasSubstr("Return")));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(DrawTrainingFigure("r", "", ""), HasSubstr("No episode has ended yet."));
}

TEST(TrainingFigureTest, ALongRunsPictureStaysSmallAndEndsWithItsLastRow) {
  std::string metrics = "training_s,steps,success_rate\n";
  for (int i = 1; i <= 100'000; ++i) metrics += fmt::format("{},{},0.25\n", i, 10 * i);
  metrics += "100001,1000010,0.75\n";
  const std::string svg = DrawTrainingFigure("r", metrics, "");
  EXPECT_LT(svg.size(), 40'000u);
  EXPECT_THAT(svg, HasSubstr(">success 75.0 %<"));
}

}  // namespace
}  // namespace slalom::train
