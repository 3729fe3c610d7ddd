#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "app/cli/commands.h"
#include "base/error.h"
#include "proto/transport/keys.h"

namespace slalom::cli {
namespace {

void AddNew(CLI::App& keys) {
  CLI::App* command = keys.add_subcommand(
      "new", "Make a directory with a new key of each role and the list of who may connect");
  auto directory = std::make_shared<std::string>();
  command->add_option("DIR", *directory, "Directory to write; it is made if it does not exist")
      ->required();
  command->callback([directory] {
    transport::WriteNewKeys(*directory);
    fmt::print(
        "{}: new keys of all roles, and the list of who may connect\n"
        "Each machine needs the .key files of its own roles, which nobody else should see, and "
        "replay.pub and\nlearner.pub; those that run the replay server or the learner need "
        "'allowed', too.\n",
        *directory);
  });
}

void AddCheck(CLI::App& keys) {
  CLI::App* command =
      keys.add_subcommand("check", "Say which keys a directory holds, and what is wrong with them");
  auto directory = std::make_shared<std::string>();
  command->add_option("DIR", *directory, "Directory, as `slalom keys new` makes it")->required();
  command->callback([directory] {
    const transport::KeysReport report = transport::CheckKeys(*directory);
    for (const std::string& line : report.found) fmt::print("{}\n", line);
    if (report.faults.empty()) return;
    std::string faults;
    for (const std::string& fault : report.faults) faults += "\n  " + fault;
    throw base::Error("{}: {} wrong:{}", *directory,
                      report.faults.size() == 1
                          ? "1 thing is"
                          : fmt::format("{} things are", report.faults.size()),
                      faults);
  });
}

}  // namespace

void AddKeysCommand(CLI::App& app) {
  CLI::App* keys =
      app.add_subcommand("keys", "Keys of the distributed service: make and check them");
  keys->require_subcommand(1);
  AddNew(*keys);
  AddCheck(*keys);
  keys->footer("docs/operations.md, section Keys, says which machine needs which of them.");
}

}  // namespace slalom::cli
