#pragma once

#include <filesystem>
#include <memory>

#include "app/watch/watch_server.h"

namespace slalom::watch {

/// Drives the newest policy of a run over four of the courses that it trains on, whenever somebody
/// asks for a picture and there is a new policy. Works in a thread of its own that gives way to
/// every other (nice 19), so that it takes little from a training beside it. Thread-safe.
class WatchDrives {
 public:
  WatchDrives();
  /// Stops a drive that is under way.
  ~WatchDrives();
  WatchDrives(const WatchDrives&) = delete;
  WatchDrives& operator=(const WatchDrives&) = delete;

  /// Returns the newest picture of the run in `directory`, and a note that says what it shows or
  /// why there is none. Returns at once; a newer picture is made in the background.
  Drives Newest(const std::filesystem::path& directory);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::watch
