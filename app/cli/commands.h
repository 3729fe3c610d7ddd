#pragma once

#include <CLI/App.hpp>

#include "app/cli/courses_command.h"

/// The commands of the program. Each `Add...Command` adds a subcommand whose callback does the work
/// and throws `base::Error` for mistakes that the user can correct.

namespace slalom::cli {

/// Exit codes of the program (docs/operations.md).
inline constexpr int kExitOk = 0;
inline constexpr int kExitError = 1;  ///< Bad input, no space, no permission: one line says what.
inline constexpr int kExitUsage = 2;  ///< Bad command line.
inline constexpr int kExitDiverged = 3;        ///< Training stopped at NaN or diverging values.
inline constexpr int kExitLearnedNothing = 4;  ///< Training reached its limit and learned nothing.
inline constexpr int kExitSignalBase =
    128;  ///< Plus the signal that stopped a run after it was saved.

void AddTrainCommand(CLI::App& app, int* exit_code);
void AddEvaluateCommand(CLI::App& app, int* exit_code);
void AddReportCommand(CLI::App& app);
void AddCompareCommand(CLI::App& app);
void AddConfigCommand(CLI::App& app);
void AddServiceCommands(CLI::App& app, int* exit_code);
void AddWatchCommand(CLI::App& app);
void AddStatusCommand(CLI::App& app);
void AddSweepCommand(CLI::App& app, int* exit_code);
void AddKeysCommand(CLI::App& app);
void AddMetricsCommand(CLI::App& app);

}  // namespace slalom::cli
