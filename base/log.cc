#include "base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <unistd.h>

#include <string>

namespace slalom::base {

void InitLog() {
  auto logger = spdlog::stderr_color_mt("slalom");
  // On a terminal a message takes the place of a progress line that stands there.
  const std::string clear_line = isatty(STDERR_FILENO) == 1 ? "\r\x1b[K" : "";
  logger->set_pattern(clear_line + "%H:%M:%S %^%l%$ %v");
  spdlog::set_default_logger(logger);
}

}  // namespace slalom::base
