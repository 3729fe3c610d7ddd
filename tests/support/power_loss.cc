#include "tests/support/power_loss.h"

#include <sys/stat.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <utility>

extern "C" void slalom_set_call_observer(void (*observe)(const char*, int, const char*));

namespace slalom::test {
namespace {

namespace fs = std::filesystem;

std::atomic<PowerLoss*> watching{nullptr};
thread_local bool is_inside = false;  // The watcher's own calls do not count.

class Inside {
 public:
  Inside() : before_(std::exchange(is_inside, true)) {}
  ~Inside() { is_inside = before_; }

 private:
  const bool before_;
};

PowerLoss::Content Read(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return std::make_shared<const std::string>(std::istreambuf_iterator<char>(in),
                                             std::istreambuf_iterator<char>());
}

const std::string& BytesOf(const PowerLoss::Content& content) {
  static const std::string none;
  return content ? *content : none;
}

bool IsSame(const PowerLoss::Tree& a, const PowerLoss::Tree& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) {
    return x.first == y.first && (x.second == nullptr) == (y.second == nullptr) &&
           BytesOf(x.second) == BytesOf(y.second);
  });
}

}  // namespace

PowerLoss::PowerLoss(fs::path root) : root_(std::move(root)) {
  {
    const Inside inside;
    SyncDirectory(root_);
    for (const auto& entry : fs::recursive_directory_iterator(root_)) {
      entry.is_directory() ? SyncDirectory(entry.path()) : SyncFile(entry.path());
    }
  }
  watching = this;
  slalom_set_call_observer(&Observe);
}

PowerLoss::~PowerLoss() {
  slalom_set_call_observer(nullptr);
  watching = nullptr;
  const std::lock_guard lock(mutex_);  // A call of another thread that is still watched.
}

void PowerLoss::Promise(int number) {
  const std::lock_guard lock(mutex_);
  promised_ = number;
}

std::vector<PowerLoss::Loss> PowerLoss::Losses() {
  const Inside inside;
  const std::lock_guard lock(mutex_);
  Fail("the end");
  std::vector<Loss> losses = losses_;
  for (const auto& [way, loss] : last_) losses.push_back(loss);
  return losses;
}

void PowerLoss::Restore(const Tree& tree, const fs::path& directory) {
  fs::remove_all(directory);
  fs::create_directories(directory);
  for (const auto& [path, content] : tree) {
    if (!content) {
      fs::create_directories(directory / path);
    } else {
      std::ofstream(directory / path, std::ios::binary) << *content;
    }
  }
}

void PowerLoss::Observe(const char* function, int fd, const char* path) {
  PowerLoss* const here = watching;
  if (is_inside || here == nullptr) return;
  const Inside inside;
  here->Observed(function, fd, path);
}

void PowerLoss::Observed(const std::string& function, int fd, const char* path) {
  const auto place_of = [](int file) {
    return fs::read_symlink("/proc/self/fd/" + std::to_string(file));
  };
  const fs::path place = path == nullptr ? place_of(fd)
                         : fd >= 0       ? place_of(fd) / path
                                         : fs::absolute(path).lexically_normal();
  if (!IsBelowRoot(place)) return;
  const std::lock_guard lock(mutex_);
  if (function == "made") {
    NodeOf(place);
    return;
  }
  Fail(function + " " + place.lexically_relative(root_).string());
  if (function == "open" || function == "mkdir") being_made_.insert(place);
  if (function != "fsync" && function != "fdatasync") return;
  fs::is_directory(place) ? SyncDirectory(place) : SyncFile(place);
}

bool PowerLoss::IsBelowRoot(const fs::path& path) const {
  const std::string below = path.string() + "/";
  return below.starts_with(root_.string() + "/");
}

std::shared_ptr<PowerLoss::Node> PowerLoss::NodeOf(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::make_shared<Node>();  // Removed meanwhile.
  std::shared_ptr<Node>& node = nodes_[status.st_ino];
  // The number of one that is new may have been that of a file that was removed.
  if (being_made_.erase(path) > 0 || !node) node = std::make_shared<Node>();
  return node;
}

void PowerLoss::SyncFile(const fs::path& path) { NodeOf(path)->content = Read(path); }

void PowerLoss::SyncDirectory(const fs::path& path) {
  const std::shared_ptr<Node> node = NodeOf(path);
  node->entries.clear();
  for (const auto& entry : fs::directory_iterator(path)) {
    node->entries[entry.path().filename()] = {NodeOf(entry.path()), entry.is_directory()};
  }
}

void PowerLoss::Fail(const std::string& when) {
  // Nothing is left but what is safe for certain.
  Tree synced;
  const auto add = [&synced](const auto& self, const Node& node, const fs::path& below) -> void {
    for (const auto& [name, entry] : node.entries) {
      const auto& [child, is_directory] = entry;
      static const Content empty = std::make_shared<const std::string>();
      synced[below / name] = is_directory ? nullptr : child->content ? child->content : empty;
      if (is_directory) self(self, *child, below / name);
    }
  };
  add(add, *NodeOf(root_), "");
  Add(when + ", nothing but what was synced is left", std::move(synced));

  // All names are there, and of the files what was synced, or zeros after it.
  Tree named;
  Tree with_holes;
  std::error_code gone;
  for (fs::recursive_directory_iterator it(root_, gone), end; !gone && it != end;
       it.increment(gone)) {
    const fs::path below = it->path().lexically_relative(root_);
    if (it->is_directory(gone)) {
      named[below] = with_holes[below] = nullptr;
      continue;
    }
    const std::string safe = BytesOf(NodeOf(it->path())->content);
    std::string zeros = safe;
    const std::uintmax_t size = it->file_size(gone);
    if (!gone) zeros.resize(std::max<std::size_t>(safe.size(), size));
    gone.clear();
    named[below] = std::make_shared<const std::string>(safe);
    with_holes[below] = std::make_shared<const std::string>(zeros);
  }
  Add(when + ", names are left", std::move(named));
  Add(when + ", names and sizes are left", std::move(with_holes));
}

void PowerLoss::Add(std::string when, Tree tree) {
  Loss loss{.when = std::move(when), .promised = promised_, .tree = std::move(tree)};
  Loss& last = last_[loss.when.substr(loss.when.find(','))];
  const bool is_first = last.when.empty();
  if (!is_first && !IsSame(last.tree, loss.tree)) losses_.push_back(last);
  last = std::move(loss);
}

}  // namespace slalom::test
