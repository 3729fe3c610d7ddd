#include "proto/transport/keys.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <sstream>
#include <system_error>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/name.h"

namespace slalom::transport {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKeyCharacters = 40;
constexpr char kAllowed[] = "allowed";
constexpr std::string_view kRoleNames[] = {"replay", "learner", "actor", "evaluator", "operator"};

fs::path SecretFile(const fs::path& directory, Role role) {
  return directory / fmt::format("{}.key", ToString(role));
}
fs::path PublicFile(const fs::path& directory, Role role) {
  return directory / fmt::format("{}.pub", ToString(role));
}

/// Z85 writes 32 bytes as 40 characters out of 85.
bool IsKey(std::string_view text) {
  constexpr std::string_view kAlphabet =
      "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#";
  if (text.size() != kKeyCharacters ||
      text.find_first_not_of(kAlphabet) != std::string_view::npos) {
    return false;
  }
  std::array<std::uint8_t, 32> bytes{};
  return zmq_z85_decode(bytes.data(), std::string(text).c_str()) != nullptr;
}

std::string_view WithoutSpaces(std::string_view text) {
  constexpr std::string_view kSpaces = " \t\r\n";
  const auto begin = text.find_first_not_of(kSpaces);
  if (begin == std::string_view::npos) return "";
  return text.substr(begin, text.find_last_not_of(kSpaces) - begin + 1);
}

/// Reads a file that holds one key.
std::string ReadKey(const fs::path& path) {
  const std::string content = base::ReadTextFile(path);
  const std::string_view key = WithoutSpaces(content);
  if (!IsKey(key)) {
    throw base::Error(
        "{}: holds {} characters that are not a key; expected one line with one key of 40 "
        "characters (Z85), as `slalom keys new DIR` writes it",
        path.string(), key.size());
  }
  return std::string(key);
}

std::string PublicOf(const std::string& secret_key) {
  std::array<char, kKeyCharacters + 1> public_key{};
  SLALOM_CHECK_EQ(zmq_curve_public(public_key.data(), secret_key.c_str()), 0);
  return public_key.data();
}

/// Creates a file that has its mode from the first moment. Throws if it exists.
void WriteNewFile(const fs::path& path, std::string_view content, mode_t mode) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (fd < 0) throw base::Error("{}: cannot create ({})", path.string(), std::strerror(errno));
  // The umask may have taken bits away.
  const bool written =
      ::fchmod(fd, mode) == 0 &&
      ::write(fd, content.data(), content.size()) == static_cast<ssize_t>(content.size()) &&
      ::fsync(fd) == 0;
  const int error = errno;
  ::close(fd);
  if (written) return;
  ::unlink(path.c_str());
  throw base::Error("{}: cannot write ({})", path.string(), std::strerror(error));
}

struct NewFile {
  fs::path path;
  std::string content;
  mode_t mode;
};

std::vector<NewFile> NewFiles(const fs::path& directory) {
  std::vector<NewFile> files;
  std::string allowed =
      "# Who may connect, and as what: a role, a public key and, if not any, the names that it may "
      "have.\n# Servers read this at their start.\n";
  for (const Role role : kRoles) {
    const KeyPair keys = NewKeyPair();
    files.push_back({SecretFile(directory, role), keys.secret_key + "\n", 0600});
    files.push_back({PublicFile(directory, role), keys.public_key + "\n", 0644});
    allowed += fmt::format("{} {}\n", ToString(role), keys.public_key);
  }
  files.push_back({directory / kAllowed, allowed, 0644});
  return files;
}

/// Adds one line of the list. `place`: the file and the line, for errors.
void AddAllowed(std::string_view line, const std::string& place, AllowList& list) {
  const auto space = line.find_first_of(" \t");
  const std::string_view name = line.substr(0, space);
  const auto role = ParseRole(name);
  if (!role) {
    throw base::Error("{}: '{}' is not a role; expected one of {}", place, name,
                      fmt::join(kRoleNames, ", "));
  }
  const std::string_view rest =
      space == std::string_view::npos ? "" : WithoutSpaces(line.substr(space));
  const std::string key(rest.substr(0, rest.find_first_of(" \t")));
  if (!IsKey(key)) {
    throw base::Error(
        "{}: '{}' is not a key; expected a role and a public key of 40 characters (Z85)", place,
        key);
  }
  Allowed allowed(*role);
  std::istringstream words{std::string(rest.substr(key.size()))};
  for (std::string word; words >> word;) {
    const std::string_view plain =
        std::string_view(word).substr(0, word.size() - word.ends_with('*'));
    if (word != "*" && !base::IsName(plain)) {
      throw base::Error(
          "{}: '{}' names no process; expected letters, digits and '-_.:@', and at most a '*' at "
          "the end",
          place, word);
    }
    allowed.names += (allowed.names.empty() ? "" : " ") + word;
  }
  const auto [other, added] = list.emplace(key, allowed);
  if (!added && other->second != allowed) {
    throw base::Error("{}: this key has the role {} already{}; expected one line for each key",
                      place, ToString(other->second.role),
                      other->second.role == *role ? ", with other names" : "");
  }
}

