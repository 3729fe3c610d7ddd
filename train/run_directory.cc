#include "train/run_directory.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "config/config.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 10> kMayChange = {
    "run.max_steps",        "run.max_seconds",      "run.log_interval",   "run.checkpoint_seconds",
    "run.checkpoint_steps", "run.snapshot_seconds", "run.snapshot_steps", "run.simulation_threads",
    "courses.test",         "evaluation."};

bool MayChange(std::string_view key) {
  return std::any_of(kMayChange.begin(), kMayChange.end(), [key](std::string_view allowed) {
    return allowed.ends_with('.') ? key.starts_with(allowed) : key == allowed;
  });
}

void WriteConfig(const RunDirectory& directory, const RunConfig& config) {
  base::WriteFileAtomically(directory.config(), config::ToToml(config));
}

}  // namespace

RunLock::RunLock(const fs::path& root)
    : fd_(::open(root.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (fd_ < 0 || ::flock(fd_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  ::close(fd_);
  throw base::Error(fmt::format(
      "{}: another process is training in this directory; stop it, or choose another --name",
      root.string()));
}

RunLock::~RunLock() {
  if (fd_ >= 0) ::close(fd_);
}

RunLock::RunLock(RunLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

RunLock BeginRun(const RunDirectory& directory, const RunConfig& config) {
  if (fs::exists(directory.config())) {
    const RunLock earlier(directory.root);
    fs::path aside;
    for (int i = 1; aside.empty() || fs::exists(aside); ++i) {
      aside = fmt::format("{}.{}", directory.root.string(), i);
    }
    std::error_code ec;
    fs::rename(directory.root, aside, ec);
    if (ec) {
      throw base::Error(fmt::format("{}: cannot move the earlier run to {} ({})",
                                    directory.root.string(), aside.string(), ec.message()));
    }
    spdlog::info("the earlier run is now {}", aside.string());
  }
  base::MakeDirectories(directory.root);
  RunLock lock(directory.root);
  WriteConfig(directory, config);
  return lock;
}

RunLock ResumeRun(const RunDirectory& directory, const RunConfig& config) {
  if (!fs::exists(directory.config())) {
    throw base::Error(fmt::format("{}: no run to resume here", directory.root.string()));
  }
  RunLock lock(directory.root);
  auto earlier =
      config::FromToml<RunConfig>(base::ReadFile(directory.config()), directory.config().string());
  RunConfig given = config;
  const auto old_fields = config::ListFields(earlier).fields;
  const auto new_fields = config::ListFields(given).fields;
  for (std::size_t i = 0; i < new_fields.size(); ++i) {
    const std::string was = config::PrintValue(old_fields[i]);
    const std::string is = config::PrintValue(new_fields[i]);
    if (was != is && !MayChange(new_fields[i].key)) {
      throw base::Error(fmt::format("{}: {} was {} in the run, is {} now; a resumed run keeps it",
                                    directory.config().string(), new_fields[i].key, was, is));
    }
  }
  WriteConfig(directory, given);
  return lock;
}

}  // namespace slalom::train
