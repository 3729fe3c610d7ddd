#pragma once

#include <string>
#include <string_view>

namespace slalom::metrics {

/// A TCP socket that listens.
struct Listener {
  int socket = -1;  ///< The caller's to close.
  int port = 0;     ///< The one that was chosen where any was asked for.
};

/// Listens at `address`: HOST:PORT, as "127.0.0.1:9400", "[::1]:9400", "0.0.0.0:9400" (every
/// interface of IPv4) or "localhost:9400"; port 0: any free one. Throws `base::Error` ("cannot
/// PURPOSE on 'ADDRESS': ...") where the address has another form, its host is not known, or it
/// cannot be listened on, with the reason.
Listener Listen(const std::string& address, std::string_view purpose);

}  // namespace slalom::metrics