/// Adds to the report which keys of a role there are and what is wrong with them.
void CheckRole(const fs::path& directory, Role role, const std::optional<AllowList>& allowed,
               KeysReport& report) {
  std::optional<KeyPair> keys;
  std::optional<std::string> public_key;
  try {
    if (fs::exists(SecretFile(directory, role))) keys = LoadKeyPair(directory, role);
  } catch (const base::Error& error) {
    report.faults.emplace_back(error.what());
  }
  try {
    if (fs::exists(PublicFile(directory, role))) public_key = LoadPublicKey(directory, role);
  } catch (const base::Error& error) {
    report.faults.emplace_back(error.what());
  }
  if (!keys && !public_key) return;
  if (keys && public_key && keys->public_key != *public_key) {
    report.faults.push_back(fmt::format(
        "{}: is not the public key of {}, which is {}", PublicFile(directory, role).string(),
        SecretFile(directory, role).filename().string(), keys->public_key));
  }
  const std::string& key = keys ? keys->public_key : *public_key;
  report.found.push_back(fmt::format("{:<10} {}  {}", ToString(role), key,
                                     keys ? "secret and public" : "public only"));
  if (!allowed) return;
  const auto entry = allowed->find(key);
  if (entry == allowed->end()) {
    report.faults.push_back(
        fmt::format("{}: does not list the key of the role {}; expected a line '{} {}'",
                    (directory / kAllowed).string(), ToString(role), ToString(role), key));
  } else if (entry->second.role != role) {
    report.faults.push_back(fmt::format("{}: gives the key of {} the role {}",
                                        (directory / kAllowed).string(), ToString(role),
                                        ToString(entry->second.role)));
  }
}

}  // namespace

std::string_view ToString(Role role) { return kRoleNames[static_cast<std::size_t>(role)]; }

std::optional<Role> ParseRole(std::string_view name) {
  for (const Role role : kRoles) {
    if (ToString(role) == name) return role;
  }
  return std::nullopt;
}

bool AllowsName(std::string_view names, std::string_view name) {
  if (names.empty()) return true;
  while (!names.empty()) {
    const std::string_view word = names.substr(0, names.find(' '));
    names.remove_prefix(std::min(word.size() + 1, names.size()));
    if (word == name) return true;
    if (word.ends_with('*') && name.starts_with(word.substr(0, word.size() - 1))) return true;
  }
  return false;
}

KeyPair NewKeyPair() {
  std::array<char, kKeyCharacters + 1> public_key{};
  std::array<char, kKeyCharacters + 1> secret_key{};
  SLALOM_CHECK_EQ(zmq_curve_keypair(public_key.data(), secret_key.data()), 0);
  return {public_key.data(), secret_key.data()};
}

void WriteNewKeys(const fs::path& directory) {
  const std::vector<NewFile> files = NewFiles(directory);
  for (const NewFile& file : files) {
    std::error_code ignored;
    if (fs::exists(fs::symlink_status(file.path, ignored))) {
      throw base::Error(
          "{}: exists already; expected a directory without keys, because new keys would replace "
          "those in use",
          file.path.string());
    }
  }
  const bool is_new = !base::Exists(directory);
  base::MakeDirectories(directory);
  if (is_new && ::chmod(directory.c_str(), 0700) != 0) {
    throw base::Error("{}: cannot be made private ({})", directory.string(), std::strerror(errno));
  }
  std::size_t num_written = 0;
  try {
    for (const NewFile& file : files) {
      WriteNewFile(file.path, file.content, file.mode);
      ++num_written;
    }
  } catch (const base::Error&) {
    for (std::size_t i = 0; i < num_written; ++i) ::unlink(files[i].path.c_str());
    throw;
  }
  base::SyncDirectory(directory);
}

bool IsPrivate(mode_t mode, uid_t owner, uid_t user) {
  const mode_t others = mode & (S_IRWXG | S_IRWXO);
  return others == 0 || (others == S_IRGRP && owner == 0 && user != 0);
}

KeyPair LoadKeyPair(const fs::path& directory, Role role) {
  const fs::path path = SecretFile(directory, role);
  KeyPair keys;
  keys.secret_key = ReadKey(path);
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0 &&
      !IsPrivate(status.st_mode, status.st_uid, ::geteuid())) {
    throw base::Error(
        "{}: is a secret key that other users can open (mode {:04o}); expected mode 0600: chmod "
        "600 {}",
        path.string(), status.st_mode & 07777, path.string());
  }
  keys.public_key = PublicOf(keys.secret_key);
  return keys;
}

std::string LoadPublicKey(const fs::path& directory, Role role) {
  return ReadKey(PublicFile(directory, role));
}

AllowList LoadAllowList(const fs::path& directory) {
  const fs::path path = directory / kAllowed;
  const std::string content = base::ReadTextFile(path);
  AllowList list;
  int line_number = 0;
  for (std::size_t begin = 0; begin < content.size();) {
    const std::size_t end = std::min(content.find('\n', begin), content.size());
    const auto line = WithoutSpaces(std::string_view(content).substr(begin, end - begin));
    ++line_number;
    begin = end + 1;
    if (line.empty() || line.starts_with('#')) continue;
    AddAllowed(line, fmt::format("{}:{}", path.string(), line_number), list);
  }
  if (list.empty()) {
    throw base::Error("{}: allows nobody; expected lines with a role and a public key each",
                      path.string());
  }
  return list;
}

KeysReport CheckKeys(const fs::path& directory) {
  if (!fs::is_directory(directory)) {
    throw base::Error("{}: is not a directory; `slalom keys new {}` makes one with new keys",
                      directory.string(), directory.string());
  }
  KeysReport report;
  std::optional<AllowList> allowed;
  try {
    if (fs::exists(directory / kAllowed)) allowed = LoadAllowList(directory);
  } catch (const base::Error& error) {
    report.faults.emplace_back(error.what());
  }
  for (const Role role : kRoles) CheckRole(directory, role, allowed, report);
  if (allowed) {
    report.found.push_back(fmt::format("{:<10} {} keys may connect to a server of this directory",
                                       kAllowed, allowed->size()));
  }
  if (report.found.empty() && report.faults.empty()) {
    throw base::Error("{}: holds no keys; `slalom keys new DIR` makes some", directory.string());
  }
  return report;
}

}  // namespace slalom::transport
