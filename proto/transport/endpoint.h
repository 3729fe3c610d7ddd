#pragma once

#include <string>

namespace slalom::transport {

/// Throws `base::Error` unless the endpoint has one of the forms "tcp://HOST:PORT" (port 0 to 65535
/// or *), "ipc://PATH" and "inproc://NAME". Does not check whether the host exists.
void CheckEndpoint(const std::string& endpoint);

bool IsTcp(const std::string& endpoint);
bool IsInproc(const std::string& endpoint);

/// Whether an endpoint cannot be reached from another machine: inproc, ipc, 127.0.0.0/8, ::1,
/// localhost.
bool IsLocal(const std::string& endpoint);

/// Whether it is a tcp endpoint whose host is an IPv6 address, "[...]".
bool IsIpv6(const std::string& endpoint);

}  // namespace slalom::transport
