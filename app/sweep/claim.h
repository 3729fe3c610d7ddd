#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

/// Claims on cells, for workers that share a directory.
///
/// A claim is a file claim-N in the cell's directory, and the claim with the highest N counts. It
/// is made by a hard link, which either succeeds or finds the name taken, also on network file
/// systems, and it never changes. Its owner shows that it lives by counting up in a file of its
/// own, beat-TOKEN. Clocks of different machines are never compared: a claim has expired once
/// another worker has seen its count stand still for a minute on its own clock. That worker then
/// takes claim-(N+1).

namespace slalom::sweep {

/// Throws `base::Error` that names the directory unless its file system has the features that
/// claims and atomic files need: hard links, and renaming that replaces.
void RequireSharable(const std::filesystem::path& directory);

/// The right to work on a cell, until this object ends. Thread-compatible.
class Claim {
 public:
  static constexpr std::chrono::seconds kBeat{5};     ///< Time between two calls of `Renew`.
  static constexpr std::chrono::seconds kExpiry{60};  ///< Time without a beat after which it ends.

  /// Gives the claim back.
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  /// Shows that the owner lives. Returns false if the claim was lost, because this process stood
  /// still for too long and another worker has taken the cell. The caller must then stop working on
  /// it.
  [[nodiscard]] bool Renew();

  /// The file, which is removed or another's once the claim is lost.
  const std::filesystem::path& file() const { return file_; }

 private:
  friend class ClaimTaker;
  Claim(std::filesystem::path file, std::filesystem::path beat, std::string token, int number);

  const std::filesystem::path file_;
  const std::filesystem::path beat_;
  const std::string token_;
  const int number_;
  long count_ = 0;
};

/// Takes claims, and remembers the counts of other workers' claims. Thread-compatible.
class ClaimTaker {
 public:
  using Clock = std::chrono::steady_clock;

  /// Takes the claim of a cell if nobody has it, if its owner has died (a process of this machine
  /// that is no more), or if it has expired. Returns null if another worker has it, or if the files
  /// do not tell. Throws `base::Error` if the directory cannot be written. `now`: the time of this
  /// machine; tests give their own.
  std::unique_ptr<Claim> Try(const std::filesystem::path& cell,
                             Clock::time_point now = Clock::now());

 private:
  struct Sighting {
    std::string beat;  ///< Token and count.
    Clock::time_point since;
  };
  bool IsGone(const std::filesystem::path& cell, const std::filesystem::path& claim,
              Clock::time_point now);

  std::map<std::filesystem::path, Sighting> sightings_;
};

/// Whether a worker that is not known to be dead holds a claim on the cell, or the cell cannot be
/// listed.
bool IsClaimed(const std::filesystem::path& cell);

/// Whether a worker certainly works on any of the cells: a process of this machine, or one whose
/// count goes up while this function waits, for `patience` at most.
bool AreWorkedOn(const std::vector<std::filesystem::path>& cells, std::chrono::seconds patience);

}  // namespace slalom::sweep
