#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/service_status.h"
#include "app/cli/status_table.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "proto/messages.h"
#include "proto/replay_link.h"
#include "proto/transport/context.h"
#include "proto/transport/security.h"

namespace slalom::cli {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

proto::StatusReply AskStatus(const train::RunConfig& config, milliseconds patience) {
  transport::Context context;
  proto::Hello hello;
  hello.role = "operator";
  hello.name = config.service.name.empty() ? "status" : config.service.name;
  hello.spec_hash = train::SpecHash(config);
  hello.num_beams = config.environment.lidar.num_beams;
  const std::string& endpoint = config.service.replay;
  service::ReplayLink link(
      context,
      {.endpoint = endpoint,
       .security = transport::MakeClientSecurity(config.security, transport::Role::kOperator,
                                                 transport::Role::kReplay, endpoint)},
      hello);
  const auto give_up = steady_clock::now() + patience;
  bool asked = false;
  while (steady_clock::now() < give_up) {
    auto received = link.Receive(milliseconds(50));
    if (link.welcomed() && !asked) asked = link.Send(proto::StatusRequest{});
    if (!received) continue;
    if (auto* status = std::get_if<proto::StatusReply>(&received->header)) return *status;
  }
  const std::string trouble = link.trouble();
  throw base::Error(
      "no replay server answers at {}{}{}; actors and the learner wait for it and say so in their "
      "logs, and `slalom watch {}` shows the learner's curves meanwhile",
      endpoint, trouble.empty() ? "" : ": ", trouble,
      (std::filesystem::path(config.service.state) / "learner").string());
}

namespace {

constexpr std::chrono::seconds kPatience{5};

struct StatusOptions {
  std::optional<std::string> config;
  std::vector<std::string> overrides;
  bool json = false;
};

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
  fmt::print("{}\n", nlohmann::json{{"roles", roles}, {"omitted", status.omitted}}.dump(1));
}

void Status(const StatusOptions& options) {
  const auto config = config::Load<train::RunConfig>(options.config, options.overrides);
  const proto::StatusReply status = AskStatus(config, kPatience);
  if (options.json) return PrintJson(status);
  fmt::print("{}", FormatStatus(status));
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
