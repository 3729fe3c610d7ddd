#include "base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>

namespace slalom::base {

void InitLog() {
  auto logger = spdlog::stderr_color_mt("slalom");
  logger->set_pattern("%H:%M:%S %^%l%$ %v");
  spdlog::set_default_logger(logger);
}

}  // namespace slalom::base
