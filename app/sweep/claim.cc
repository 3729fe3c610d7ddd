#include "app/sweep/claim.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "base/child_process.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json.h"
#include "base/log.h"
#include "base/split.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kClaim = "claim-";
constexpr int kMostClaims = 1'000'000'000;  // A file of a higher number is no claim.

/// What a claim says of its owner. All is empty if the file is not whole.
struct Owner {
  std::string token;
  std::string machine;  ///< As `ThisMachine`.
  long pid = 0;
  std::string start;  ///< As `StartOf`.
};

std::string FirstLine(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// When a process started, in the kernel's ticks. Empty if there is none.
std::string StartOf(long pid) {
  const std::string stat = FirstLine(fmt::format("/proc/{}/stat", pid));
  // The 22nd word; the second one is a name in brackets that may hold anything.
  const auto end_of_name = stat.rfind(')');
  if (end_of_name == std::string::npos) return "";
  std::istringstream words(stat.substr(end_of_name + 1));
  std::string word;
  for (int i = 3; i <= 22; ++i) words >> word;
  return word;
}

/// This start of this machine, and the space that its process ids are of.
std::string ThisMachine() {
  std::error_code ec;
  return FirstLine("/proc/sys/kernel/random/boot_id") + " " +
         fs::read_symlink("/proc/self/ns/pid", ec).string();
}

std::string NewToken() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

std::string PrintOwner(const std::string& token) {
  const nlohmann::ordered_json owner = {{"token", token},
                                        {"host", base::HostName()},
                                        {"machine", ThisMachine()},
                                        {"pid", ::getpid()},
                                        {"start", StartOf(::getpid())}};
  return owner.dump() + "\n";
}

/// Returns the content of a file. Empty if it is not there or cannot be read.
std::string ContentOf(const fs::path& path) {
  try {
    return base::ReadFile(path);
  } catch (const base::Error&) {
    return "";
  }
}

/// The number of a claim file; none: it is another file.
std::optional<int> NumberOf(const fs::path& path) {
  const std::string name = path.filename().string();
  if (!name.starts_with(kClaim)) return std::nullopt;
  const auto number = base::ParseNumber<int>(name.substr(kClaim.size()));
  return number <= kMostClaims ? number : std::nullopt;
}

fs::path ClaimFile(const fs::path& cell, int number) {
  return cell / fmt::format("{}{}", kClaim, number);
}

/// The numbers of a cell's claims, in no order. Throws `base::Error` if they cannot be listed.
std::vector<int> ClaimsOf(const fs::path& cell) {
  std::vector<int> numbers;
  for (const fs::path& file : base::ListDirectory(cell)) {
    if (const auto number = NumberOf(file)) numbers.push_back(*number);
  }
  return numbers;
}

/// 0: there is none. Throws as `ClaimsOf`.
int NewestClaim(const fs::path& cell) {
  int newest = 0;
  for (const int number : ClaimsOf(cell)) newest = std::max(newest, number);
  return newest;
}

/// Whether the owner is a process of this machine that is no more.
bool IsKnownDead(const Owner& owner) {
  return owner.machine == ThisMachine() && StartOf(owner.pid) != owner.start;
}

/// Whether a text may be part of a file's name.
bool IsToken(const std::string& text) {
  return std::ranges::all_of(text, [](unsigned char c) { return std::isalnum(c) != 0; });
}

Owner ParseOwner(const std::string& text) {
  const auto json = base::ParseJson(text);
  if (!json.is_object()) return {};
  try {
    Owner owner{.token = json.value("token", ""),
                .machine = json.value("machine", ""),
                .pid = base::WholeNumber(json.at("pid")),
                .start = json.value("start", "")};
    return IsToken(owner.token) ? owner : Owner{};
  } catch (const nlohmann::json::exception&) {
    return {};  // A value of another type.
  }
}

[[noreturn]] void ThrowUnsharable(const fs::path& directory, std::string_view what, int error) {
  throw base::Error(
      "{}: its file system cannot {} ({}), which a sweep needs to share work safely; expected a "
      "local disk, NFS or the like. Choose another with --output",
      directory.string(), what, std::strerror(error));
}

}  // namespace

void RequireSharable(const fs::path& directory) {
  const std::string token = NewToken();
  const fs::path first = directory / fmt::format(".probe-{}", token);
  const fs::path second = directory / fmt::format(".probe-{}-link", token);
  base::WriteFileAtomically(first, "1");
  int error = ::link(first.c_str(), second.c_str()) == 0 ? 0 : errno;
  const bool links = error == 0;
  if (links) {
    base::WriteFileAtomically(first, "2");
    if (ContentOf(second) != "1") error = EIO;  // The rename changed the file in place.
    if (error == 0 && ::rename(first.c_str(), second.c_str()) != 0) error = errno;
    if (error == 0 && ContentOf(second) != "2") error = EIO;
  }
  std::error_code ec;
  fs::remove(first, ec);
  fs::remove(second, ec);
  if (error == 0) return;
  ThrowUnsharable(directory, links ? "replace a file by renaming" : "make hard links", error);
}

