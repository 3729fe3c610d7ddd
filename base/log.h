#pragma once

#include <spdlog/spdlog.h>

namespace slalom::base {

/// Sends log lines ("HH:MM:SS level text") to standard error, where the progress line is, too.
/// Called once from `main`; before it, spdlog's own default applies.
void InitLog();

}  // namespace slalom::base
