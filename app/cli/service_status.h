#pragma once

#include <chrono>

#include "app/train/run_config.h"
#include "proto/messages.h"

namespace slalom::cli {

/// Asks the replay servers of the config what they know of the service's processes. One that does
/// not answer within `patience` is shown by its address, as one that is not connected. Throws
/// `base::Error` if none answers.
proto::StatusReply AskStatus(const train::RunConfig& config, std::chrono::milliseconds patience);

}  // namespace slalom::cli
