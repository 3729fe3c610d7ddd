#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "app/cli/commands.h"
#include "app/cli/output.h"
#include "app/train/run_config.h"
#include "base/error.h"
#include "base/file.h"
#include "policy/onnx/onnx_model.h"

namespace slalom::cli {
namespace {

struct ExportOptions {
  std::string policy;
  std::string onnx;
  bool force = false;
};

void Export(const ExportOptions& options) {
  RequireOutputFile(options.onnx, options.force);
  const policy::LoadedPolicy loaded = policy::LoadPolicy(options.policy);
  const auto trained = train::TrainedConfig(loaded.metadata, options.policy);
  base::ThrowIf(
      trained && trained->mpc.enabled,
      "{}: mpc.enabled is true, expected false: the policy plans with its transition model, of "
      "which an ONNX model of its network knows nothing",
      options.policy);
  std::string model;
  try {
    model = policy::PrintOnnx(loaded.snapshot, loaded.metadata);
  } catch (const base::Error& error) {
    throw base::Error("{}: {}", options.policy, error.what());
  }
  base::WriteFileAtomically(options.onnx, model);
  fmt::print(stderr, "{}: {} parameters, {} kB; docs/robot.md says how to run it\n", options.onnx,
             loaded.snapshot.weights->size(), (model.size() + 999) / 1000);
}

}  // namespace

void AddExportCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("export", "Write a policy as an ONNX model, for other programs to run");
  auto options = std::make_shared<ExportOptions>();
  command->add_option("--policy", options->policy, "Policy file (.safetensors)")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--onnx", options->onnx, "File to write")->required();
  command->add_flag("--force", options->force, kForceHelp);
  command->footer(
      "The model reads ranges and goal, and gives speeds (docs/robot.md). Example:\n\n"
      "  slalom export --policy runs/quickstart/policy.safetensors --onnx policy.onnx\n");
  command->callback([options] { Export(*options); });
}

}  // namespace slalom::cli
