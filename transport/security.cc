#include "transport/security.h"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <array>
#include <string_view>

#include "base/error.h"
#include "base/log.h"

namespace slalom::transport {
namespace {

constexpr std::string_view kTcp = "tcp://";
constexpr std::string_view kInproc = "inproc://";

/// "tcp://SOURCE;[::1]:80" -> "::1".
std::string HostOf(std::string_view endpoint) {
  endpoint.remove_prefix(kTcp.size());
  if (const auto source = endpoint.rfind(';'); source != std::string_view::npos) {
    endpoint.remove_prefix(source + 1);
  }
  std::string_view host = endpoint.substr(0, endpoint.rfind(':'));
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  return std::string(host);
}

/// Whether connections of this endpoint have keys. Throws, or warns, as the header says.
bool NeedsKeys(const SecurityConfig& config, const std::string& endpoint) {
  if (endpoint.starts_with(kInproc)) return false;
  if (!config.keys.empty()) return true;
  if (IsLocal(endpoint)) return false;
  if (!config.allow_plaintext) {
    throw base::Error(
        fmt::format("{}: is not on this machine alone and security.keys is empty; expected a "
                    "directory made by `slalom keys new DIR`, or security.allow_plaintext = true",
                    endpoint));
  }
  spdlog::warn(
      "{}: in plaintext, as security.allow_plaintext asks: whoever reaches this port can read and "
      "write everything",
      endpoint);
  return false;
}

}  // namespace

ServerSecurity MakeServerSecurity(const SecurityConfig& config, Role own,
                                  const std::string& endpoint) {
  if (!NeedsKeys(config, endpoint)) return {};
  return {LoadKeyPair(config.keys, own), LoadAllowList(config.keys)};
}

ClientSecurity MakeClientSecurity(const SecurityConfig& config, Role own, Role server,
                                  const std::string& endpoint) {
  if (!NeedsKeys(config, endpoint)) return {};
  return {LoadKeyPair(config.keys, own), LoadPublicKey(config.keys, server)};
}

bool IsLocal(const std::string& endpoint) {
  if (!endpoint.starts_with(kTcp)) {
    return endpoint.starts_with(kInproc) || endpoint.starts_with("ipc://");
  }
  const std::string host = HostOf(endpoint);
  if (host == "localhost") return true;
  std::array<unsigned char, 16> bytes{};
  if (inet_pton(AF_INET, host.c_str(), bytes.data()) == 1) return bytes[0] == 127;
  if (inet_pton(AF_INET6, host.c_str(), bytes.data()) != 1) return false;
  std::array<unsigned char, 16> loopback{};
  loopback[15] = 1;
  return bytes == loopback;
}

}  // namespace slalom::transport
