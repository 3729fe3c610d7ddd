#include "eval/service/evaluator_service.h"

#include <gtest/gtest.h>

#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/file.h"
#include "env/action.h"
#include "metrics/catalogue.h"
#include "tests/actor/one_policy.h"
#include "tests/support/fake_environment.h"
#include "tests/support/scratch_directory.h"

/// The evaluator as a process would be, against a learner of a few lines.

namespace slalom::eval {
namespace {

/// An open field, on which a robot that drives ahead reaches the goal.
EvaluationTask Task() {
  sim::Course course;
  course.name = "open";
  course.goal_W = {2.0, 0.0};
  EvaluationConfig config;
  config.episodes_per_course = 2;
  config.time_limit = 3.0;
  return ResolveEvaluation(config, {},
                           {"open", {std::make_shared<const sim::Course>(std::move(course))}});
}

/// Policies whose text has "drive" in it drive ahead, all others stand.
base::Result<MakeAgent> Read(std::span<const std::byte> policy) {
  const std::string text(reinterpret_cast<const char*>(policy.data()), policy.size());
  const bool drives = text.find("drive") != std::string::npos;
  return MakeAgent([drives](const sim::CourseEnvironments& environments) {
    const env::Action action = environments.config().action.Normalise(drives ? 1.5 : 0.0, 0.0);
    return std::make_unique<slalom::testing::ConstantAgent>(action);
  });
}

class EvaluatorServiceTest : public ::testing::Test {
 protected:
  /// Runs an evaluator that scores each of the policies, as the versions from `version` on.
  void Score(std::int64_t version, const std::vector<std::string>& policies) {
    learner_.Publish(version, policies[0]);
    metrics::Registry registry("evaluator", "e");
    auto evaluations = registry.counter(metrics::kEvaluations);
    std::jthread thread([&](const std::stop_token& stop) {
      transport::Context context;
      base::ParallelFor parallel(1);
      EvaluatorService service({}, Task(),
                               {.name = "e",
                                .state_directory = scratch_.path(),
                                .spec_hash = 1,
                                .course_set = "open",
                                .replay = {.endpoint = "ipc://@slalom-nobody-replay"},
                                .learner = {.endpoint = learner_.endpoint()}},
                               Read, parallel, context, registry);
      service.Run(stop);
    });
    for (std::size_t i = 0; i < policies.size(); ++i) {
      if (i > 0) learner_.Publish(version + static_cast<std::int64_t>(i), policies[i]);
      while (evaluations.value() < static_cast<double>(i + 1)) std::this_thread::yield();
    }
    thread.request_stop();
    thread.join();
    const std::int64_t last = version + static_cast<std::int64_t>(policies.size()) - 1;
    EXPECT_EQ(registry.gauge(metrics::kEvaluationVersion).value(), static_cast<double>(last));
    const bool drives = policies.back().find("drive") != std::string::npos;
    EXPECT_EQ(registry.gauge(metrics::kEvaluationSuccessRate, {"open"}).value(),
              drives ? 1.0 : 0.0);
  }

  /// The last cell of each line of scores.csv: whether the policy was kept.
  std::string Kept() const {
    std::istringstream lines(base::ReadFile(scratch_.path() / "scores.csv"));
    std::string kept, line;
    std::getline(lines, line);
    while (std::getline(lines, line)) kept += line.back();
    return kept;
  }
  std::string Best() const { return base::ReadFile(scratch_.path() / "best.safetensors"); }

  const test::ScratchDirectory scratch_;
  actor::OnePolicy learner_;
};

TEST_F(EvaluatorServiceTest, KeepsTheBestPolicyOfAllAlsoOverARestart) {
  Score(8, {"stands", "drives", "stands again", "drives too"});
  EXPECT_EQ(Kept(), "1100");
  EXPECT_EQ(Best(), "drives");
  Score(12, {"stands at last", "drives at last"});
  EXPECT_EQ(Kept(), "110000");
  EXPECT_EQ(Best(), "drives");
}

}  // namespace
}  // namespace slalom::eval
