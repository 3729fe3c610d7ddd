#include "eval/service/evaluator_service.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/result.h"
#include "env/action.h"
#include "metrics/catalogue.h"
#include "tests/actor/one_policy.h"
#include "tests/support/fake_environment.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/wait_until.h"

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

/// Policies whose text has "drive" in it drive ahead, all others stand, and one is none.
base::Result<MakeAgent> Read(std::span<const std::byte> policy) {
  const std::string text(reinterpret_cast<const char*>(policy.data()), policy.size());
  if (text == "damaged") return base::Failure{"it is damaged"};
  const bool drives = text.find("drive") != std::string::npos;
  return MakeAgent([drives](const sim::CourseEnvironments& environments) {
    const env::Action action = environments.config().action.Normalise(drives ? 1.5 : 0.0, 0.0);
    return std::make_unique<slalom::testing::ConstantAgent>(action);
  });
}

class EvaluatorServiceTest : public ::testing::Test {
 protected:
  /// An evaluator that runs in a thread.
  class Running {
   public:
    Running(const EvaluatorServiceTest& test, double interval)
        : thread_([this, &test, interval](const std::stop_token& stop) {
            transport::Context context;
            base::ParallelFor parallel(1);
            EvaluatorServiceConfig config;
            config.interval = interval;
            try {
              EvaluatorService service(config, Task(),
                                       {.name = "e",
                                        .state_directory = test.scratch_.path(),
                                        .spec_hash = 1,
                                        .course_set = "open",
                                        .replay = {.endpoint = "ipc://@slalom-nobody-replay"},
                                        .learner = {.endpoint = test.learner_.endpoint()}},
                                       Read, parallel, context, registry_);
              service.Run(stop);
            } catch (const base::Error& error) {
              error_ = error.what();
            }
          }) {}

    double count(const metrics::Spec& metric) { return registry_.counter(metric).value(); }
    void Await(const metrics::Spec& metric, double count) {
      test::WaitUntil([&] { return this->count(metric) >= count; });
    }
    /// Waits until `num` policies are scored, and the figures are those of the last.
    void AwaitScore(double num, std::int64_t version, bool drives) {
      Await(metrics::kEvaluations, num);
      const auto success_rate = registry_.gauge(metrics::kEvaluationSuccessRate, {"open"});
      const auto scored = registry_.gauge(metrics::kEvaluationVersion);
      test::WaitUntil([&] {
        return scored.value() == static_cast<double>(version) &&
               success_rate.value() == (drives ? 1.0 : 0.0);
      });
    }
    std::string Error() {
      thread_.join();
      return error_;
    }

   private:
    metrics::Registry registry_{"evaluator", "e"};
    std::string error_;
    std::jthread thread_;
  };

  /// Runs an evaluator that scores each of the policies, as the versions from `version` on.
  void Score(std::int64_t version, const std::vector<std::string>& policies) {
    learner_.Publish(version, policies[0]);
    Running evaluator(*this, 0.0);
    for (std::size_t i = 0; i < policies.size(); ++i) {
      if (i > 0) learner_.Publish(++version, policies[i]);
      evaluator.AwaitScore(static_cast<double>(i + 1), version,
                           policies[i].find("drive") != std::string::npos);
    }
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
  std::filesystem::remove(scratch_.path() / "best.safetensors");
  Score(14, {"stands"});
  EXPECT_EQ(Kept(), "1100001");
  EXPECT_EQ(Best(), "stands");
}

TEST_F(EvaluatorServiceTest, OneThatCannotBeReadIsPassedOverUnlessItIsTheFirst) {
  learner_.Publish(8, "damaged");
  EXPECT_NE(Running(*this, 0.0).Error().find("policy 8 of the learner"), std::string::npos);
  learner_.Publish(9, "stands");
  Running evaluator(*this, 0.0);
  evaluator.AwaitScore(1, 9, false);
  learner_.Publish(10, "damaged");
  evaluator.Await(metrics::kPoliciesRejected, 1);
  learner_.Publish(11, "drives");
  evaluator.AwaitScore(2, 11, true);
  EXPECT_EQ(evaluator.count(metrics::kPoliciesRejected), 1) << "once";
}

TEST_F(EvaluatorServiceTest, ScoresNoneBeforeTheIntervalHasPassed) {
  Running evaluator(*this, 1e6);
  evaluator.AwaitScore(1, 7, false);
  for (std::int64_t version = 8; version < 11; ++version) {
    learner_.Publish(version, "drives");
    evaluator.Await(metrics::kPoliciesReceived, static_cast<double>(version - 6));
  }
  EXPECT_EQ(evaluator.count(metrics::kEvaluations), 1);
}

}  // namespace
}  // namespace slalom::eval
