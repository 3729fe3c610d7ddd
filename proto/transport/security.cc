#include "proto/transport/security.h"

#include "base/error.h"
#include "base/log.h"
#include "proto/transport/endpoint.h"

namespace slalom::transport {
namespace {

/// Whether connections of this endpoint need keys. Throws or warns as the header says.
bool NeedsKeys(const SecurityConfig& config, const std::string& endpoint) {
  CheckEndpoint(endpoint);
  if (IsInproc(endpoint)) return false;
  if (!config.keys.empty()) return true;
  if (IsLocal(endpoint)) return false;
  base::ThrowIf(
      !config.allow_plaintext,
      "{}: can be reached from other machines, and security.keys is empty; expected a directory "
      "made by `slalom keys new DIR`, or security.allow_plaintext = true",
      endpoint);
  spdlog::warn(
      "{}: connections are in plaintext, because security.allow_plaintext is set: anybody who can "
      "reach this port can read and write everything",
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

}  // namespace slalom::transport
