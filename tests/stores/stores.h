#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace slalom::test {

/// Says that what was stored so far is safe, by a number that rises.
using Promise = std::function<void(int)>;

/// Everything that a process keeps on disk and reads back: a journal, a spool, checkpoints, ...
struct Store {
  std::string name;
  /// Uses the store in a directory as its process does, start and end included. Goes on after
  /// errors as that does. `written`: safe whatever happens to the process. `synced`, unless it is
  /// empty: safe after a loss of power, too.
  std::function<void(const std::filesystem::path&, const Promise& written, const Promise& synced)>
      use;
  /// Opens the store in a directory as the next process does, and expects what was promised.
  std::function<void(const std::filesystem::path&, int promised)> check;
  /// The source that makes and syncs its files. Empty: `base/` does.
  std::string source{};
};

std::vector<Store> Stores();

}  // namespace slalom::test
