#include "app/train/run_identity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <sstream>
#include <string>

#include "app/train/agent_run_config.h"
#include "base/config.h"
#include "base/file.h"

namespace slalom::train {
namespace {

constexpr char kFile[] = "tests/app/train/deciding_defaults.txt";

/// The keys on which the result of a training, a score or a planner depends, with their defaults.
std::map<std::string, std::string> DecidingDefaults() {
  std::map<std::string, std::string> defaults;
  RunConfig run;
  for (const config::Field& field : config::ListFields(run).fields) {
    const bool counts = DecidesRun(run, field.key) || field.key.starts_with("evaluation.") ||
                        field.key.starts_with("guard.");
    if (counts) defaults["training " + field.key] = config::PrintValue(field);
  }
  AgentRunConfig planner;
  for (const config::Field& field : config::ListFields(planner).fields) {
    defaults["planner " + field.key] = config::PrintValue(field);
  }
  return defaults;
}

TEST(RunIdentityTest, NoDefaultChangesWithoutTheVersionOfTheNumerics) {
  std::map<std::string, std::string> recorded;
  std::istringstream file(base::ReadFile(std::filesystem::path(SLALOM_SOURCE_DIR) / kFile));
  for (std::string line; std::getline(file, line);) {
    const std::size_t equals = line.find(" = ");
    if (equals != std::string::npos) recorded[line.substr(0, equals)] = line.substr(equals + 3);
  }
  const std::string version = recorded["numerics"];
  recorded.erase("numerics");
  const bool is_raised = version != std::to_string(kNumericsVersion);
  for (const auto& [key, value] : DecidingDefaults()) {
    const auto was = recorded.find(key);
    if (was == recorded.end()) {
      ADD_FAILURE() << "a new key; add this line to " << kFile << ":\n" << key << " = " << value;
      continue;
    }
    EXPECT_EQ(value, was->second)
        << "the default of " << key << " has changed. Identities leave it out, so finished cells "
        << "would pass for trainings with the new one. "
        << (is_raised ? "Put it into "
                      : "Raise kNumericsVersion (app/train/run_identity.h), then "
                        "put it and the version into ")
        << kFile;
    recorded.erase(was);
  }
  for (const auto& [key, value] : recorded) {
    ADD_FAILURE() << key << " is gone; remove its line from " << kFile;
  }
  EXPECT_FALSE(is_raised) << "kNumericsVersion is " << kNumericsVersion << "; put it into the line "
                          << "`numerics` of " << kFile;
}

TEST(RunIdentityTest, ADigestIsOfTheKeysThatDecideAndAreNotAtTheirDefaults) {
  RunConfig config;
  EXPECT_EQ(RunDigest(config), Digest(""));
  config.run.log_interval = 99.0;
  config.replay_server.priority_exponent = 0.9;
  EXPECT_EQ(RunDigest(config), Digest("")) << "they decide nothing";
  config.method.learner.tau = 0.25;
  config.actor.num_environments = 3;
  EXPECT_EQ(RunDigest(config), Digest("actor.num_environments = 3\nlearner.tau = 0.25\n"));
}

TEST(RunIdentityTest, ProcessesOfAServiceAgreeOnWhatIsDrivenObservedAndRewarded) {
  RunConfig config;
  EXPECT_TRUE(ServiceIdentity(config).empty());
  config.actor.noise_max = 0.3;
  config.courses.collection = "/home/ada/barn";
  config.method.learner.actor_learning_rate = 0.5;
  EXPECT_TRUE(ServiceIdentity(config).empty()) << "each process may have its own";
  config.run.seed = 7;
  config.run.name = "mine";
  config.network.sectors = 72;
  config.method.learner.algorithm = "sac";
  config.courses.train = "dynamic-box";
  config.environment.reward.collision = -3.0;
  config.environment.randomize = {{"robot.command_delay", {"[0.0, 0.12]", ""}},
                                  {"robot.friction", {"['cone', 'gazebo']", ""}}};
  const proto::RunIdentity expected = {
      {"courses.train", "\"dynamic-box\""},
      {"environment.randomize.robot.command_delay", "[0.0, 0.12]"},
      {"environment.randomize.robot.friction", "[\"cone\", \"gazebo\"]"},
      {"environment.reward.collision", "-3.0"},
      {"learner.algorithm", "\"sac\""},
      {"network.sectors", "72"},
      {"run.name", "\"mine\""},
      {"run.seed", "7"}};
  EXPECT_EQ(ServiceIdentity(config), expected);
  config.courses.train = std::string(500, 'x');
  EXPECT_THAT(ServiceIdentity(config).at("courses.train"),
              ::testing::StartsWith("a text with digest "));
}

}  // namespace
}  // namespace slalom::train
