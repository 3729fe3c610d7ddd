#pragma once

#include <string>

#include "proto/messages.h"

namespace slalom::cli {

/// The processes of a service as tables for people, one for each role. Of more than
/// `kMostActors` actors it has a line for all of them, and a line for each that is gone, up to as
/// many.
std::string FormatStatus(const proto::StatusReply& status);
inline constexpr int kMostActors = 100;

}  // namespace slalom::cli
