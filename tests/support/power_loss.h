#pragma once

#include <sys/types.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace slalom::test {

/// Watches the calls by which this program changes the files below a directory, and knows what a
/// loss of power would leave of them at each moment. A test is linked with failing_libc.cc.
///
/// A file's bytes are safe since its last sync, and a name in a directory since the directory's.
/// What was not synced may be lost or not, so there are several ways to lose it. Changes of mapped
/// memory count as never synced. One at a time.
class PowerLoss {
 public:
  using Content = std::shared_ptr<const std::string>;
  /// What is left, by path below the directory. Null: a directory.
  using Tree = std::map<std::filesystem::path, Content>;
  /// A moment and what it leaves.
  struct Loss {
    std::string when;  ///< The call before which the power fails, and the way, for messages.
    int promised = 0;  ///< The last `Promise` before it.
    Tree tree;
  };

  /// All that is there already is safe. Requires: `root` exists.
  explicit PowerLoss(std::filesystem::path root);
  ~PowerLoss();
  PowerLoss(const PowerLoss&) = delete;
  PowerLoss& operator=(const PowerLoss&) = delete;

  /// From now on, what is safe as of `number` has to survive. Numbers rise.
  void Promise(int number);

  /// The losses so far, without those that leave the same as the one before and promise less. Adds
  /// the loss of this moment.
  std::vector<Loss> Losses();

  /// Makes `directory` hold a tree, and nothing else.
  static void Restore(const Tree& tree, const std::filesystem::path& directory);

 private:
  /// A file or directory, as the disk has it for certain.
  struct Node {
    Content content;  ///< Null: it was never synced.
    std::map<std::string, std::pair<std::shared_ptr<Node>, bool>> entries;  ///< True: a directory.
  };

  static void Observe(const char* function, int fd, const char* path);
  void Observed(const std::string& function, int fd, const char* path);
  bool IsBelowRoot(const std::filesystem::path& path) const;
  std::shared_ptr<Node> NodeOf(const std::filesystem::path& path);
  void SyncFile(const std::filesystem::path& path);
  void SyncDirectory(const std::filesystem::path& path);
  void Fail(const std::string& when);
  void Add(std::string when, Tree tree);

  const std::filesystem::path root_;
  std::mutex mutex_;
  int promised_ = 0;
  std::map<ino_t, std::shared_ptr<Node>> nodes_;
  /// Announced, and not seen yet. Another thread may see them before their maker says so.
  std::set<std::filesystem::path> being_made_;
  std::map<std::string, Loss> last_;  // By way.
  std::vector<Loss> losses_;
};

}  // namespace slalom::test
