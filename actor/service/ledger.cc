#include "actor/service/ledger.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"

namespace slalom::actor {
namespace {

constexpr char kLedgerMagic[8] = {'S', 'L', 'L', 'E', 'D', 'G', 'R', '1'};

struct Entries {
  std::uint64_t session;
  std::int64_t made;      // In the session; the next two as well.
  std::int64_t accepted;  // Acknowledged.
  std::int64_t earlier_made;
  std::int64_t earlier_accepted;
  std::int64_t lost[kNumLossReasons];
};

/// Whether the figures are possible: none is negative or absurd, and the steps of earlier sessions
/// were accepted or lost.
bool IsSound(const Entries& entries) {
  constexpr std::int64_t kMost = 1'000'000'000'000'000'000;  // Their sums do not overflow.
  const auto is_count = [](std::int64_t steps) { return steps >= 0 && steps <= kMost; };
  std::int64_t settled = entries.earlier_accepted;
  bool sound = is_count(static_cast<std::int64_t>(entries.session)) && is_count(entries.made) &&
               is_count(entries.accepted) && is_count(entries.earlier_made) &&
               is_count(entries.earlier_accepted) && entries.accepted <= entries.made;
  for (const std::int64_t lost : entries.lost) {
    sound = sound && is_count(lost);
    if (sound) settled += lost;
  }
  return sound && settled == entries.earlier_made;
}

}  // namespace

std::string_view ToString(LossReason reason) {
  constexpr std::array<std::string_view, 3> kNames = {"killed", "replaced", "server"};
  return kNames.at(static_cast<std::size_t>(reason));
}

/// Two copies, one of which is valid. A change of more than one field is written to the other copy,
/// which then becomes the valid one by a single store.
struct Ledger::File {
  char magic[8];
  std::atomic<std::uint64_t> current;
  Entries entries[2];

  Entries& now() { return entries[current.load(std::memory_order_relaxed) & 1]; }
  const Entries& now() const { return entries[current.load(std::memory_order_relaxed) & 1]; }
};

Ledger::Ledger(const std::filesystem::path& path)
    : lock_(base::FileLock::OfFile(path,
                                   "an actor of this name is running; choose another service.name "
                                   "or state directory")) {
  base::RemoveUnfinishedFiles(path.parent_path());
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  const auto fail = [&](std::string_view what) {
    const std::string reason = std::strerror(errno);
    if (fd >= 0) ::close(fd);
    return base::Error("{}: {} ({})", path.string(), what, reason);
  };
  if (fd < 0) throw fail("cannot open the actor's ledger");
  struct stat status {};
  if (::fstat(fd, &status) != 0) throw fail("cannot read");
  const bool is_new = status.st_size == 0;
  if (!is_new && status.st_size != static_cast<off_t>(sizeof(File))) {
    ::close(fd);
    throw base::Error("{}: {} bytes, expected an actor's ledger of {}", path.string(),
                      status.st_size, sizeof(File));
  }
  // With the blocks on disk, as a store into a mapped page without one ends the process by SIGBUS.
  if (is_new) {
    errno = ::posix_fallocate(fd, 0, sizeof(File));
    if (errno != 0) throw fail("cannot write");
  }
  void* const memory = ::mmap(nullptr, sizeof(File), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (memory == MAP_FAILED) throw fail("cannot map");
  ::close(fd);
  file_ = static_cast<File*>(memory);
  constexpr char kZeros[sizeof(kLedgerMagic)] = {};
  if (std::memcmp(file_->magic, kZeros, sizeof(kLedgerMagic)) == 0) {
    // The file is new, or the actor was killed before it was first written.
    std::memcpy(file_->magic, kLedgerMagic, sizeof(kLedgerMagic));
  }
  if (std::memcmp(file_->magic, kLedgerMagic, sizeof(kLedgerMagic)) != 0) {
    ::munmap(file_, sizeof(File));
    throw base::Error("{}: not an actor's ledger", path.string());
  }
  if (!IsSound(file_->now())) {
    ::munmap(file_, sizeof(File));
    throw base::Error("{}: damaged, as its steps do not add up; remove it to begin another account",
                      path.string());
  }
}

Ledger::~Ledger() { ::munmap(file_, sizeof(File)); }

std::uint64_t Ledger::session() const { return file().now().session; }

void Ledger::BeginSession(std::uint64_t session, std::int64_t accepted, LossReason reason) {
  const Entries& last = file_->now();
  Entries next = last;
  SLALOM_CHECK_GT(session, last.session);
  accepted = std::clamp<std::int64_t>(accepted, 0, last.made);
  const std::int64_t by_server = std::max<std::int64_t>(0, last.accepted - accepted);
  next.lost[static_cast<int>(LossReason::kServer)] += by_server;
  next.lost[static_cast<int>(reason)] += last.made - accepted - by_server;
  next.earlier_made += last.made;
  next.earlier_accepted += accepted;
  next.made = 0;
  next.accepted = 0;
  next.session = session;
  const std::uint64_t current = file_->current.load(std::memory_order_relaxed);
  file_->entries[(current + 1) & 1] = next;
  file_->current.store(current + 1, std::memory_order_release);
}

void Ledger::AddMade(std::int64_t steps) { file_->now().made += steps; }

void Ledger::AcknowledgeAllBut(std::int64_t pending) {
  SLALOM_CHECK_GE(pending, 0);
  Entries& now = file_->now();
  now.accepted = std::max(now.accepted, now.made - pending);
}

StepAccount Ledger::account() const {
  const Entries& now = file().now();
  StepAccount account;
  account.made = now.earlier_made + now.made;
  account.accepted = now.earlier_accepted + now.accepted;
  account.pending = now.made - now.accepted;
  std::copy(std::begin(now.lost), std::end(now.lost), account.lost.begin());
  return account;
}

}  // namespace slalom::actor