Claim::Claim(fs::path file, fs::path beat, std::string token, int number)
    : file_(std::move(file)), beat_(std::move(beat)), token_(std::move(token)), number_(number) {}

Claim::~Claim() {
  std::error_code ec;
  if (ParseOwner(ContentOf(file_)).token == token_) fs::remove(file_, ec);
  fs::remove(beat_, ec);
}

bool Claim::Renew() {
  try {
    if (!base::Exists(file_) || ParseOwner(base::ReadFile(file_)).token != token_) return false;
    if (NewestClaim(file_.parent_path()) > number_) return false;
    base::WriteFileAtomically(beat_, std::to_string(++count_));
  } catch (const base::Error&) {
    // A full disk does not take the claim away, nor one that fails for a moment; that others see no
    // beat may.
  }
  return true;
}

bool ClaimTaker::IsGone(const fs::path& cell, const fs::path& claim, Clock::time_point now) {
  const std::string text = ContentOf(claim);
  const Owner owner = ParseOwner(text);
  if (IsKnownDead(owner)) return true;
  const std::string beat = text + ContentOf(cell / ("beat-" + owner.token));
  Sighting& sighting = sightings_.try_emplace(claim, Sighting{beat, now}).first->second;
  if (sighting.beat != beat) sighting = {beat, now};
  return now - sighting.since >= Claim::kExpiry;
}

std::unique_ptr<Claim> ClaimTaker::Try(const fs::path& cell, Clock::time_point now) {
  base::MakeDirectories(cell);
  int newest = 0;
  try {
    newest = NewestClaim(cell);
  } catch (const base::Error& error) {
    spdlog::warn("{}; taken for a cell that others work on", error.what());
    return nullptr;
  }
  if (newest > 0 && !IsGone(cell, ClaimFile(cell, newest), now)) return nullptr;
  const std::string token = NewToken();
  const fs::path file = ClaimFile(cell, newest + 1);
  const fs::path draft = cell / ("draft-" + token);
  const fs::path beat = cell / ("beat-" + token);
  base::WriteFileAtomically(draft, PrintOwner(token));
  bool taken = ::link(draft.c_str(), file.c_str()) == 0;
  const int error = errno;
  if (!taken && error == EEXIST) {
    // NFS repeats a call whose answer was lost, and then finds the name that it made itself:
    // open(2).
    struct stat status {};
    taken = ::stat(draft.c_str(), &status) == 0 && status.st_nlink == 2;
  }
  std::error_code ec;
  fs::remove(draft, ec);
  if (!taken && error == EEXIST) return nullptr;  // Somebody else was faster.
  if (!taken) ThrowUnsharable(cell, "make hard links", error);
  std::unique_ptr<Claim> claim(new Claim(file, beat, token, newest + 1));
  for (const int number : ClaimsOf(cell)) {
    if (number > newest) continue;
    const std::string old = ParseOwner(ContentOf(ClaimFile(cell, number))).token;
    fs::remove(ClaimFile(cell, number), ec);
    if (!old.empty()) fs::remove(cell / ("beat-" + old), ec);
  }
  if (!claim->Renew()) return nullptr;
  return claim;
}

bool AreWorkedOn(const std::vector<fs::path>& cells, std::chrono::seconds patience) {
  // The text of each claim and of its heartbeat; empty if nobody works on the cell.
  const auto look = [&cells] {
    std::vector<std::string> seen;
    for (const fs::path& cell : cells) {
      const int newest = NewestClaim(cell);
      const std::string text = newest > 0 ? ContentOf(ClaimFile(cell, newest)) : "";
      const Owner owner = ParseOwner(text);
      const bool is_dead = text.empty() || IsKnownDead(owner);
      seen.push_back(is_dead ? "" : text + ContentOf(cell / ("beat-" + owner.token)));
      if (!is_dead && owner.machine == ThisMachine()) seen.back() = "here";
    }
    return seen;
  };
  const std::vector<std::string> first = look();
  if (std::ranges::find(first, "here") != first.end()) return true;
  const bool any = std::ranges::any_of(first, [](const auto& text) { return !text.empty(); });
  const auto end = ClaimTaker::Clock::now() + patience;
  while (any && ClaimTaker::Clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    if (look() != first) return true;
  }
  return false;
}

bool IsClaimed(const fs::path& cell) {
  try {
    const int newest = NewestClaim(cell);
    return newest > 0 && !IsKnownDead(ParseOwner(ContentOf(ClaimFile(cell, newest))));
  } catch (const base::Error&) {
    return true;
  }
}

}  // namespace slalom::sweep
