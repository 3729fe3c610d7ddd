#pragma once

#include <chrono>

#include "app/train/run_config.h"
#include "proto/messages.h"

namespace slalom::cli {

/// Asks the replay server of the config what it knows of the service's processes. Throws
/// `base::Error` if none answers within `patience`.
proto::StatusReply AskStatus(const train::RunConfig& config, std::chrono::milliseconds patience);

}  // namespace slalom::cli
