#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// CURVE keys (ZeroMQ RFC 25, 26): who a peer is and what it may do. docs/operations.md describes
/// the directory that `slalom keys new` makes.

namespace slalom::transport {

/// What a peer is allowed to do follows from its role.
enum class Role { kReplay, kLearner, kActor, kEvaluator, kOperator };
inline constexpr Role kRoles[] = {Role::kReplay, Role::kLearner, Role::kActor, Role::kEvaluator,
                                  Role::kOperator};
std::string_view ToString(Role role);
/// None: no role has this name.
std::optional<Role> ParseRole(std::string_view name);

/// Both as Z85 text of 40 characters.
struct KeyPair {
  std::string public_key;
  std::string secret_key;
};
KeyPair NewKeyPair();

/// Public keys and the role of who holds them.
using AllowList = std::map<std::string, Role>;

/// What `slalom keys new DIR` makes, in a directory of mode 0700: ROLE.key (secret, mode 0600) and
/// ROLE.pub for each role, one line with one key each, and `allowed`, lines "ROLE PUBLIC-KEY", to
/// which more may be added by hand; there empty lines and lines that begin with # are passed over.
/// Throws `base::Error` where a file of that name exists already or cannot be written; then nothing
/// was written.
void WriteNewKeys(const std::filesystem::path& directory);

/// Throw `base::Error` naming the file, the line and what was expected, and where a secret key can
/// be read by others than its owner.
KeyPair LoadKeyPair(const std::filesystem::path& directory, Role role);
std::string LoadPublicKey(const std::filesystem::path& directory, Role role);
AllowList LoadAllowList(const std::filesystem::path& directory);

/// What is in a directory of keys, in words.
struct KeysReport {
  std::vector<std::string> found;
  std::vector<std::string> faults;  ///< Files and what is wrong with them.
};

/// Looks at each file that is there, whether it can be used and agrees with the others; a machine
/// needs only those of its roles. Throws `base::Error` where there is no such directory, or no key
/// in it.
KeysReport CheckKeys(const std::filesystem::path& directory);

}  // namespace slalom::transport
