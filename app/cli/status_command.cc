#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <variant>
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

namespace {

constexpr milliseconds kLook{50};

}  // namespace

proto::StatusReply AskStatus(const train::RunConfig& config, milliseconds patience) {
  transport::Context context;
  proto::Hello hello;
  hello.role = "operator";
  hello.name = config.service.name.empty() ? "status" : config.service.name;
  hello.spec_hash = train::SpecHash(config);
  hello.num_beams = config.environment.lidar.num_beams;
  std::vector<std::unique_ptr<service::ReplayLink>> links;
  for (const std::string& endpoint : config.service.replay) {
    links.push_back(std::make_unique<service::ReplayLink>(
        context,
        transport::ClientOptions{
            .endpoint = endpoint,
            .security = transport::MakeClientSecurity(config.security, transport::Role::kOperator,
                                                      transport::Role::kReplay, endpoint)},
        hello));
  }
  std::vector<proto::StatusReply> answers;
  const auto give_up = steady_clock::now() + patience;
  for (std::vector<bool> asked(links.size()); steady_clock::now() < give_up;) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      if (links[i] == nullptr) continue;
      auto received = links[i]->Receive(kLook / static_cast<int>(links.size()));
      if (links[i]->welcomed() && !asked[i]) asked[i] = links[i]->Send(proto::StatusRequest{});
      if (!received) continue;
      auto* const status = std::get_if<proto::StatusReply>(&received->header);
      if (status == nullptr) continue;
      answers.push_back(std::move(*status));
      links[i].reset();
    }
    if (answers.size() == links.size()) return proto::Merge(std::move(answers));
  }
  if (answers.empty()) {
    const std::string trouble = links.front()->trouble();
    throw base::Error(
        "no replay server answers at {}{}{}; actors and the learner wait for it and say so in "
        "their logs, and `slalom watch {}` shows the learner's curves meanwhile",
        fmt::join(config.service.replay, ", "), trouble.empty() ? "" : ": ", trouble,
        (std::filesystem::path(config.service.state) / "learner").string());
  }
  proto::StatusReply merged = proto::Merge(std::move(answers));
  for (const auto& link : links) {
    if (link == nullptr) continue;
    proto::RoleStatus silent{.report = {}, .age_s = 1e-3 * static_cast<double>(patience.count())};
    silent.report.role = "replay";
    silent.report.name = link->endpoint();
    merged.roles.push_back(std::move(silent));
  }
  return merged;
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
