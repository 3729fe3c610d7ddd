#pragma once

#include <CLI/App.hpp>

/// The commands of the program. Each `Add...Command` adds a subcommand whose callback does the work
/// and throws `base::Error` for mistakes that the user can correct.

namespace slalom::cli {

void AddTrainCommand(CLI::App& app, int* exit_code);
void AddEvaluateCommand(CLI::App& app, int* exit_code);
void AddReportCommand(CLI::App& app);
void AddCoursesCommand(CLI::App& app);
/// Adds `animate` to `slalom courses`: recorded drives as a moving picture.
void AddAnimateCommand(CLI::App& courses);
/// Adds `import` to `slalom courses`: courses of worlds and maps of others.
void AddImportCommand(CLI::App& courses);
/// `slalom act`: a policy that reads a robot's observations and writes its commands.
void AddActCommand(CLI::App& app);
void AddExportCommand(CLI::App& app);
void AddConfigCommand(CLI::App& app);
void AddServiceCommands(CLI::App& app, int* exit_code);
/// `slalom service`: all processes of a service on this machine.
void AddLocalServiceCommand(CLI::App& app, int* exit_code);
void AddWatchCommand(CLI::App& app);
void AddStatusCommand(CLI::App& app);
void AddSweepCommand(CLI::App& app, int* exit_code);
void AddKeysCommand(CLI::App& app);
void AddMetricsCommand(CLI::App& app);
void AddBackupCommand(CLI::App& app);

}  // namespace slalom::cli
