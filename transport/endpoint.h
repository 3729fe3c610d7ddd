#pragma once

#include <string>

namespace slalom::transport {

/// Throws `base::Error`, which names the endpoint and what is expected, where it is none of
/// "tcp://HOST:PORT" (port 0 to 65535 or *), "ipc://PATH" and "inproc://NAME". Whether the host
/// exists is not looked at.
void CheckEndpoint(const std::string& endpoint);

bool IsTcp(const std::string& endpoint);
bool IsInproc(const std::string& endpoint);

/// Whether an endpoint cannot be reached from another machine: inproc, ipc, 127.0.0.0/8, ::1,
/// localhost.
bool IsLocal(const std::string& endpoint);

/// Of tcp: whether its host is an IPv6 address, "[...]".
bool IsIpv6(const std::string& endpoint);

}  // namespace slalom::transport
