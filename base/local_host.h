#pragma once

#include <string_view>

namespace slalom::base {

/// Whether `host`, a name or an address ("[::1]" or "::1"), is this machine to itself: "localhost",
/// 127.0.0.0/8 or ::1. Asks nobody.
[[nodiscard]] bool IsLocalHost(std::string_view host);

}  // namespace slalom::base
