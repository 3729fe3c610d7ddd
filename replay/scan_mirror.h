#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "replay/lazy_memory.h"

/// A mirror: the scans that a learner keeps of those that a replay server has sent it, so that each
/// is sent once. The scan of row r has place r mod P in it, and takes the place of an earlier one.
/// Server and learner note the same scans in the same order, so the server knows what is there.

namespace slalom::replay {

/// The most places of a mirror.
inline constexpr std::int64_t kMaxMirrorPlaces = 1 << 30;

/// The server's side: whose scans are there, without the scans. Thread-compatible. Memory: 4 bytes
/// for each place that was ever taken.
class MirroredRows {
 public:
  /// An empty mirror. Requires: 1 <= num_places <= kMaxMirrorPlaces.
  explicit MirroredRows(std::int64_t num_places);

  /// Returns the place of a row's scan, or its bitwise complement, a negative number, if the scan
  /// is not there. It is then taken to be sent. Requires: row >= 0.
  std::int32_t Take(std::int64_t row);

 private:
  std::int64_t num_places_;
  LazyMemory rounds_;  // [P] uint32, 1 + row / P of the row whose scan is there; 0: none is.
};

/// The learner's side. Thread-compatible. Memory: that of the scans that it holds.
class ScanMirror {
 public:
  /// An empty mirror. Requires: 0 <= num_places <= kMaxMirrorPlaces, num_beams >= 1.
  ScanMirror(std::int64_t num_places, int num_beams);

  std::int64_t num_places() const { return static_cast<std::int64_t>(is_held_.size()); }

  /// Notes a scan [num_beams] that came, without a copy: it must stay where it is until `Keep`.
  /// Requires: 0 <= place < num_places().
  void Add(std::int32_t place, const std::uint16_t* scan) { came_[place] = scan; }
  /// Returns the scan at a place, valid until the next `Keep`, or null if none is there. Requires:
  /// 0 <= place < num_places().
  const std::uint16_t* Find(std::int32_t place) const;
  /// Copies the scans that came since the last call to their places.
  void Keep();
  /// Forgets all scans. What `Find` has returned stays valid until the next `Keep`.
  void Clear();

 private:
  std::uint16_t* At(std::int32_t place) const;

  int num_beams_;
  LazyMemory scans_;           // [P, num_beams]
  std::vector<bool> is_held_;  // [P]
  std::unordered_map<std::int32_t, const std::uint16_t*> came_;
};

}  // namespace slalom::replay
