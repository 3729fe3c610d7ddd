#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>
#include <utility>

#include "app/cli/commands.h"
#include "app/train/command_options.h"
#include "app/train/line_driver.h"
#include "app/train/run_config.h"
#include "base/error.h"
#include "env/state_layout.h"
#include "planners/planner_registry.h"
#include "policy/policy_agent.h"

namespace slalom::cli {
namespace {

void Act(const train::LineDriverOptions& options) {
  train::LineDriver driver(
      options, [](policy::PolicySnapshot policy, const train::RunConfig& config) {
        return policy::MakePolicyAgent(std::move(policy), config.mpc, train::SeedOf(config, "act"));
      });
  std::string line;
  for (std::int64_t number = 1; std::getline(std::cin, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    try {
      fmt::print("{}\n", driver.Answer(line));
    } catch (const base::Error& error) {
      throw base::Error(fmt::format("standard input: line {}: {}", number, error.what()));
    }
    if (std::fflush(stdout) != 0) throw base::Error("standard output: nobody reads it any more");
  }
}

}  // namespace

void AddActCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "act", "Drive a robot: reads what it senses as JSON lines, writes its commands");
  auto options = std::make_shared<train::LineDriverOptions>();
  CLI::Option_group* driver = command->add_option_group("driver", "Who drives");
  driver->add_option(train::kPolicyOption, options->policy, "Policy file (.safetensors)")
      ->check(CLI::ExistingFile);
  driver->add_option(train::kAgentOption, options->planner,
                     fmt::format("Classical planner (docs/planners.md): {}",
                                 fmt::join(planners::PlannerNames(), ", ")));
  driver->add_flag("--check")->description("Somebody else: check the \"command\" of each line");
  driver->require_option(1);
  command
      ->add_option(
          "--profile", options->profiles,
          "Lay [guard] and [environment], the robot that is guarded, of this TOML file over "
          "those of the training or planner (repeatable), for example configs/guarded.toml")
      ->type_name("FILE");
  command
      ->add_option("--set", options->overrides,
                   "Override a key of [guard], [environment] or the planner: section.key=value "
                   "(repeatable)")
      ->type_name("KEY=VALUE");
  std::string more;
  for (const env::StateField& field : env::kStateFields) {
    if (field.source != env::StateSource::kSensors || field.num_items({}) > 0) continue;
    more += fmt::format(", \"{}\": [{}]", field.name, field.unit);
  }
  command->footer(
      "Each line of standard input is one step, and is answered by a line (docs/robot.md):\n\n"
      "  {\"ranges\": [2.31, null, ...], \"goal\": [3.0, 0.5]}      metres; null: no echo\n"
      "  {\"action\":[0.7,-0.1],\"angular\":-0.31,\"linear\":1.55}     m/s, rad/s\n\n"
      "NaN and Infinity are no echo, too. 0 is an obstacle at the sensor, unless \"no_echo\": 0 "
      "says\nthat the sensor means no echo by it.\n\n"
      "\"first\": true begins an episode. \"last_action\": [a, b] is for a robot that did not do\n"
      "what it was told. A policy may need more" +
      more +
      ".\n\n"
      "A guard (--profile, --set; docs/safety.md) needs \"pose\": [m, m, rad], in any frame that\n"
      "stays where it is, and \"speeds\". It answers whether it changed the action: "
      "\"guarded\":false. With guard.scan_matching=true it says where the robot is: \"pose\".\n\n"
      "A planner needs these two keys as well. --check is a guard alone: a line has\n"
      "\"command\": [m/s, rad/s], \"pose\" and \"speeds\" in place of a goal.\n");
  command->callback([options] { Act(*options); });
}

}  // namespace slalom::cli
