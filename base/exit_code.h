#pragma once

namespace slalom::base {

/// Exit codes of the program (docs/operations.md).
inline constexpr int kExitOk = 0;
inline constexpr int kExitError = 1;  ///< Bad input, no space, no permission: one line tells which.
inline constexpr int kExitUsage = 2;  ///< Bad command line.
inline constexpr int kExitDiverged = 3;        ///< Training stopped at NaN or diverging values.
inline constexpr int kExitLearnedNothing = 4;  ///< Training reached its limit and learned nothing.
inline constexpr int kExitSignalBase = 128;    ///< Plus the signal that stopped a run, once saved.

}  // namespace slalom::base
