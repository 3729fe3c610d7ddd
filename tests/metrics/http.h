#pragma once

#include <string>
#include <string_view>

namespace slalom::test {

/// A connection to a port of 127.0.0.1, which the caller closes. -1: nobody listens there.
int Connect(int port);

/// Sends `request` to a port of 127.0.0.1 and reads until the other side closes. Empty: it could
/// not be reached, or said nothing.
std::string Exchange(int port, std::string_view request);

}  // namespace slalom::test
