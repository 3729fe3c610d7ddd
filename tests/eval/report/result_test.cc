#include "eval/report/result.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"
#include "tests/eval/report/made_evaluation.h"
#include "tests/support/scratch_directory.h"

namespace slalom::eval {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ResultTest : public ::testing::Test {
 protected:
  /// Writes an evaluation into a directory of this name.
  std::filesystem::path Write(const std::string& name, const EvaluationConfig& config = {}) {
    const auto directory = scratch_.path() / name;
    WriteReports(testing::MakeEvaluation({0.2, 0.5, 0.8}, config), testing::MakeProvenance(name),
                 directory);
    return directory;
  }

  /// The error for an evaluation.json changed by `change`.
  std::string ErrorAfter(const std::function<void(json&)>& change) {
    const auto file = Write("changed") / "evaluation.json";
    json object = json::parse(base::ReadFile(file));
    change(object);
    base::WriteFileAtomically(file, object.dump());
    return ErrorOf(file);
  }

  static std::string ErrorOf(const std::filesystem::path& path) {
    try {
      ReadResult(path);
    } catch (const base::Error& error) {
      return error.what();
    }
    return "no error";
  }

  test::ScratchDirectory scratch_;
};

TEST_F(ResultTest, ACompactTextHasTheSameEpisodesAndNoPath) {
  const std::string text = base::ReadFile(Write("full") / "evaluation.json");
  const std::string compact = CompactResult(text, "full");
  EXPECT_LT(compact.size(), text.size() / 2);
  EXPECT_EQ(CompactResult(compact, "compact"), compact);
  EXPECT_THAT(compact, ::testing::Not(HasSubstr("config")));
  json full = json::parse(text);
  const Result expected = ParseResult(text, "full").result;
  const Result read = ParseResult(compact, "compact").result;
  ASSERT_EQ(read.courses.size(), expected.courses.size());
  for (std::size_t c = 0; c < read.courses.size(); ++c) {
    EXPECT_EQ(read.courses[c].name, expected.courses[c].name);
    EXPECT_EQ(read.courses[c].optimal_time, expected.courses[c].optimal_time);
    ASSERT_EQ(read.courses[c].episodes.size(), expected.courses[c].episodes.size());
    for (std::size_t k = 0; k < read.courses[c].episodes.size(); ++k) {
      EXPECT_EQ(read.courses[c].episodes[k].outcome, expected.courses[c].episodes[k].outcome);
      EXPECT_EQ(read.courses[c].episodes[k].time, expected.courses[c].episodes[k].time);
      EXPECT_EQ(read.courses[c].episodes[k].num_collisions,
                expected.courses[c].episodes[k].num_collisions);
    }
  }
  // Where collisions do not end episodes, they are kept.
  full["courses"][1]["collisions_per_episode"][2] = 7;
  full["provenance"]["source"] = "/home/someone/policy.safetensors";
  const std::string many = CompactResult(full.dump(), "many");
  EXPECT_EQ(ParseResult(many, "many").result.courses[1].episodes[2].num_collisions, 7);
  EXPECT_THAT(many, ::testing::Not(HasSubstr("/home")));
}

TEST_F(ResultTest, HasTheSettingsOfItsConfig) {
  Provenance provenance = testing::MakeProvenance("dwa");
  provenance.config = "[run]\nseed = 7\n[learner.inner]\nlayers = [2, 3]\n";
  WriteReports(testing::MakeEvaluation({0.2, 0.5, 0.8}), provenance, scratch_.path() / "with");
  EXPECT_EQ(
      ReadResult(scratch_.path() / "with").settings,
      (std::map<std::string, std::string>{{"run.seed", "7"}, {"learner.inner.layers", "[2, 3]"}}));
  EXPECT_TRUE(ReadResult(Write("without")).settings.empty());
  EXPECT_THAT(ErrorAfter([](json& object) { object["provenance"]["config"] = "[run]\nseed = "; }),
              HasSubstr("evaluation.json: provenance.config:2: not valid TOML"));
  EXPECT_THAT(ErrorAfter([](json& object) { object["provenance"]["config"] = 7; }),
              HasSubstr("provenance.config is 7, expected a text"));
}

TEST_F(ResultTest, GivesBackWhatWasWritten) {
  const Evaluation evaluation = testing::MakeEvaluation({0.2, 0.5, 0.8});
  Provenance provenance = testing::MakeProvenance("dwa");
  provenance.profiles = {"configs/real-robot.toml"};
  provenance.collection = "barn";
  WriteReports(evaluation, provenance, scratch_.path());
  const Result result = ReadResult(scratch_.path());
  EXPECT_EQ(result.physics, "slalom");
  EXPECT_EQ(result.agent, "dwa");
  EXPECT_EQ(result.kind, "planner");
  EXPECT_EQ(result.profiles, provenance.profiles);
  EXPECT_EQ(result.collection, "barn");
  EXPECT_EQ(result.course_set, "made");
  EXPECT_EQ(result.commit, "abc123");
  EXPECT_EQ(result.step, 0.2);
  EXPECT_EQ(result.robot_length, 0.458);
  EXPECT_EQ(result.protocol.at("name"), "\"paper\"");
  EXPECT_TRUE(result.collision_ends());
  const Figures& set = evaluation.summary.set;
  EXPECT_EQ(result.set.num_episodes, 15);
  EXPECT_EQ(result.set.success_rate.value, set.success_rate.value);
  EXPECT_EQ(result.set.success_rate.interval, set.success_rate.interval);
  EXPECT_EQ(result.set.survival_time->value, set.survival_time->value);
  EXPECT_EQ(result.set.barn_score.value, set.barn_score.value);
  ASSERT_EQ(result.courses.size(), 3u);
  for (std::size_t k = 0; k < 15; ++k) {
    const EpisodeRecord& record = evaluation.episodes.records[k];
    const ResultEpisode& episode = result.courses[k / 5].episodes[k % 5];
    EXPECT_EQ(episode.outcome, record.outcome);
    EXPECT_EQ(episode.time, record.time(0.2));
    EXPECT_EQ(episode.num_collisions, record.num_collisions);
  }
  EXPECT_EQ(*result.course_set_data.courses[1], *evaluation.task.courses.courses[1]);
  EXPECT_EQ(result.tracks, evaluation.episodes.tracks);
}

TEST_F(ResultTest, WhatWasTrainedOnIsGivenBack) {
  Evaluation evaluation = testing::MakeEvaluation({0.2, 0.5, 0.8});
  evaluation.training_overlap = TrainingOverlap{2, 3, "static-train-250"};
  WriteReports(evaluation, testing::MakeProvenance("x"), scratch_.path());
  EXPECT_EQ(ReadResult(scratch_.path()).training_overlap, evaluation.training_overlap);
  EXPECT_THAT(TextReport(evaluation),
              AllOf(HasSubstr("warning: 2 of the 3 courses are among those that the policy was"),
                    HasSubstr("(static-train-250)")));
  evaluation.training_overlap->num_courses = 0;
  EXPECT_THAT(TextReport(evaluation), ::testing::Not(HasSubstr("warning")));

  const auto without = Write("without");
  EXPECT_EQ(ReadResult(without).training_overlap, std::nullopt);
  EXPECT_THAT(ErrorAfter([](json& changed) { changed["provenance"].erase("training_overlap"); }),
              HasSubstr("provenance.training_overlap is missing"));
  EXPECT_THAT(ErrorAfter([](json& changed) {
                changed["provenance"]["training_overlap"] = {{"courses", -1}, {"of", 3}};
              }),
              HasSubstr("provenance.training_overlap.courses is -1"));
}

TEST_F(ResultTest, WhatMovedTheRobotIsGivenBack) {
  Evaluation evaluation = testing::MakeEvaluation({0.2, 0.5});
  evaluation.task.physics.name = "ode";
  evaluation.task.physics.version = "0.16.2";
  WriteReports(evaluation, testing::MakeProvenance("x"), scratch_.path());
  EXPECT_EQ(ReadResult(scratch_.path()).physics, "ode");
  EXPECT_EQ(ReadResult(scratch_.path()).physics_version, "0.16.2");
  EXPECT_THAT(ErrorAfter([](json& changed) { changed.erase("physics"); }),
              HasSubstr("physics is missing"));
  EXPECT_THAT(ErrorAfter([](json& changed) { changed["physics"] = "ode"; }),
              HasSubstr("physics. is \"ode\", expected an object"));
}

TEST_F(ResultTest, TakesTheDirectoryOrTheFile) {
  const auto directory = Write("a");
  EXPECT_EQ(ReadResult(directory).file, (directory / "evaluation.json").string());
  EXPECT_EQ(ReadResult(directory / "evaluation.json").set.num_episodes, 15);
}

TEST_F(ResultTest, MissingFilesAreNamed) {
  EXPECT_THAT(ErrorOf(scratch_.path() / "none"), HasSubstr("none"));
  EXPECT_THAT(ErrorOf(scratch_.path()), HasSubstr("evaluation.json"));
  const auto directory = Write("a");
  std::filesystem::remove(directory / "evaluation-tracks.jsonl");
  EXPECT_THAT(ErrorOf(directory), HasSubstr("evaluation-tracks.jsonl"));
  std::filesystem::remove(directory / "evaluation.courses");
  EXPECT_THAT(ErrorOf(directory), HasSubstr("evaluation.courses"));
}

TEST_F(ResultTest, AFileCutShortIsSaidToBe) {
  const auto file = Write("cut") / "evaluation.json";
  const std::string text = base::ReadFile(file);
  for (const std::size_t size : {text.size() / 2, text.size() / 10, std::size_t{0}}) {
    base::WriteFileAtomically(file, text.substr(0, size));
    EXPECT_THAT(ErrorOf(file), AllOf(HasSubstr("cut/evaluation.json"), HasSubstr("not valid JSON"),
                                     HasSubstr("cut short")));
  }
}

TEST_F(ResultTest, ANumberBeyondWhatADoubleHoldsIsRefused) {
  const auto file = Write("large") / "evaluation.json";
  base::WriteFileAtomically(file, R"({"version": 1e999})");
  EXPECT_THAT(ErrorOf(file), AllOf(HasSubstr("large/evaluation.json"), HasSubstr("1e999")));
}

TEST_F(ResultTest, WhatIsNestedTooDeeplyIsRefused) {
  const auto file = Write("deep") / "evaluation.json";
  const std::string deep = std::string(400'000, '[') + std::string(400'000, ']');
  base::WriteFileAtomically(file, "{\"version\": " + deep + "}");
  EXPECT_THAT(ErrorOf(file), AllOf(HasSubstr("deep/evaluation.json"), HasSubstr("64 deep")));
}

TEST_F(ResultTest, OtherVersionsAndFormatsAreRefused) {
  EXPECT_THAT(ErrorAfter([](json& o) { o["version"] = kResultVersion + 1; }),
              AllOf(HasSubstr("evaluation.json: version is 3, expected 2"), HasSubstr("newer")));
  EXPECT_THAT(ErrorAfter([](json& o) { o.erase("format"); }), HasSubstr("format"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["format"] = "other"; }), HasSubstr("\"other\""));
  EXPECT_THAT(ErrorAfter([](json& o) {
                o = json::array({1, 2});
              }),
              HasSubstr("expected an object"));
}

TEST_F(ResultTest, BadValuesAreNamedByKey) {
  EXPECT_THAT(ErrorAfter([](json& o) { o.erase("success_rate"); }),
              HasSubstr("success_rate is missing"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["success_rate"] = 1.5; }),
              HasSubstr("success_rate is 1.5, expected a number from 0 to 1"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["timeout_rate_interval"] = {0.1}; }),
              HasSubstr("timeout_rate_interval is [0.1]"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][1]["times_s"][0] = "soon"; }),
              HasSubstr("a time is \"soon\""));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][1]["outcomes"][2] = "lost"; }),
              HasSubstr("an outcome is \"lost\", expected success, collision or timeout"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][2].erase("course"); }),
              HasSubstr("courses[2].course is missing"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"] = json::array(); }),
              HasSubstr("courses is [], expected at least one course"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][0]["times_s"].erase(0); }),
              HasSubstr("one for each outcome"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["run"]["step_s"] = 0; }), HasSubstr("run.step_s is 0"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["protocol"].erase("collision_ends"); }),
              HasSubstr("protocol.collision_ends is missing"));
}

