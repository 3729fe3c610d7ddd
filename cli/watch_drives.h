#pragma once

#include <filesystem>
#include <memory>

#include "watch/watch_server.h"

namespace slalom::cli {

/// Drives the newest policy of a run over four of the courses that it trains on, whenever somebody
/// looks and there is a new one. Works in a thread of its own that gives way to every other
/// (nice 19), so that it takes little from a training beside it. Thread-safe.
class WatchDrives {
 public:
  WatchDrives();
  /// Stops what is under way.
  ~WatchDrives();
  WatchDrives(const WatchDrives&) = delete;
  WatchDrives& operator=(const WatchDrives&) = delete;

  /// The newest picture of the run in `directory`, and a note of what it shows or why there is
  /// none. Returns at once; a newer one is made in the background.
  watch::Drives Newest(const std::filesystem::path& directory);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::cli
