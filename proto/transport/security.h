#pragma once

#include <optional>
#include <string>

#include "proto/transport/keys.h"

namespace slalom::transport {

/// How connections are protected.
struct SecurityConfig {
  std::string keys;
  bool allow_plaintext = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("keys", keys,
      "Directory of CURVE keys, from `slalom keys new DIR`: TCP connections are then authenticated "
      "and encrypted. Empty: plaintext, on loopback only.");
    v("allow_plaintext", allow_plaintext,
      "Accept plaintext from other machines, too. Anyone who reaches the port can then read and "
      "write everything.");
  }
};

/// Keys of a listening role. Without keys it accepts plaintext.
struct ServerSecurity {
  std::optional<KeyPair> keys;
  AllowList allowed;
};

/// Keys of a connecting role. Without keys it connects in plaintext.
struct ClientSecurity {
  std::optional<KeyPair> keys;
  std::string server_key;  ///< The server's public key.
};

/// Load the keys that `config` names for a role. They throw `base::Error` if the keys cannot be
/// used, if the endpoint is not valid, and if the connection would be in plaintext beyond loopback
/// though `allow_plaintext` is not set. If it is set, they log a warning.
ServerSecurity MakeServerSecurity(const SecurityConfig& config, Role own,
                                  const std::string& endpoint);
ClientSecurity MakeClientSecurity(const SecurityConfig& config, Role own, Role server,
                                  const std::string& endpoint);

}  // namespace slalom::transport
