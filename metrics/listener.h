#pragma once

#include <string>
#include <string_view>

namespace slalom::metrics {

/// A TCP socket that listens.
struct Listener {
  int socket = -1;  ///< The caller closes it.
  int port = 0;     ///< The port in use, which the system chose if port 0 was asked for.
};

/// Listens at `address`: HOST:PORT, such as "127.0.0.1:9400", "[::1]:9400", "0.0.0.0:9400" (every
/// IPv4 interface) or "localhost:9400". Port 0 stands for any free port. Throws `base::Error`
/// ("cannot PURPOSE on 'ADDRESS': ...") with the reason if the address has another form, its host
/// is not known, or it cannot be listened on.
Listener Listen(const std::string& address, std::string_view purpose);

}  // namespace slalom::metrics
