#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/cli/commands.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "base/progress.h"
#include "proto/messages.h"
#include "proto/replay_link.h"
#include "proto/transport/context.h"
#include "proto/transport/security.h"

namespace slalom::cli {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr std::chrono::seconds kPatience{5};

struct StatusOptions {
  std::optional<std::string> config;
  std::vector<std::string> overrides;
  bool json = false;
};

proto::StatusReply AskStatus(const train::RunConfig& config) {
  transport::Context context;
  proto::Hello hello;
  hello.role = "operator";
  hello.name = "status";
  hello.spec_hash = train::SpecHash(config);
  hello.num_beams = config.environment.lidar.num_beams;
  const std::string& endpoint = config.service.replay;
  service::ReplayLink link(
      context,
      {.endpoint = endpoint,
       .security = transport::MakeClientSecurity(config.security, transport::Role::kOperator,
                                                 transport::Role::kReplay, endpoint)},
      hello);
  const auto give_up = steady_clock::now() + kPatience;
  bool asked = false;
  while (steady_clock::now() < give_up) {
    auto received = link.Receive(milliseconds(50));
    if (link.welcomed() && !asked) asked = link.Send(proto::StatusRequest{});
    if (!received) continue;
    if (auto* status = std::get_if<proto::StatusReply>(&received->header)) return *status;
  }
  const std::string trouble = link.trouble();
  throw base::Error(fmt::format("no replay server answers at {}{}{}", endpoint,
                                trouble.empty() ? "" : ": ", trouble));
}

/// "1.2M", "0.93", "-": a number for people.
std::string Figure(const proto::Report& report, const std::string& key) {
  const auto it = report.figures.find(key);
  if (it == report.figures.end() || std::isnan(it->second)) return "-";
  const double value = it->second;
  return std::abs(value) >= 1000.0 || value == std::floor(value) ? base::FormatCount(value)
                                                                 : fmt::format("{:.3g}", value);
}

void PrintTable(const proto::StatusReply& status, const std::string& role, const std::string& title,
                const std::vector<std::pair<std::string, std::string>>& columns) {
  bool head = true;
  for (const proto::RoleStatus& entry : status.roles) {
    if (entry.report.role != role) continue;
    if (head) {
      fmt::print("{:<24}", title);
      for (const auto& [name, key] : columns) fmt::print(" {:>13}", name);
      fmt::print("  {}\n", "heard of");
      head = false;
    }
    fmt::print("{:<24}", entry.report.name);
    for (const auto& [name, key] : columns) fmt::print(" {:>13}", Figure(entry.report, key));
    fmt::print("  {}\n", entry.connected ? fmt::format("{:.0f} s ago", entry.age_s)
                                         : fmt::format("GONE, {:.0f} s ago", entry.age_s));
  }
  if (!head) fmt::print("\n");
}

void PrintJson(const proto::StatusReply& status) {
  nlohmann::json roles = nlohmann::json::array();
  for (const proto::RoleStatus& entry : status.roles) {
    nlohmann::json figures = nlohmann::json::object();
    for (const auto& [key, value] : entry.report.figures) figures[key] = value;
    roles.push_back({{"role", entry.report.role},
                     {"name", entry.report.name},
                     {"age_s", entry.age_s},
                     {"connected", entry.connected},
                     {"figures", figures},
                     {"facts", entry.report.facts}});
  }
  fmt::print("{}\n", nlohmann::json{{"roles", roles}}.dump(1));
}

void Status(const StatusOptions& options) {
  const auto config = config::Load<train::RunConfig>(options.config, options.overrides);
  const proto::StatusReply status = AskStatus(config);
  if (options.json) return PrintJson(status);
  if (status.roles.empty()) {
    fmt::print(
        "the replay server answers, but no process has reported yet; ask again in a few "
        "seconds\n");
  }
  PrintTable(status, "replay", "replay server",
             {{"steps", "steps"},
              {"steps/s", "steps_per_s"},
              {"in table", "table_steps"},
              {"batches/s", "batches_per_s"},
              {"held chunks", "held_chunks"},
              {"held samples", "held_samples"},
              {"sessions", "sessions"}});
  PrintTable(status, "learner", "learner",
             {{"updates", "updates"},
              {"updates/s", "updates_per_s"},
              {"policy", "policy_version"},
              {"policy lag", "policy_lag"},
              {"readers", "readers"},
              {"mean Q", "q_mean"}});
  PrintTable(status, "actor", "actor",
             {{"steps made", "steps_made"},
              {"steps/s", "steps_per_s"},
              {"pending", "steps_pending"},
              {"lost", "steps_lost"},
              {"policy", "policy_version"},
              {"episodes", "episodes"},
              {"success", "success_rate"}});
  PrintTable(status, "evaluator", "evaluator",
             {{"evaluations", "evaluations"},
              {"newest policy", "policy_version"},
              {"scored policy", "scored_version"},
              {"success", "success_rate"}});
}

}  // namespace

void AddStatusCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("status", "Show the processes of a running service");
  auto options = std::make_shared<StatusOptions>();
  command->add_option("--config", options->config, "The service's TOML file")->required();
  command->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  command->add_flag("--json", options->json, "Print everything that the processes report, as JSON");
  command->callback([options] { Status(*options); });
}

}  // namespace slalom::cli
