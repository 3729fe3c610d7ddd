#pragma once

#include <sys/types.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// CURVE keys (ZeroMQ RFC 25, 26), which identify peers and give them roles. docs/operations.md
/// describes the directory that `slalom keys new` makes.

namespace slalom::transport {

/// Roles of peers, which decide which messages they may send.
enum class Role { kReplay, kLearner, kActor, kEvaluator, kOperator };
inline constexpr Role kRoles[] = {Role::kReplay, Role::kLearner, Role::kActor, Role::kEvaluator,
                                  Role::kOperator};
std::string_view ToString(Role role);
/// The role of this name, or nothing if there is none.
std::optional<Role> ParseRole(std::string_view name);

/// Both keys are Z85 text of 40 characters.
struct KeyPair {
  std::string public_key;
  std::string secret_key;
};
KeyPair NewKeyPair();

/// What the holder of a key may be. A value.
struct Allowed {
  Allowed() = default;
  Allowed(Role allowed_role) : role(allowed_role) {}  // NOLINT: a role alone may have any name

  Role role = Role::kOperator;
  /// The names that it may have, with a space between two; a "*" at the end of one stands for any
  /// characters. Empty: any name.
  std::string names;

  friend bool operator==(const Allowed&, const Allowed&) = default;
};
/// Whether `names` of an `Allowed` has room for a name.
bool AllowsName(std::string_view names, std::string_view name);

/// Public keys, and what their holders may be.
using AllowList = std::map<std::string, Allowed>;

/// Writes new keys to a directory of mode 0700, as `slalom keys new DIR` does.
///
/// Each role gets a file ROLE.key (secret, mode 0600) and a file ROLE.pub, which hold one line with
/// one key. The file `allowed` holds lines "ROLE PUBLIC-KEY NAME...", to which more may be added by
/// hand; without names a line allows any. Empty lines and lines that begin with # are ignored. If
/// one of the files exists already or cannot be written, throws `base::Error` and leaves no new
/// file behind.
void WriteNewKeys(const std::filesystem::path& directory);

/// Whether a secret key with this mode and owner is `user`'s alone: nobody else can open it, or it
/// is root's and a group reads it, as Kubernetes gives a pod its secrets (`fsGroup`, mode 0440).
bool IsPrivate(mode_t mode, uid_t owner, uid_t user);

/// These throw `base::Error`, which names the file, the line and what was expected, if a file is
/// not valid or if others than its owner can read a secret key.
KeyPair LoadKeyPair(const std::filesystem::path& directory, Role role);
std::string LoadPublicKey(const std::filesystem::path& directory, Role role);
AllowList LoadAllowList(const std::filesystem::path& directory);

/// Describes a directory of keys in words.
struct KeysReport {
  std::vector<std::string> found;
  std::vector<std::string> faults;  ///< Files and what is wrong with them.
};

/// Checks whether each file in the directory can be used and agrees with the others. Files may be
/// missing, since a machine needs only its roles' keys. Throws `base::Error` if there is no such
/// directory, or no key in it.
KeysReport CheckKeys(const std::filesystem::path& directory);

}  // namespace slalom::transport
