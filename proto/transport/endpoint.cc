#include "proto/transport/endpoint.h"

#include <string_view>

#include "base/error.h"
#include "base/machine.h"
#include "base/split.h"

namespace slalom::transport {
namespace {

constexpr std::string_view kTcp = "tcp://";
constexpr std::string_view kInproc = "inproc://";
constexpr std::string_view kIpc = "ipc://";
constexpr int kMaxPort = 65535;

struct Address {
  std::string host;  // An IPv6 address with its brackets.
  std::string port;
};

Address Split(std::string_view endpoint) {
  endpoint.remove_prefix(kTcp.size());
  // ZeroMQ lets an endpoint name the address to connect from: "tcp://FROM;HOST:PORT".
  endpoint.remove_prefix(endpoint.rfind(';') + 1);
  const auto colon = endpoint.rfind(':');
  if (colon == std::string_view::npos) return {std::string(endpoint), ""};
  return {std::string(endpoint.substr(0, colon)), std::string(endpoint.substr(colon + 1))};
}

bool IsPort(std::string_view text) {
  const auto port = base::ParseNumber<int>(text);
  return text == "*" || (port && *port >= 0 && *port <= kMaxPort);
}

}  // namespace

void CheckEndpoint(const std::string& endpoint) {
  if (IsTcp(endpoint)) {
    const Address address = Split(endpoint);
    if (!address.host.empty() && IsPort(address.port)) return;
  } else if ((IsInproc(endpoint) && endpoint.size() > kInproc.size()) ||
             (endpoint.starts_with(kIpc) && endpoint.size() > kIpc.size())) {
    return;
  }
  throw base::Error("'{}' is not an endpoint; expected tcp://HOST:PORT with a port of 0 to {}",
                    endpoint, kMaxPort);
}

bool IsTcp(const std::string& endpoint) { return endpoint.starts_with(kTcp); }

bool IsInproc(const std::string& endpoint) { return endpoint.starts_with(kInproc); }

bool IsIpv6(const std::string& endpoint) {
  return IsTcp(endpoint) && Split(endpoint).host.starts_with('[');
}

bool IsLocal(const std::string& endpoint) {
  if (!IsTcp(endpoint)) return IsInproc(endpoint) || endpoint.starts_with(kIpc);
  return base::IsLocalHost(Split(endpoint).host);
}

}  // namespace slalom::transport