TEST_F(ResultTest, PartsOfDifferentEvaluationsAreRefused) {
  EXPECT_THAT(ErrorAfter([](json& o) { o["successes"] = 2; }), HasSubstr("the file was changed"));
  EXPECT_THAT(ErrorAfter([](json& o) { o["courses"][0]["course"] = "other"; }),
              AllOf(HasSubstr("evaluation.courses"), HasSubstr("does not hold the 3 courses")));
  const auto directory = Write("mixed");
  base::WriteFileAtomically(directory / "evaluation-tracks.jsonl",
                            "{\"course\": \"elsewhere\", \"outcome\": \"success\", \"step_s\": "
                            "0.2, \"poses\": [[1, 2, 3]]}");
  EXPECT_THAT(ErrorOf(directory),
              AllOf(HasSubstr("evaluation-tracks.jsonl"), HasSubstr("elsewhere")));
}

TEST_F(ResultTest, MixedProtocolsAreRefusedNamingBothFilesAndTheDifference) {
  EvaluationConfig other;
  other.time_limit = 50.0;
  std::vector<Result> results{ReadResult(Write("a")), ReadResult(Write("b"))};
  EXPECT_NO_THROW(RequireSameProtocol(results));
  EXPECT_NO_THROW(RequireSameProtocol({}));
  results.push_back(ReadResult(Write("c", other)));
  try {
    RequireSameProtocol(results);
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("a/evaluation.json"), HasSubstr("c/evaluation.json"),
                      HasSubstr("time_limit_s of the protocol is 80.0 in the first and 50.0")));
  }
}

}  // namespace
}  // namespace slalom::eval
