#pragma once

namespace slalom::replay {

/// While one of these lives every fsync and fdatasync of this program fails, as on a broken disk.
/// One at a time; the syncs may be those of any thread.
class FailingSyncs {
 public:
  FailingSyncs();
  ~FailingSyncs();
  FailingSyncs(const FailingSyncs&) = delete;
  FailingSyncs& operator=(const FailingSyncs&) = delete;
};

}  // namespace slalom::replay
